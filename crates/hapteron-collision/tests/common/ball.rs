//! Balls by rings and sectors: for tests inside the library, tests of its interface, and benchmarks.

use std::f64::consts::{PI, TAU};

/// Vertices and triangles of a ball, `rings` bands from pole to pole, whose radius depends on the angles from the pole and around it. The
/// vertices of a cavity stand between those of a ball by this share of a sector, and its faces look inward.
pub fn ball(
    rings: u32,
    radius: impl Fn(f64, f64) -> f64,
    cavity: Option<f64>,
) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let sectors = 2 * rings;
    let mut vertices = vec![[0.0, 0.0, radius(0.0, 0.0)]];
    for i in 1..rings {
        let theta = PI * f64::from(i) / f64::from(rings);
        for j in 0..sectors {
            let phi = TAU * (f64::from(j) + cavity.unwrap_or(0.0)) / f64::from(sectors);
            let unit = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
            vertices.push(unit.map(|c| radius(theta, phi) * c));
        }
    }
    vertices.push([0.0, 0.0, -radius(PI, 0.0)]);
    let at = |i: u32, j: u32| 1 + (i - 1) * sectors + j % sectors;
    let last = vertices.len() as u32 - 1;
    let mut triangles = Vec::new();
    for j in 0..sectors {
        triangles.push([0, at(1, j), at(1, j + 1)]);
        triangles.push([last, at(rings - 1, j + 1), at(rings - 1, j)]);
        for i in 1..rings - 1 {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    if cavity.is_some() {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    (vertices, triangles)
}
