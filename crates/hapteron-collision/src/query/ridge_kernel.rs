//! The inner loops over edges, eight at a time; like those of the kernel, but in single precision throughout: what they
//! let through is looked at again exactly, and what they refuse is certain.

use super::kernel::{bits, lanes, lanes_of};
use crate::surface::{Cone, LANES, Leaf};
use fearless_simd::{Simd, f32x8, mask32x8, prelude::*};

/// Bound of the accumulated rounding relative to the magnitudes of the factors: some 20 operations of half a unit in the last
/// place each, and the rounding of what they start from.
const ERROR: f32 = 3e-6;

/// Up to eight edges of a leaf of the body, in the obstacle's frame.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct SegmentBlock {
    ends: [[[f32; LANES]; 3]; 2],
    within: [f32; LANES],
    /// Normal cones.
    normal: [[f32; LANES]; 3],
    cos: [f32; LANES],
    sin: [f32; LANES],
}

impl SegmentBlock {
    /// Lanes that are near nothing: so far away that they never are the closest, but not so far that a height is not a number.
    pub(super) const EMPTY: Self = Self {
        ends: [[[1e30; LANES]; 3]; 2],
        within: [0.0; LANES],
        normal: [[0.0; LANES]; 3],
        cos: [-1.0; LANES],
        sin: [0.0; LANES],
    };

    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, ends: [[f32; 3]; 2], within: f32) {
        for axis in 0..3 {
            self.ends[0][axis][lane] = ends[0][axis];
            self.ends[1][axis][lane] = ends[1][axis];
        }
        self.within[lane] = within;
    }

    #[inline(always)]
    pub(super) fn set_cone(&mut self, lane: usize, cone: &Cone) {
        for axis in 0..3 {
            self.normal[axis][lane] = cone.axis[axis];
        }
        (self.cos[lane], self.sin[lane]) = (cone.cos, cone.sin);
    }

    /// Which edges may touch something with a normal in this cone.
    #[inline(always)]
    pub(super) fn facing<S: Simd>(&self, simd: S, cone: &Cone) -> u32 {
        let axis = cone.axis.map(|c| f32x8::splat(simd, c));
        bits(facing([&self.cos, &self.sin], &self.normal, cone, axis))
    }

    /// Two masks: of the edges that may be as close to a leaf as they need to be, and of those that may meet its bounds; and a
    /// lower bound of the distance of any of them.
    #[inline(always)]
    pub(super) fn near<S: Simd>(&self, simd: S, leaf: &Leaf, slack: f32) -> (u32, u32, f32) {
        let mut apart = f32x8::splat(simd, -slack);
        let mut heights = [f32x8::splat(simd, 0.0); 2];
        for k in 0..3 {
            let (a, b) = (lanes(simd, &self.ends[0][k]), lanes(simd, &self.ends[1][k]));
            let (low, high) = (a.min(b), a.max(b));
            let under = f32x8::splat(simd, leaf.min[k]) - high - slack;
            let over = low - leaf.max[k] - slack;
            apart = apart.max(under).max(over);
            let normal = f32x8::splat(simd, leaf.normal[k]);
            heights[0] += normal * a;
            heights[1] += normal * b;
        }
        let (low, high) = (heights[0].min(heights[1]), heights[0].max(heights[1]));
        let under = f32x8::splat(simd, leaf.low) - high - slack;
        let over = low - leaf.high - slack;
        let apart = apart.max(under).max(over);
        let within = lanes(simd, &self.within);
        let meeting = bits(apart.simd_le(0.0) & within.simd_gt(0.0));
        let near = bits(apart.simd_lt(within));
        (near | meeting, meeting, apart.reduce_min())
    }
}

/// Eight edges of a leaf of the obstacle about an origin nearby, as a start and a vector to the end, by axis and lane, with
/// their normal cones and the distance within which each is of interest.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct RidgeBlock {
    start: [[f32; LANES]; 3],
    along: [[f32; LANES]; 3],
    length: [f32; LANES],
    normal: [[f32; LANES]; 3],
    cos: [f32; LANES],
    sin: [f32; LANES],
    within: [f32; LANES],
    pub edge: [u32; LANES],
    pub origin: [f32; 3],
    /// Greatest distance of a point on the edges from the origin.
    radius: f32,
}

impl RidgeBlock {
    /// Lanes that meet nothing.
    pub(super) const fn empty(origin: [f32; 3]) -> Self {
        Self {
            start: [[0.0; LANES]; 3],
            along: [[0.0; LANES]; 3],
            length: [0.0; LANES],
            normal: [[0.0; LANES]; 3],
            cos: [1.0; LANES],
            sin: [0.0; LANES],
            within: [0.0; LANES],
            edge: [u32::MAX; LANES],
            origin,
            radius: 0.0,
        }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, edge: u32, ends: [[f32; 3]; 2], cone: Cone, within: f32) {
        let [a, b] = ends;
        let along = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        for axis in 0..3 {
            self.start[axis][lane] = a[axis];
            self.along[axis][lane] = along[axis];
            self.normal[axis][lane] = cone.axis[axis];
        }
        (self.cos[lane], self.sin[lane]) = (cone.cos, cone.sin);
        self.length[lane] = length(along);
        self.within[lane] = within;
        self.edge[lane] = edge;
        self.radius = self.radius.max(length(a) + self.length[lane]);
    }

