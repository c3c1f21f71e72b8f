//! The inner loops over edges, eight at a time; like those of the kernel, but in single precision throughout: what they
//! let through is looked at again exactly, and what they refuse is certain.

use crate::surface::{Cone, LANES, Leaf};

/// Bound of the accumulated rounding relative to the magnitudes of the factors: some 20 operations of half a unit in the last
/// place each, and the rounding of what they start from.
const ERROR: f32 = 3e-6;

/// Up to eight edges of a leaf of the body, in the obstacle's frame.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct SegmentBlock {
    ends: [[[f32; LANES]; 3]; 2],
    within: [f32; LANES],
}

impl SegmentBlock {
    /// Lanes that are near nothing.
    pub(super) const EMPTY: Self = Self { ends: [[[f32::INFINITY; LANES]; 3]; 2], within: [0.0; LANES] };

    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, ends: [[f32; 3]; 2], within: f32) {
        for axis in 0..3 {
            self.ends[0][axis][lane] = ends[0][axis];
            self.ends[1][axis][lane] = ends[1][axis];
        }
        self.within[lane] = within;
    }

    /// Two masks: of the edges that may be as close to a leaf as they need to be, and of those that may meet its bounds.
    #[inline(always)]
    pub(super) fn near(&self, leaf: &Leaf, slack: f32) -> (u32, u32) {
        let mut near = [0u32; LANES];
        let mut meeting = [0u32; LANES];
        for l in 0..LANES {
            let mut apart = -slack;
            let mut heights = [0.0; 2];
            for k in 0..3 {
                let (a, b) = (self.ends[0][k][l], self.ends[1][k][l]);
                let (low, high) = if a < b { (a, b) } else { (b, a) };
                let (under, over) = (leaf.min[k] - high - slack, low - leaf.max[k] - slack);
                apart = if under > apart { under } else { apart };
                apart = if over > apart { over } else { apart };
                heights[0] += leaf.normal[k] * a;
                heights[1] += leaf.normal[k] * b;
            }
            let (low, high) =
                if heights[0] < heights[1] { (heights[0], heights[1]) } else { (heights[1], heights[0]) };
            let (under, over) = (leaf.low - high - slack, low - leaf.high - slack);
            apart = if under > apart { under } else { apart };
            apart = if over > apart { over } else { apart };
            meeting[l] = u32::from((apart <= 0.0) & (self.within[l] > 0.0)) << l;
            near[l] = u32::from(apart < self.within[l]) << l;
        }
        let near = near.iter().fold(0, |mask, h| mask | h);
        let meeting = meeting.iter().fold(0, |mask, h| mask | h);
        (near | meeting, meeting)
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
    pub(super) fn meeting(&self, p: [f32; 3], d: [f32; 3], cone: &Cone, within: f32, crossing: f32) -> u32 {
        let n = cone.axis;
        let (dd, size) = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2], length(d));
        let far = length(p) + size + self.radius;
        let mut wholes = [0.0; LANES];
        let mut hit = [0u32; LANES];
        for l in 0..LANES {
            let aligned = n[0] * self.normal[0][l] + n[1] * self.normal[1][l] + n[2] * self.normal[2][l];
            let facing = cone.faces(self.cos[l], self.sin[l], aligned);
            let e = [self.along[0][l], self.along[1][l], self.along[2][l]];
            let r = [p[0] - self.start[0][l], p[1] - self.start[1][l], p[2] - self.start[2][l]];
            let w = [d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]];
            let whole = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
            let area = size * self.length[l];
            // Distance times the root of `whole`, and what is positive on the inner side.
            let h = r[0] * w[0] + r[1] * w[1] + r[2] * w[2];
            let h_error = ERROR * area * far;
            let inward = h * (n[0] * w[0] + n[1] * w[1] + n[2] * w[2]);
            let limit = if within < self.within[l] { within } else { self.within[l] };
            let passed = inward > -4.0 * h_error * area;
            let limit = if passed & (crossing > limit) { crossing } else { limit };
            let least = h.abs() - h_error;
            let least = if least > 0.0 { least } else { 0.0 };
            wholes[l] = whole + ERROR * area * area;
            let short = least * least <= limit * limit * wholes[l] * (1.0 + 1e-5);
            hit[l] = u32::from(facing & short & (limit > 0.0)) << l;
        }
        let mask = hit.iter().fold(0, |mask, h| mask | h);
        if mask == 0 {
            return 0;
        }
        for l in 0..LANES {
            let e = [self.along[0][l], self.along[1][l], self.along[2][l]];
            let r = [p[0] - self.start[0][l], p[1] - self.start[1][l], p[2] - self.start[2][l]];
            let ee = self.length[l] * self.length[l];
            let b = d[0] * e[0] + d[1] * e[1] + d[2] * e[2];
            let c = d[0] * r[0] + d[1] * r[1] + d[2] * r[2];
            let f = e[0] * r[0] + e[1] * r[1] + e[2] * r[2];
            // Where along each edge, times `whole`.
            let (s, t) = (b * f - c * ee, dd * f - b * c);
            let area = ERROR * size * self.length[l] * far;
            let (s_error, t_error) = (area * self.length[l], area * size);
            let between =
                (s > -s_error) & (s < wholes[l] + s_error) & (t > -t_error) & (t < wholes[l] + t_error);
            hit[l] = u32::from(between) << l;
        }
        hit.iter().fold(0, |mask, h| mask | h) & mask
    }
}

#[inline(always)]
fn length(v: [f32; 3]) -> f32 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
