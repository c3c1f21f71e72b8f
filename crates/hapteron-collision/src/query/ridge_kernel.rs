//! The inner loops over edges, sixteen at a time; like those of the kernel, but in single precision throughout: what they
//! let through is looked at again exactly, and what they refuse is certain.

use super::kernel::{Lanes, bits, dot, lanes, lanes_of, splat};
use super::ridge_store::RidgeBlock;
use crate::surface::{Cone, LANES, Leaf};
use fearless_simd::{Simd, prelude::*};

/// Bound of the accumulated rounding relative to the magnitudes of the factors: some 20 operations of half a unit in the last
/// place each, and the rounding of what they start from.
const ERROR: f32 = 3e-6;

/// Segments with their boxes.
#[derive(Clone, Copy)]
pub(super) struct Segments<S: Simd> {
    ends: [[Lanes<S>; 3]; 2],
    low: [Lanes<S>; 3],
    high: [Lanes<S>; 3],
}

impl<S: Simd> Segments<S> {
    #[inline(always)]
    fn new(a: [Lanes<S>; 3], b: [Lanes<S>; 3]) -> Self {
        let low = [a[0].min(b[0]), a[1].min(b[1]), a[2].min(b[2])];
        let high = [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2])];
        Self { ends: [a, b], low, high }
    }

    /// Lower bounds of the distances to a leaf, rounding aside.
    #[inline(always)]
    pub(super) fn apart(&self, leaf: &Leaf) -> Lanes<S> {
        let simd = self.low[0].simd;
        let normal = splat(simd, leaf.normal);
        let (from, to) = (dot(normal, self.ends[0]), dot(normal, self.ends[1]));
        let mut apart = (Lanes::splat(simd, leaf.low) - from.max(to)).max(from.min(to) - leaf.high);
        for k in 0..3 {
            apart = apart.max(Lanes::splat(simd, leaf.min[k]) - self.high[k]).max(self.low[k] - leaf.max[k]);
        }
        apart
    }
}

/// Up to sixteen edges of a leaf of the body in the obstacle's frame, like [`RidgeBlock`].
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct MovedRidges {
    start: [[f32; LANES]; 3],
    along: [[f32; LANES]; 3],
    across: [[f32; LANES]; 3],
    cos: [f32; LANES],
    length: [f32; LANES],
    /// Their boxes.
    low: [[f32; LANES]; 3],
    high: [[f32; LANES]; 3],
    /// How close something on its outside must come to each edge to be looked at.
    pub within: [f32; LANES],
    pub first: u32,
}

impl MovedRidges {
    pub(super) const EMPTY: Self = Self {
        start: [[0.0; LANES]; 3],
        along: [[0.0; LANES]; 3],
        across: [[0.0; LANES]; 3],
        cos: [1.0; LANES],
        length: [0.0; LANES],
        low: [[0.0; LANES]; 3],
        high: [[0.0; LANES]; 3],
        within: [0.0; LANES],
        first: 0,
    };

    /// Takes a block after a rotation; its origin is then at `origin`.
    #[inline(always)]
    pub(super) fn set<S: Simd>(
        &mut self,
        simd: S,
        block: &RidgeBlock,
        rotation: &[[f32; 3]; 3],
        origin: [f32; 3],
    ) -> Segments<S> {
        let (start, along) = (lanes_of(simd, &block.start), lanes_of(simd, &block.along));
        let (across, length) = (lanes_of(simd, &block.across), lanes(simd, &block.length));
        let mut ends = [[length; 3]; 2];
        for row in 0..3 {
            let turn = splat(simd, rotation[row]);
            let (from, to) = (dot(turn, start) + origin[row], dot(turn, along));
            self.start[row] = from.to_array();
            self.along[row] = to.to_array();
            self.across[row] = dot(turn, across).to_array();
            ends[0][row] = from;
            ends[1][row] = from + to * length;
        }
        (self.cos, self.length, self.first) = (block.cos, block.length, block.first);
        let segments = Segments::new(ends[0], ends[1]);
        for k in 0..3 {
            self.low[k] = segments.low[k].to_array();
            self.high[k] = segments.high[k].to_array();
        }
        segments
    }

