//! Queries between arbitrary triangles: finite contacts, whatever the meshes are.

#![no_main]

use hapteron_collision::mesh::TriMesh;
use hapteron_collision::{QueryWorkspace, Surface, query};
use nalgebra::{Isometry3, Translation3};

/// Coordinates on a coarse grid make degenerate positions likely: shared planes, touching corners, folded surfaces.
fn mesh(bytes: &[u8]) -> Option<TriMesh> {
    let vertices: Vec<[f64; 3]> =
        bytes.chunks_exact(2).map(|b| [b[0] & 15, b[0] >> 4, b[1] & 15].map(|c| f64::from(c) * 1e-3)).collect();
    let index = |b: &u8| u32::from(*b) % vertices.len().max(1) as u32;
    let triangles = bytes.chunks_exact(3).map(|b| [index(&b[0]), index(&b[1]), index(&b[2])]).collect();
    TriMesh::new(vertices, triangles).ok()
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let [x, y, z, tolerance, rest @ ..] = bytes else { return };
    let (first, second) = rest.split_at(rest.len() / 2);
    let (Some(first), Some(second)) = (mesh(first), mesh(second)) else { return };
    let (body, obstacle) = (Surface::build(&first), Surface::build(&second));
    let shift = [x, y, z].map(|c| (f64::from(*c) - 128.0) * 1e-4);
    let mut workspace = QueryWorkspace::new();
    let still = Isometry3::identity();
    for moved in [0.0, 1e-5] {
        let pose = Isometry3::from(Translation3::new(shift[0] + moved, shift[1], shift[2]));
        let found = query(&body, &pose, &obstacle, &still, f64::from(*tolerance) * 1e-5, &mut workspace);
        for contact in found.contacts {
            assert!(contact.point_body.iter().chain(contact.normal.iter()).all(|c| c.is_finite()));
            assert!(contact.depth.is_finite());
            assert!((contact.normal.norm() - 1.0).abs() < 1e-6);
        }
    }
});
