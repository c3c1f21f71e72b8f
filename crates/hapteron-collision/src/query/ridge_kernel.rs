//! The inner loops over edges, eight at a time; like those of the kernel, but in single precision throughout: what they
//! let through is looked at again exactly, and what they refuse is certain.

use super::kernel::{LaneMask, Lanes};
use super::kernel::{bits, lanes, lanes_of};
use super::ridge_store::RidgeBlock;
use crate::surface::{Cone, LANES, Leaf};
use fearless_simd::{Simd, prelude::*};

/// Bound of the accumulated rounding relative to the magnitudes of the factors: some 20 operations of half a unit in the last
/// place each, and the rounding of what they start from.
const ERROR: f32 = 3e-6;

/// Up to eight segments.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct SegmentBlock {
    pub ends: [[[f32; LANES]; 3]; 2],
}

impl SegmentBlock {
    /// Lanes that are near nothing: so far away that they never are the closest, but not so far that a height is not a number.
    pub(super) const EMPTY: Self = Self { ends: [[[1e30; LANES]; 3]; 2] };

    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, ends: [[f32; 3]; 2]) {
        for axis in 0..3 {
            self.ends[0][axis][lane] = ends[0][axis];
            self.ends[1][axis][lane] = ends[1][axis];
        }
    }

    /// Lower bounds of the distances to a leaf; not positive where they may meet its bounds.
    #[inline(always)]
    pub(super) fn apart<S: Simd>(&self, simd: S, leaf: &Leaf, slack: f32) -> Lanes<S> {
        let mut apart = Lanes::splat(simd, f32::NEG_INFINITY);
        let mut heights = [Lanes::splat(simd, 0.0); 2];
        for k in 0..3 {
            let (a, b) = (lanes(simd, &self.ends[0][k]), lanes(simd, &self.ends[1][k]));
            apart = apart.max(Lanes::splat(simd, leaf.min[k]) - a.max(b)).max(a.min(b) - leaf.max[k]);
            let normal = Lanes::splat(simd, leaf.normal[k]);
            heights[0] += normal * a;
            heights[1] += normal * b;
        }
        let (low, high) = (heights[0].min(heights[1]), heights[0].max(heights[1]));
        apart.max(Lanes::splat(simd, leaf.low) - high).max(low - leaf.high) - slack
    }
}

/// Up to eight edges of a leaf of the body in the obstacle's frame: about the leaf's origin, as a start and a vector to the end, with
/// their normal cones.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct MovedRidges {
    /// Where they are in the obstacle's frame.
    pub segments: SegmentBlock,
    start: [[f32; LANES]; 3],
    along: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    cos: [f32; LANES],
    sin: [f32; LANES],
}

impl MovedRidges {
    pub(super) const EMPTY: Self = Self {
        segments: SegmentBlock::EMPTY,
        start: [[0.0; LANES]; 3],
        along: [[0.0; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        cos: [1.0; LANES],
        sin: [0.0; LANES],
    };

    /// Takes a block after a rotation; its origin is then at `origin`.
    #[inline(always)]
    pub(super) fn set<S: Simd>(
        &mut self,
        simd: S,
        block: &RidgeBlock,
        rotation: &[[f32; 3]; 3],
        origin: [f32; 3],
    ) {
        let (start, along) = (lanes_of(simd, &block.start), lanes_of(simd, &block.along));
        let (normal, cos) = (lanes_of(simd, &block.normal), lanes(simd, &block.cos));
        for row in 0..3 {
            let turn = splat(simd, rotation[row]);
            let (from, to) = (dot(turn, start), dot(turn, along));
            let first = from + origin[row];
            self.start[row] = from.to_array();
            self.along[row] = to.to_array();
            self.normal[row] = dot(turn, normal).to_array();
            self.segments.ends[0][row] = first.to_array();
            self.segments.ends[1][row] = (first + to).to_array();
        }
        (self.cos, self.sin) = (cos.to_array(), sine(cos).to_array());
    }

    /// Which edges may touch something with a normal in this cone.
    #[inline(always)]
    pub(super) fn facing<S: Simd>(&self, simd: S, cone: &Cone) -> u32 {
        let (cos, sin) = (lanes(simd, &self.cos), lanes(simd, &self.sin));
        bits(facing(cos, sin, lanes_of(simd, &self.normal), cone))
    }

    /// The edge of a lane, about an origin that is at `from` as seen from the one of this block.
    #[inline(always)]
    pub(super) fn edge(&self, lane: usize, from: [f32; 3]) -> OneRidge {
        let start = [self.start[0][lane], self.start[1][lane], self.start[2][lane]];
        let axis = [self.normal[0][lane], self.normal[1][lane], self.normal[2][lane]];
        OneRidge {
            start: [start[0] - from[0], start[1] - from[1], start[2] - from[2]],
            along: [self.along[0][lane], self.along[1][lane], self.along[2][lane]],
            cone: Cone { axis, cos: self.cos[lane], sin: self.sin[lane] },
        }
    }
}

/// An edge of the body about the origin of a leaf of the obstacle.
#[derive(Clone, Copy, Debug)]
pub(super) struct OneRidge {
    pub start: [f32; 3],
    pub along: [f32; 3],
    pub cone: Cone,
}

/// Bit `i` is set when edge `i` of the block may touch the single one: surfaces with these normal cones can touch, the common perpendicular
/// meets both between their ends, and it is short enough. `far` is no less than any coordinate of either.
#[inline(always)]
pub(super) fn meeting<S: Simd>(simd: S, one: &OneRidge, block: &RidgeBlock, within: f32, far: f32) -> u32 {
    let cos = lanes(simd, &block.cos);
    let mask = bits(facing(cos, sine(cos), lanes_of(simd, &block.normal), &one.cone));
    if mask == 0 {
        return 0;
    }
    let (p, d) = (splat(simd, one.start), splat(simd, one.along));
    let (start, e) = (lanes_of(simd, &block.start), lanes_of(simd, &block.along));
    let r = [p[0] - start[0], p[1] - start[1], p[2] - start[2]];
    let w = [d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]];
    let (dd, ee) = (dot(d, d), dot(e, e));
    let (size, lengths) = (dd.sqrt(), ee.sqrt());
    let (whole, area) = (dot(w, w), size * lengths);
    // Distance times the root of `whole`.
    let distance = (dot(r, w).abs() - area * (far * ERROR)).max(0.0);
    let bound = whole + area * area * ERROR;
    let mask = bits((distance * distance).simd_le(bound * (within * within * (1.0 + 1e-5)))) & mask;
    if mask == 0 {
        return 0;
    }
    let (b, c, f) = (dot(d, e), dot(d, r), dot(e, r));
    // Where along each edge, times `whole`.
    let (s, t) = (b * f - c * ee, dd * f - b * c);
    let area = area * (far * ERROR);
    let (s_error, t_error) = (area * lengths, area * size);
    let between =
        s.simd_gt(-s_error) & s.simd_lt(whole + s_error) & t.simd_gt(-t_error) & t.simd_lt(whole + t_error);
    bits(between) & mask
}

#[inline(always)]
fn sine<S: Simd>(cos: Lanes<S>) -> Lanes<S> {
    (-(cos * cos) + 1.0).max(0.0).sqrt()
}

/// [`Cone::faces`] for eight cones.
#[inline(always)]
fn facing<S: Simd>(cos: Lanes<S>, sin: Lanes<S>, axes: [Lanes<S>; 3], cone: &Cone) -> LaneMask<S> {
    let aligned = dot(splat(cos.simd, cone.axis), axes);
    (cos + cone.cos).simd_le(0.0) | aligned.simd_le(sin * cone.sin - cos * cone.cos + Cone::SLACK)
}

#[inline(always)]
fn splat<S: Simd>(simd: S, v: [f32; 3]) -> [Lanes<S>; 3] {
    core::array::from_fn(
        #[inline(always)]
        |k| Lanes::splat(simd, v[k]),
    )
}

#[inline(always)]
fn dot<S: Simd>(a: [Lanes<S>; 3], b: [Lanes<S>; 3]) -> Lanes<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::mesh::TriMesh;
    use crate::surface::Surface;
    use crate::vector::{Vec3, add, norm, scale, sub};
    use fearless_simd::{Level, dispatch};

