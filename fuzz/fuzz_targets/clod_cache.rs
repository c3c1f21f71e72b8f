//! Cached contact hierarchies: whatever a file says, it is refused or can be queried.
//!
//! With a first byte that is even, the rest is what a file holds after its header; else the rest are changes of a good one: place (two bytes)
//! and value, which get past the lengths that random bytes rarely get right.

#![no_main]

use hapteron_collision::Surface;
use hapteron_collision::clod::{Detail, Hierarchy, Lod, LodWorkspace, query_levels};
use hapteron_collision::mesh::TriMesh;
use nalgebra::{Isometry3, Translation3};
use std::sync::OnceLock;

/// In a file before what `from_body` reads: name, version, key, checksum.
const HEADER: usize = 8 + 4 + 32 + 32;

/// A wavy sheet, with its hierarchy as bytes.
fn good() -> &'static (Surface, Vec<u8>) {
    static GOOD: OnceLock<(Surface, Vec<u8>)> = OnceLock::new();
    GOOD.get_or_init(|| {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for i in 0..12u32 {
            for j in 0..12u32 {
                let (x, y) = (f64::from(i) * 0.1, f64::from(j) * 0.1);
                vertices.push([x, y, 0.05 * (5.0 * x).sin() * (4.0 * y).cos()]);
                if i > 0 && j > 0 {
                    let [a, b, c, d] = [(i - 1) * 12 + j - 1, i * 12 + j - 1, i * 12 + j, (i - 1) * 12 + j];
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        let surface = Surface::build(&TriMesh::new(vertices, triangles).expect("a sheet is a mesh"));
        let hierarchy = Hierarchy::build(&surface, &mut |_| true).expect("nobody stops it");
        let bytes = hierarchy.to_bytes(&surface);
        (surface, bytes)
    })
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let [first, rest @ ..] = bytes else { return };
    let (surface, file) = good();
    let body = if first % 2 == 0 {
        rest.to_vec()
    } else {
        let mut body = file[HEADER..].to_vec();
        for change in rest.chunks_exact(3) {
            let place = usize::from(u16::from_le_bytes([change[0], change[1]])) % body.len();
            body[place] ^= change[2];
        }
        body
    };
    // The checksum of a whole file is not to be met by chance.
    let _ = Hierarchy::from_bytes(rest, surface);
    let Ok(hierarchy) = Hierarchy::from_body(&body, surface) else { return };
    let lod = Lod { surface, hierarchy: &hierarchy };
    let mut workspace = LodWorkspace::new();
    for height in [0.01, 0.012] {
        let pose = Isometry3::from(Translation3::new(0.02, 0.01, height));
        let detail = Detail::threshold(0.05);
        let found = query_levels(lod, &pose, lod, &Isometry3::identity(), 0.03, &detail, &mut workspace);
        assert!(found.contacts.iter().all(|c| c.depth.is_finite() && c.weight.is_finite()));
    }
});
