//! Mass properties of a closed mesh, from exact integrals over the tetrahedra between its triangles and a point.

use super::{MeshError, MeshProblem, TriMesh, check};
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub};
use nalgebra::{Matrix3, Vector3};

/// A surface whose oriented areas add up to less than this share of its area is closed.
const CLOSED: f64 = 1e-6;
/// Least volume, as a share of the bounding box.
const FLAT: f64 = 1e-9;

/// Volume, centre of mass and inertia of a solid of uniform density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// In cubic metres.
    pub volume: f64,
    /// In the mesh frame, metres.
    pub center_of_mass: Vector3<f64>,
    /// Inertia tensor about the centre of mass for a mass of 1 kg, mesh axes, in square metres.
    pub inertia_per_mass: Matrix3<f64>,
}

/// Mass properties of a closed, consistently oriented mesh. Cracks without width (where a corner of one face lies on an edge
/// of another) do not matter.
///
/// # Errors
/// An open mesh, one whose faces point inward or not all the same way, or one without volume: such a body needs its mass properties given.
pub fn mass_properties(mesh: &TriMesh) -> Result<MassProperties, MeshError> {
    let no_volume = |reason: String| MeshError::new("mesh", MeshProblem::NoVolume { reason });
    let report = check(mesh);
    // The oriented areas of a closed surface add up to nothing, and only then does the volume not depend on the origin.
    let open = norm(oriented_area(mesh)) > CLOSED * report.area;
    if open || report.inconsistent_edges > 0 {
        return Err(no_volume(format!(
            "it is open or its faces do not agree about the outside: {} boundary edges, {} edges with more than two faces, {} between faces of opposite orientation",
            report.boundary_edges, report.non_manifold_edges, report.inconsistent_edges
        )));
    }
    let properties = integrate(mesh);
    let [low, high] = mesh.bounds();
    let extent = sub(high, low);
    let box_volume = extent[0] * extent[1] * extent[2];
    if properties.volume < -FLAT * box_volume {
        return Err(no_volume("its faces point inward; flip them".into()));
    }
    if !(properties.volume > FLAT * box_volume && properties.volume.is_finite()) {
        return Err(no_volume("it is flat".into()));
    }
    Ok(properties)
}

fn oriented_area(mesh: &TriMesh) -> Vec3 {
    mesh.triangles().iter().fold([0.0; 3], |sum, t| {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize]);
        add(sum, scale(cross(sub(b, a), sub(c, a)), 0.5))
    })
}

/// The integrals, whatever the mesh; they have their meaning for a closed one.
pub(super) fn integrate(mesh: &TriMesh) -> MassProperties {
    // About the middle of the box: far from the origin the moments would cancel.
    let ([ox, oy, oz], _) = mesh.bounding_sphere();
    let origin = [ox, oy, oz];
    let mut volume = 0.0;
    let mut first = [0.0; 3];
    // Second moments xx, yy, zz, xy, yz, zx.
    let mut second = [0.0; 6];
    for triangle in mesh.triangles() {
        let [a, b, c] = triangle.map(|v| sub(mesh.vertices()[v as usize], origin));
        let six = dot(a, cross(b, c));
        volume += six / 6.0;
        let sum: Vec3 = add(a, add(b, c));
        first = add(first, scale(sum, six / 24.0));
        let moment = |i: usize, j: usize| a[i] * a[j] + b[i] * b[j] + c[i] * c[j] + sum[i] * sum[j];
        for (k, (i, j)) in [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)].into_iter().enumerate() {
            second[k] += six / 120.0 * moment(i, j);
        }
    }
    let center = scale(first, 1.0 / volume);
    let per_mass = second.map(|m| m / volume);
    let covariance = |k: usize, i: usize, j: usize| per_mass[k] - center[i] * center[j];
    let (xx, yy, zz) = (covariance(0, 0, 0), covariance(1, 1, 1), covariance(2, 2, 2));
    let (xy, yz, zx) = (covariance(3, 0, 1), covariance(4, 1, 2), covariance(5, 2, 0));
    let com = add(center, origin);
    MassProperties {
        volume,
        center_of_mass: Vector3::new(com[0], com[1], com[2]),
        inertia_per_mass: Matrix3::new(yy + zz, -xy, -zx, -xy, xx + zz, -yz, -zx, -yz, xx + yy),
    }
}
