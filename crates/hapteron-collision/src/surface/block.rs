//! The triangles of a leaf, made ready for the distance of a point to all of them at once.

use super::{LANES, Leaf, Surface};
use crate::vector::{Vec3, cross, dot, norm, scale, sub, unit_or_zero};

/// Up to sixteen triangles, each with a frame of its own: `x` along its first side, `y` across it into the triangle, `z`
/// along its normal. Then the distance is one of two dimensions, without a division and however thin the triangle is.
///
/// Single precision, about an origin nearby: what it finds is certain to [`TriangleBlock::error`].
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct TriangleBlock {
    /// The first corner from the origin, by axis and lane.
    pub corner: [[f32; LANES]; 3],
    pub along: [[f32; LANES]; 3],
    pub across: [[f32; LANES]; 3],
    pub normal: [[f32; LANES]; 3],
    /// Directions of the second side (from the second corner) and the third (from the first corner), `x` and `y`.
    pub second: [[f32; LANES]; 2],
    pub third: [[f32; LANES]; 2],
    /// Of the three sides.
    pub length: [[f32; LANES]; 3],
    pub origin: [f32; 3],
    /// Greatest error of the distance of a point that is on the block, metres; it grows by [`ERROR`] times the distance.
    pub error: f32,
}

/// Bound of the accumulated rounding relative to the coordinates: some 20 operations of half a unit in the last place each.
pub(crate) const ERROR: f32 = 2e-6;

impl TriangleBlock {
    /// The block of a leaf; the lanes that it does not fill repeat its first triangle.
    pub(super) fn new(surface: &Surface, leaf: &Leaf) -> Self {
        let origin = [0, 1, 2].map(|k| 0.5 * (leaf.min[k] + leaf.max[k]));
        let mut block = Self {
            corner: [[0.0; LANES]; 3],
            along: [[0.0; LANES]; 3],
            across: [[0.0; LANES]; 3],
            normal: [[0.0; LANES]; 3],
            second: [[0.0; LANES]; 2],
            third: [[0.0; LANES]; 2],
            length: [[0.0; LANES]; 3],
            origin,
            error: 0.0,
        };
        for lane in 0..LANES {
            let corners = surface.triangles[leaf.triangle(lane) as usize]
                .map(|v| sub(surface.vertices[v as usize], origin.map(f64::from)));
            block.set(lane, corners);
        }
        block
    }

    fn set(&mut self, lane: usize, corners: [Vec3; 3]) {
        let (ab, ac) = (sub(corners[1], corners[0]), sub(corners[2], corners[0]));
        let along = unit_or_zero(ab);
        let across = perpendicular(ac, along);
        let normal = cross(along, across);
        let (length, third) = (norm(ab), [dot(ac, along), dot(ac, across)]);
        let second = [third[0] - length, third[1]];
        for axis in 0..3 {
            self.corner[axis][lane] = corners[0][axis] as f32;
            self.along[axis][lane] = along[axis] as f32;
            self.across[axis][lane] = across[axis] as f32;
            self.normal[axis][lane] = normal[axis] as f32;
        }
        let flat = |v: [f64; 2]| (v[0] * v[0] + v[1] * v[1]).sqrt();
        for axis in 0..2 {
            self.second[axis][lane] = (second[axis] / flat(second).max(f64::MIN_POSITIVE)) as f32;
            self.third[axis][lane] = (third[axis] / flat(third).max(f64::MIN_POSITIVE)) as f32;
        }
        for (side, length) in [length, flat(second), flat(third)].into_iter().enumerate() {
            self.length[side][lane] = length as f32;
        }
        let radius = corners.iter().map(|&c| norm(c)).fold(0.0, f64::max);
        self.error = self.error.max((2.0 * f64::from(ERROR) * radius) as f32);
    }
}

/// The unit vector towards `v` that is perpendicular to `along`; any such where `v` has no part across.
fn perpendicular(v: Vec3, along: Vec3) -> Vec3 {
    let reject = |v: Vec3| unit_or_zero(sub(v, scale(along, dot(v, along))));
    // Twice: the first result of a very thin triangle is mostly rounding.
    let across = reject(reject(v));
    if across != [0.0; 3] {
        return across;
    }
    let least = (0..3).fold(0, |k, l| if along[l].abs() < along[k].abs() { l } else { k });
    let mut other = [0.0; 3];
    other[least] = 1.0;
    reject(other)
}