    /// Would catch a lane without an edge that hides how close the others are: then edges would not be looked at when they come near.
    #[test]
    fn empty_lanes_hide_no_distance() {
        let mesh = TriMesh::new(vec![[0.0; 3], [1.0, 0.0, -1.0], [0.0, 1.0, 1.0]], vec![[0, 1, 2]]).unwrap();
        let surface = Surface::build(&mesh);
        for edges in 1..=LANES {
            let mut block = SegmentBlock::EMPTY;
            for lane in 0..edges {
                let x = 3.0 + (edges - lane) as f32;
                block.set(lane, [[x, 0.0, 0.0], [x, 1.0, 0.0]]);
            }
            let least = dispatch!(Level::new(), simd => {
                block.apart(simd, &surface.leaves[0], 0.0).reduce_min()
            });
            assert_eq!(least, 3.0, "{edges}");
        }
    }

    /// Would catch a pair of edges that is refused although their common perpendicular is short enough, meets both and lies in
    /// both cones: nearly parallel ones, and ones that have passed each other, included.
    #[test]
    fn edges_that_touch_are_never_refused() {
        let mut seed = 11u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let (mut touching, mut refused) = (0, 0);
        for round in 0..200_000 {
            let mut vector = || [number(), number(), number()];
            let (d, mix) = (vector(), vector());
            let e = add(scale(d, 1.0), scale(mix, 0.1f64.powi(round % 6)));
            // Built from the perpendicular, so that many touch.
            let u = crate::vector::unit_or_zero(crate::vector::cross(d, e));
            let q: Vec3 = vector();
            let (gap, s, t) = (0.02 * number(), 0.6 * number() + 0.5, 0.6 * number() + 0.5);
            let p = add(q, scale(u, gap));
            let (start, other) = (sub(p, scale(d, s)), sub(q, scale(e, t)));
            let to32 = |v: Vec3| v.map(|c| c as f32);
            let within = 0.01;
            let outward = scale(u, if round % 3 == 0 { 1.0 } else { -1.0 });
            let mut block = RidgeBlock::EMPTY;
            let opposite = Cone::wide(to32(scale(outward, -1.0)), 0.999);
            block.set(0, [to32(other), to32(add(other, e))], opposite.axis, opposite.cos);
            let cone = Cone::wide(to32(outward), 0.999);
            let one = OneRidge { start: to32(start), along: to32(d), cone };
            let far = (norm(start) + norm(d) + norm(other) + norm(e)) as f32;
            let hit = dispatch!(Level::new(), simd => meeting(simd, &one, &block, within, far)) & 1;
            let between = s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0;
            if between && gap.abs() < f64::from(within) && norm(u) > 0.5 {
                touching += 1;
                assert_eq!(hit, 1, "{round}: {s} {t} {gap}");
            } else if hit == 0 {
                refused += 1;
            }
        }
        assert!(touching > 20_000 && refused > 20_000, "{touching} {refused}");
    }
}
