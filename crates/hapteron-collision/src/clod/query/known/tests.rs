//! Feet against brute force.

use super::*;
use crate::surface::Surface;
use crate::vector::{Rigid, norm, sub};

/// A wavy sheet of 2 n^2 triangles, a metre wide.
fn sheet(n: u32) -> Surface {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let at = |i: u32, j: u32| i * (n + 1) + j;
    for i in 0..=n {
        for j in 0..=n {
            let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            vertices.push([x, y, 0.05 * (9.0 * x).sin() * (7.0 * y).cos()]);
            if i > 0 && j > 0 {
                triangles.push([at(i - 1, j - 1), at(i, j - 1), at(i, j)]);
                triangles.push([at(i - 1, j - 1), at(i, j), at(i - 1, j)]);
            }
        }
    }
    Surface::of_triangles(&vertices, &triangles)
}

/// Would catch a foot that is not the closest because of what was remembered, along slow and fast motions, with feet on
/// faces, edges and vertices (of six triangles), near and out of reach: every triangle is looked at for comparison.
#[test]
fn feet_are_the_closest_along_motions() {
    let surface = sheet(24);
    let still =
        Rigid { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };
    let (limit, band) = (0.06, 0.03);
    let (mut near, mut far, mut searches) = (0, 0, 0);
    for (round, step) in [0.0002, 0.001, 0.006, 0.05].into_iter().enumerate() {
        let (mut known, mut nearest) = (Known::UNKNOWN, Nearest::default());
        let (mut last, mut travelled) = ([0.0; 3], 0.0);
        for i in 0..400 {
            let t = step * f64::from(i);
            // Over a vertex of the sheet at first.
            let p = [
                0.25 + 0.4 * (t * (1.0 + round as f64)).sin(),
                0.5 + 0.3 * t.cos() - 0.3,
                0.08 * (3.0 * t).cos(),
            ];
            travelled += if i > 0 { norm(sub(p, last)) } else { 0.0 };
            last = p;
            let search = Search {
                own: &surface,
                other: &surface,
                motion: &still,
                last: &still,
                level: fearless_simd::Level::new(),
                tolerance: limit,
                travelled,
            };
            let looks = &mut Looks::default();
            let found = known.look(p, &search, limit, band, 2e-6, &mut nearest, looks, &mut searches);
            let feet = (0..surface.triangles.len() as u32).map(|t| feature::foot(p, t, &surface));
            let least = feet.map(|f| f.signed_distance.abs()).fold(f64::INFINITY, f64::min);
            match found {
                Some(foot) => {
                    near += 1;
                    assert!((foot.signed_distance.abs() - least).abs() < 1e-15, "{foot:?} {least}");
                    assert!((known.distance - least).abs() < 1e-15 && known.exact);
                }
                None => {
                    far += 1;
                    assert!(least > limit && known.distance <= least, "{least} {}", known.distance);
                }
            }
        }
    }
    assert!(searches > 10 && searches < 800, "{searches}");
    assert!(near > 400 && far > 100, "{near} {far}");
}