    /// The normal cones.
    #[inline(always)]
    pub(super) fn cones<S: Simd>(&self, simd: S) -> Cones<S> {
        let (across, along) = (lanes_of(simd, &self.across), lanes_of(simd, &self.along));
        let cos = lanes(simd, &self.cos);
        Cones { axes: cross(across, along), cos, sin: (-(cos * cos) + 1.0).max(0.0).sqrt() }
    }

    /// Which edges may be close enough to the box of another block, on their outside and otherwise.
    #[inline(always)]
    pub(super) fn close_to<S: Simd>(&self, simd: S, block: &RidgeBlock, margins: &Margins) -> [u32; 2] {
        let mut apart = Lanes::splat(simd, f32::NEG_INFINITY);
        for k in 0..3 {
            let (low, high) = (lanes(simd, &self.low[k]), lanes(simd, &self.high[k]));
            let (over, under) = (Lanes::splat(simd, block.low[k]) - high, low - block.high[k]);
            apart = apart.max(over.max(under));
        }
        let apart = apart - margins.distance;
        [bits(apart.simd_le(lanes(simd, &self.within))), bits(apart.simd_le(margins.within))]
    }
}

/// Normal cones.
#[derive(Clone, Copy)]
pub(super) struct Cones<S: Simd> {
    axes: [Lanes<S>; 3],
    cos: Lanes<S>,
    sin: Lanes<S>,
}

impl<S: Simd> Cones<S> {
    /// [`Cone::faces`] for each of them.
    #[inline(always)]
    pub(super) fn face(&self, cone: &Cone) -> u32 {
        let aligned = dot(splat(self.cos.simd, cone.axis), self.axes);
        let least = self.sin * cone.sin - self.cos * cone.cos + Cone::SLACK;
        bits((self.cos + cone.cos).simd_le(0.0) | aligned.simd_le(least))
    }
}

/// How uncertain the numbers in [`meeting`] are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Margins {
    /// Of a coordinate, metres.
    place: f32,
    /// Of a distance that counts, metres.
    distance: f32,
    /// The greatest distance that counts, metres.
    within: f32,
}

impl Margins {
    /// `far` is no less than any coordinate.
    pub(super) fn new(far: f32, within: f32) -> Self {
        Self { place: ERROR * far, distance: ERROR * (far + within), within }
    }
}

/// Bit `i` is set when edge `i` of the block may touch the edge in a lane of `own`: surfaces with these normal cones can touch along the common
/// perpendicular, that meets both edges between their ends, and it is short enough. `overlap`: whether they may have passed each other.
#[inline(always)]
pub(super) fn meeting<S: Simd>(
    simd: S,
    own: &MovedRidges,
    lane: usize,
    overlap: bool,
    block: &RidgeBlock,
    margins: &Margins,
) -> u32 {
    let (p, d) = (pick(simd, &own.start, lane), pick(simd, &own.along, lane));
    let (start, e) = (lanes_of(simd, &block.start), lanes_of(simd, &block.along));
    let r = [p[0] - start[0], p[1] - start[1], p[2] - start[2]];
    let w = cross(d, e);
    let (whole, offset) = (dot(w, w), dot(r, w));
    // The sine of the angle between the edges; distances times that are compared.
    let (sine, distance) = (whole.sqrt(), offset.abs());
    let close = distance.simd_le(sine * margins.within + margins.distance);
    // The common perpendicular, one way or the other, must lie in the cone of the one edge and its reverse in the cone of the other.
    let (a, b) = (dot(e, pick(simd, &own.across, lane)), dot(d, lanes_of(simd, &block.across)));
    let (a_least, b_least) = (sine * own.cos[lane], sine * lanes(simd, &block.cos));
    let along = (a - a_least).min(b - b_least).simd_ge(-ERROR);
    let against = (a + a_least).max(b + b_least).simd_le(ERROR);
    // Edges whose lines may meet have no direction between them.
    let touching = distance.simd_le(margins.place);
    let mask = close & (along | against | touching);
    if !mask.any_true() {
        return 0;
    }
    let beyond = offset.simd_gt(0.0);
    let outside = (beyond & along) | (!beyond & against);
    let mut near = outside & distance.simd_le(sine * own.within[lane] + margins.distance);
    if overlap {
        near |= close & ((beyond & against) | (!beyond & along));
    }
    // Where along each edge, times `whole`.
    let (cos, c, f) = (dot(d, e), dot(d, r), dot(e, r));
    let (s, t) = (cos * f - c, f - cos * c);
    let error = 2.0 * margins.place;
    let (s_end, t_end) = (whole * own.length[lane], whole * lanes(simd, &block.length));
    let between = s.simd_gt(-error) & s.simd_lt(s_end + error) & t.simd_gt(-error) & t.simd_lt(t_end + error);
    bits(mask & (near | touching) & between)
}

