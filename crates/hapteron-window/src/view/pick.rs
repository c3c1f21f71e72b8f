//! What is under the pointer.

use hapteron::collision::mesh::TriMesh;
use nalgebra::{Isometry3, Point3, Vector3};

/// Finds where a ray meets a mesh; every triangle is asked, which takes some tenths of a millisecond for 100,000.
pub struct Picker;

impl Picker {
    /// Distance along a ray (unit direction, world) to the nearest triangle of a mesh at a pose.
    #[must_use]
    pub fn distance(
        mesh: &TriMesh,
        world_from_mesh: &Isometry3<f64>,
        eye: &Point3<f64>,
        ray: &Vector3<f64>,
    ) -> Option<f64> {
        let origin = world_from_mesh.inverse_transform_point(eye);
        let ray = world_from_mesh.inverse_transform_vector(ray);
        let corner = |v: u32| Point3::from(mesh.vertices()[v as usize]);
        let hits = mesh.triangles().iter().filter_map(|t| hit(&origin, &ray, t.map(corner)));
        hits.min_by(f64::total_cmp)
    }
}

/// Where a ray meets a triangle (Moeller and Trumbore 1997).
fn hit(origin: &Point3<f64>, ray: &Vector3<f64>, [a, b, c]: [Point3<f64>; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = ray.cross(&ac);
    let det = ab.dot(&p);
    if det == 0.0 {
        return None;
    }
    let from = origin - a;
    let u = from.dot(&p) / det;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = from.cross(&ab);
    let v = ray.dot(&q) / det;
    let t = ac.dot(&q) / det;
    (v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapteron::assets;
    use nalgebra::UnitQuaternion;

    /// Would catch a ray that is not brought into the mesh's frame: the spoon is hit where it is, and missed where it was.
    #[test]
    fn the_moved_spoon_is_hit_from_above() {
        let mesh = assets::builtin("spoon").unwrap();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let pose = Isometry3::from_parts(Vector3::new(1.0, 0.0, 0.0).into(), turn);
        let grip = pose * Point3::from(hapteron::scenes::SPOON_GRIP);
        let eye = grip + Vector3::z();
        let found = Picker::distance(&mesh, &pose, &eye, &-Vector3::z()).unwrap();
        assert!((found - 1.0).abs() < 0.02, "{found}");
        let away = Point3::new(0.05, 0.0, 1.0);
        assert_eq!(Picker::distance(&mesh, &pose, &away, &-Vector3::z()), None);
    }
}
