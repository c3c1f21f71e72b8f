//! Meshes as they are drawn: smooth normals with creases, and a cage of lines for the ghost.

use hapteron::collision::mesh::{self, TriMesh};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;

/// Normals are averaged at vertices, except over edges sharper than this angle, radians.
const CREASE: f64 = 0.7;
/// Meshes up to this size are their own cage.
const OWN_CAGE: usize = 2_500;
/// Cells along the longest side of a cage.
const CAGE_CELLS: f64 = 19.0;

/// A corner as the graphics card takes it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    /// Metres, mesh frame.
    pub position: [f32; 3],
    /// Unit.
    pub normal: [f32; 3],
    /// Red, green, blue, opacity; multiplied with the colour of the whole.
    pub colour: [u8; 4],
}

/// A mesh that can be drawn.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    /// Corners; those of one place differ in normal only.
    pub vertices: Vec<Vertex>,
    /// Three a triangle.
    pub indices: Vec<u32>,
    /// Ends of lines that show the shape as a wire.
    pub cage: Vec<[[f32; 3]; 2]>,
    /// No edge is open: its inside cannot be seen.
    pub closed: bool,
    /// Centre and radius of a sphere around it, mesh frame, metres.
    pub center: Point3<f64>,
    /// Metres.
    pub radius: f64,
}

const WHITE: [u8; 4] = [255; 4];

impl Shape {
    /// Of a mesh.
    #[must_use]
    pub fn of(mesh: &TriMesh) -> Self {
        let ([x, y, z], radius) = mesh.bounding_sphere();
        let (vertices, indices) = smoothed(mesh);
        let closed = mesh::mass_properties(mesh).is_ok();
        Self { vertices, indices, cage: cage(mesh), closed, center: Point3::new(x, y, z), radius }
    }
}

fn at(mesh: &TriMesh, index: u32) -> Vector3<f64> {
    Vector3::from(mesh.vertices()[index as usize])
}

/// Corners with the mean normal of the faces around them that are not beyond a crease, weighted by area.
fn smoothed(mesh: &TriMesh) -> (Vec<Vertex>, Vec<u32>) {
    let triangles = mesh.triangles();
    let face = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| at(mesh, v));
        (b - a).cross(&(c - a))
    };
    let faces: Vec<Vector3<f64>> = triangles.iter().map(face).collect();
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); mesh.vertices().len()];
    for (index, triangle) in triangles.iter().enumerate() {
        for &v in triangle {
            around[v as usize].push(index as u32);
        }
    }
    let limit = CREASE.cos();
    // The corners made so far at each vertex, so that those with one normal are one.
    let mut made: Vec<Vec<u32>> = vec![Vec::new(); mesh.vertices().len()];
    let mut vertices: Vec<Vertex> = Vec::with_capacity(mesh.vertices().len());
    let mut indices = Vec::with_capacity(3 * triangles.len());
    for (triangle, own) in triangles.iter().zip(&faces) {
        for &v in triangle {
            let near = |f: &&Vector3<f64>| own.dot(f) >= limit * own.norm() * f.norm();
            let sum: Vector3<f64> = around[v as usize].iter().map(|&f| &faces[f as usize]).filter(near).sum();
            let length = sum.norm();
            let normal = if length > 0.0 { sum / length } else { Vector3::z() };
            let normal: [f32; 3] = normal.map(|c| c as f32).into();
            let same = |&&i: &&u32| {
                let n = vertices[i as usize].normal;
                n.iter().zip(normal).all(|(a, b)| (a - b).abs() < 0.02)
            };
            let found = made[v as usize].iter().find(same).copied();
            let index = found.unwrap_or_else(|| {
                let position = mesh.vertices()[v as usize].map(|c| c as f32);
                vertices.push(Vertex { position, normal, colour: WHITE });
                made[v as usize].push(vertices.len() as u32 - 1);
                vertices.len() as u32 - 1
            });
            indices.push(index);
        }
    }
    (vertices, indices)
}

/// Lines that show the shape: its edges, or for a fine mesh those of a coarse one, made by moving all vertices of a cell to one
/// (vertex clustering, Rossignac and Borrel 1993).
fn cage(mesh: &TriMesh) -> Vec<[[f32; 3]; 2]> {
    let [low, high] = mesh.bounds();
    let longest = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    let fine = mesh.triangles().len() <= OWN_CAGE || !(longest > 0.0);
    let cell = longest / CAGE_CELLS;
    let mut cells: BTreeMap<[i32; 3], u32> = BTreeMap::new();
    let mut sums: Vec<(Vector3<f64>, f64)> = Vec::new();
    let place: Vec<u32> = (0..mesh.vertices().len() as u32)
        .map(|v| {
            let p = mesh.vertices()[v as usize];
            let key = std::array::from_fn(|i| ((p[i] - low[i]) / cell).floor() as i32);
            let index = if fine {
                sums.push((Vector3::zeros(), 0.0));
                v
            } else {
                *cells.entry(key).or_insert_with(|| {
                    sums.push((Vector3::zeros(), 0.0));
                    sums.len() as u32 - 1
                })
            };
            sums[index as usize].0 += Vector3::from(p);
            sums[index as usize].1 += 1.0;
            index
        })
        .collect();
    let mut edges = std::collections::BTreeSet::new();
    for triangle in mesh.triangles() {
        let [a, b, c] = triangle.map(|v| place[v as usize]);
        for (i, j) in [(a, b), (b, c), (c, a)] {
            if i != j {
                edges.insert((i.min(j), i.max(j)));
            }
        }
    }
    let point = |i: u32| -> [f32; 3] {
        let (sum, count) = sums[i as usize];
        (sum / count).map(|c| c as f32).into()
    };
    edges.into_iter().map(|(a, b)| [point(a), point(b)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapteron::assets;

    /// A cube of two triangles a side.
    fn cube() -> TriMesh {
        let vertices = (0..8).map(|i| [i & 1, (i >> 1) & 1, i >> 2].map(f64::from)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        TriMesh::new(vertices, triangles).unwrap()
    }

    /// Would catch normals smeared over sharp edges, and corners that are not shared where they could be.
    #[test]
    fn a_cube_keeps_its_edges() {
        let shape = Shape::of(&cube());
        assert_eq!(shape.vertices.len(), 24);
        assert_eq!(shape.indices.len(), 36);
        for vertex in &shape.vertices {
            let along: Vec<f32> = vertex.normal.iter().map(|c| c.abs()).collect();
            assert_eq!(along.iter().filter(|c| **c == 1.0).count(), 1, "{vertex:?}");
        }
        assert_eq!(shape.cage.len(), 18);
    }

    /// Would catch a cage of a fine mesh that is too dense to see through, or that leaves the surface.
    #[test]
    fn a_fine_mesh_has_a_coarse_cage_near_its_surface() {
        let mesh = assets::builtin("upper_jaw").unwrap();
        let shape = Shape::of(&mesh);
        assert!(shape.cage.len() > 500 && shape.cage.len() < 8_000, "{}", shape.cage.len());
        let [low, high] = mesh.bounds();
        for end in shape.cage.iter().flatten() {
            for axis in 0..3 {
                assert!(f64::from(end[axis]) > low[axis] - 1e-6 && f64::from(end[axis]) < high[axis] + 1e-6);
            }
        }
        // Smoothing must not take every corner apart.
        assert!(shape.vertices.len() < 2 * mesh.vertices().len(), "{}", shape.vertices.len());
    }
}