    /// Bit `i` is set when edge `i` may touch the edge from `p` (about the origin) along `d`: surfaces with these normal cones can
    /// touch, the common perpendicular meets both between their ends, and it is short enough, or, on the inner side (against
    /// the cone's axis), shorter than `crossing`.
    #[inline(always)]
    pub(super) fn meeting<S: Simd>(
        &self,
        simd: S,
        p: [f32; 3],
        d: [f32; 3],
        cone: &Cone,
        within: f32,
        crossing: f32,
    ) -> u32 {
        let splat = |v: [f32; 3]| v.map(|c| f32x8::splat(simd, c));
        let (n, size) = (splat(cone.axis), length(d));
        let far = f32x8::splat(simd, length(p) + size + self.radius);
        let (p, d, size) = (splat(p), splat(d), f32x8::splat(simd, size));
        let (e, lengths) = (lanes_of(simd, &self.along), lanes(simd, &self.length));
        let start = lanes_of(simd, &self.start);
        let r = [p[0] - start[0], p[1] - start[1], p[2] - start[2]];
        let w = [d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]];
        let whole = dot(w, w);
        let area = size * lengths;
        // Distance times the root of `whole`, and what is positive on the inner side.
        let h = dot(r, w);
        let h_error = area * far * ERROR;
        let inward = h * dot(n, w);
        let (crossing, own) = (f32x8::splat(simd, crossing), lanes(simd, &self.within));
        let limit = own.min(within);
        let passed = inward.simd_gt(h_error * area * -4.0) & crossing.simd_gt(limit);
        let limit = passed.select(crossing, limit);
        let least = (h.abs() - h_error).max(0.0);
        let whole = whole + area * area * ERROR;
        let short = (least * least).simd_le(limit * limit * whole * (1.0 + 1e-5));
        let facing = facing([&self.cos, &self.sin], &self.normal, cone, n);
        let mask = bits(facing & short & limit.simd_gt(0.0));
        if mask == 0 {
            return 0;
        }
        let ee = lengths * lengths;
        let (b, c, f) = (dot(d, e), dot(d, r), dot(e, r));
        // Where along each edge, times `whole`.
        let (s, t) = (b * f - c * ee, dot(d, d) * f - b * c);
        let area = size * lengths * far * ERROR;
        let (s_error, t_error) = (area * lengths, area * size);
        let between = s.simd_gt(-s_error)
            & s.simd_lt(whole + s_error)
            & t.simd_gt(-t_error)
            & t.simd_lt(whole + t_error);
        bits(between) & mask
    }
}

/// [`Cone::faces`] for eight cones, given by cosines and sines and axes; `n` is the axis of the single one.
#[inline(always)]
fn facing<S: Simd>(
    [cos, sin]: [&[f32; LANES]; 2],
    axes: &[[f32; LANES]; 3],
    cone: &Cone,
    n: [f32x8<S>; 3],
) -> mask32x8<S> {
    let simd = n[0].simd;
    let aligned = dot(n, lanes_of(simd, axes));
    let (cos, sin) = (lanes(simd, cos), lanes(simd, sin));
    (cos + cone.cos).simd_le(0.0) | aligned.simd_le(sin * cone.sin - cos * cone.cos + Cone::SLACK)
}

#[inline(always)]
fn dot<S: Simd>(a: [f32x8<S>; 3], b: [f32x8<S>; 3]) -> f32x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn length(v: [f32; 3]) -> f32 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::mesh::TriMesh;
    use crate::surface::Surface;
    use crate::vector::{Vec3, add, dot, norm, scale, sub};
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
                block.set(lane, [[x, 0.0, 0.0], [x, 1.0, 0.0]], 0.5);
            }
            let near = dispatch!(Level::new(), simd => block.near(simd, &surface.leaves[0], 0.0));
            assert_eq!(near, (0, 0, 3.0), "{edges}");
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
            let (within, crossing) = (0.01, if round % 2 == 0 { 0.015 } else { 0.0 });
            let outward = scale(u, if round % 3 == 0 { 1.0 } else { -1.0 });
            let mut block = RidgeBlock::empty([0.0; 3]);
            let opposite = Cone::wide(to32(scale(outward, -1.0)), 0.999);
            block.set(0, 0, [to32(other), to32(add(other, e))], opposite, within);
            let cone = Cone::wide(to32(outward), 0.999);
            let hit = dispatch!(Level::new(), simd => block.meeting(simd, to32(start), to32(d), &cone, within, crossing));
            let between = s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0;
            // From the first edge to the second it is against the normal when they have passed.
            let limit = if dot(sub(q, p), outward) < 0.0 { crossing } else { within };
            if between && gap.abs() < f64::from(limit) && norm(u) > 0.5 {
                touching += 1;
                assert_eq!(hit, 1, "{round}: {s} {t} {gap}");
            } else if hit == 0 {
                refused += 1;
            }
        }
        assert!(touching > 20_000 && refused > 20_000, "{touching} {refused}");
    }
}