/// A vector from a lane, to calculate with in all of them.
#[inline(always)]
fn pick<S: Simd>(simd: S, values: &[[f32; LANES]; 3], lane: usize) -> [Lanes<S>; 3] {
    splat(simd, [values[0][lane], values[1][lane], values[2][lane]])
}

#[inline(always)]
fn cross<S: Simd>(a: [Lanes<S>; 3], b: [Lanes<S>; 3]) -> [Lanes<S>; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
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
            let mut block = RidgeBlock::EMPTY;
            for lane in 0..edges {
                let x = 3.0 + (edges - lane) as f64;
                block.set(lane, [[x, 0.0, 0.0], [x, 1.0, 0.0]], [1.0, 0.0, 0.0], 1.0);
            }
            let turn = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let mut moved = MovedRidges::EMPTY;
            let least = dispatch!(Level::new(), simd => {
                block.finish(simd, edges, 1e30);
                moved.set(simd, &block, &turn, [0.0; 3]).apart(&surface.leaves[0]).reduce_min()
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
        let (mut touching, mut refused, mut told) = (0, 0, 0);
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
            let mut blocks = [RidgeBlock::EMPTY, RidgeBlock::EMPTY];
            blocks[0].set(0, [start, add(start, d)], to32(outward), Cone::wide_cos(0.999));
            blocks[1].set(0, [other, add(other, e)], to32(scale(outward, -1.0)), Cone::wide_cos(0.999));
            let far = (norm(start) + norm(d) + norm(other) + norm(e)) as f32;
            let margins = Margins::new(far, within);
            let [hit, outside] = dispatch!(Level::new(), simd => {
                blocks[0].finish(simd, 1, 1e30);
                blocks[1].finish(simd, 1, f32::NAN);
                let mut own = MovedRidges::EMPTY;
                own.set(simd, &blocks[0], &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.0; 3]);
                own.within = [within; LANES];
                let [near, overlapping] = own.close_to(simd, &blocks[1], &margins);
                let close = near & overlapping & own.cones(simd).face(&Cone::wide(to32(scale(outward, -1.0)), 0.999));
                [true, false].map(|overlap| close & meeting(simd, &own, 0, overlap, &blocks[1], &margins))
            });
            let between = s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0;
            if between && gap.abs() < f64::from(within) && norm(u) > 0.5 {
                touching += 1;
                assert_eq!(hit, 1, "{round}: {s} {t} {gap}");
                let passed = (gap > 0.0) == (round % 3 == 0);
                assert!(passed || outside == 1, "{round}: {s} {t} {gap}");
                // Passed edges count only where the leaves overlap, unless they are too close to tell.
                told += u32::from(passed && outside == 0);
            } else if hit == 0 {
                refused += 1;
            }
        }
        assert!(touching > 20_000 && refused > 20_000 && told > 5_000, "{touching} {refused} {told}");
    }
}
