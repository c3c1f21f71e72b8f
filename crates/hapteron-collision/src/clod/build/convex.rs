//! Convexity of surface patches: every vertex of a patch on or below the plane of every one of its faces. That is the
//! same as: the patch lies on the boundary of its convex hull, and the hull buries none of its faces.

use crate::vector::{Vec3, cross, dot, norm, sub};
use robust::{Coord3D, orient3d};

/// A point may stand above a face of its patch by this share of the object's radius: the rounding of coordinates in files.
pub(crate) const CONVEX_SLACK: f64 = 1e-9;

/// Height of `p` above the plane of a triangle, outward positive; the sign is exact.
#[inline]
pub(crate) fn height([a, b, c]: [Vec3; 3], p: Vec3) -> f64 {
    let coord = |v: Vec3| Coord3D { x: v[0], y: v[1], z: v[2] };
    // Positive when the fourth point is below the plane of the others, seen counter-clockwise from above.
    let volume = orient3d(coord(a), coord(b), coord(c), coord(p));
    let area = norm(cross(sub(b, a), sub(c, a)));
    if area > 0.0 { -volume / area } else { 0.0 }
}

/// Whether no point is above the triangle by more than `slack`.
pub(crate) fn all_below(triangle: [Vec3; 3], mut points: impl Iterator<Item = Vec3>, slack: f64) -> bool {
    points.all(|p| height(triangle, p) <= slack)
}

/// Twice the area times the unit normal.
#[inline]
pub(crate) fn area_vector([a, b, c]: [Vec3; 3]) -> Vec3 {
    cross(sub(b, a), sub(c, a))
}

/// Ratio of the height over the longest side to that side: 0 for a needle, 0.87 for an equilateral triangle.
#[inline]
pub(crate) fn shape_quality([a, b, c]: [Vec3; 3]) -> f64 {
    let longest = [sub(b, a), sub(c, b), sub(a, c)].map(|e| dot(e, e)).into_iter().fold(0.0, f64::max);
    if longest > 0.0 { norm(area_vector([a, b, c])) / longest } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch the wrong sign convention of the predicate.
    #[test]
    fn height_is_positive_outside() {
        let t = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert!((height(t, [0.3, 0.3, 2.0]) - 2.0).abs() < 1e-12);
        assert!((height(t, [0.3, 0.3, -0.5]) + 0.5).abs() < 1e-12);
        assert_eq!(height(t, [7.0, -3.0, 0.0]), 0.0);
    }
}
