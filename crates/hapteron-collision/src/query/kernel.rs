//! The inner loops, eight lanes at a time. Branch-free, so that the compiler turns them into vector instructions; every
//! lane is the same IEEE arithmetic on any machine.

use crate::surface::{LANES, Node, Surface, TriangleBlock};
use crate::vector::{Rigid, Vec3};

/// An axis-aligned box in single precision, rounded outward.
#[derive(Clone, Copy, Debug)]
pub(super) struct Box32 {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl Box32 {
    #[inline(always)]
    pub(super) fn overlaps(&self, min: &[f32; 3], max: &[f32; 3]) -> bool {
        let mut apart = false;
        for k in 0..3 {
            apart |= (self.min[k] > max[k]) | (self.max[k] < min[k]);
        }
        !apart
    }

    /// Length of the diagonal, squared.
    #[inline(always)]
    pub(super) fn extent(&self) -> f32 {
        (0..3).map(|k| (self.max[k] - self.min[k]) * (self.max[k] - self.min[k])).sum()
    }
}

/// Boxes and slabs of up to eight leaves, by lane.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct LeafBounds {
    min: [[f32; LANES]; 3],
    max: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    low: [f32; LANES],
    high: [f32; LANES],
}

impl LeafBounds {
    /// Those of the given leaves; lanes that they do not fill are infinitely far from everything.
    #[inline(always)]
    pub(super) fn gather(surface: &Surface, leaves: &[u32]) -> Self {
        let mut result = Self {
            min: [[f32::INFINITY; LANES]; 3],
            max: [[f32::NEG_INFINITY; LANES]; 3],
            normal: [[0.0; LANES]; 3],
            low: [f32::NEG_INFINITY; LANES],
            high: [f32::INFINITY; LANES],
        };
        for (lane, &leaf) in leaves.iter().enumerate().take(LANES) {
            let leaf = &surface.leaves[leaf as usize];
            for axis in 0..3 {
                result.min[axis][lane] = leaf.min[axis];
                result.max[axis][lane] = leaf.max[axis];
                result.normal[axis][lane] = leaf.normal[axis];
            }
            result.low[lane] = leaf.low;
            result.high[lane] = leaf.high;
        }
        result
    }

    /// Lower bounds of the squared distances of a point to the leaves, and a mask of those below `limit`.
    #[inline(always)]
    pub(super) fn lower(&self, p: [f32; 3], slack: f32, limit: f32) -> ([f32; LANES], u32) {
        let mut squared = [0.0; LANES];
        let mut below = [0u32; LANES];
        for l in 0..LANES {
            let mut sum = 0.0;
            let mut height = 0.0;
            for k in 0..3 {
                let (under, over) = (self.min[k][l] - p[k], p[k] - self.max[k][l]);
                let beyond = (if under > over { under } else { over }) - slack;
                let beyond = if beyond > 0.0 { beyond } else { 0.0 };
                sum += beyond * beyond;
                height += self.normal[k][l] * p[k];
            }
            let (under, over) = (self.low[l] - height, height - self.high[l]);
            let beyond = (if under > over { under } else { over }) - slack;
            let beyond = if beyond > 0.0 { beyond } else { 0.0 };
            let slab = beyond * beyond;
            squared[l] = if slab > sum { slab } else { sum };
            below[l] = u32::from(squared[l] < limit) << l;
        }
        (squared, below.iter().fold(0, |mask, b| mask | b))
    }
}

impl LeafBounds {
    /// Lower bounds of the distances of a segment, with its box, to the leaves.
    #[inline(always)]
    pub(super) fn segment_lower(&self, b: &Box32, ends: [[f32; 3]; 2], slack: f32) -> [f32; LANES] {
        let mut lower = [0.0; LANES];
        for l in 0..LANES {
            let mut least: f32 = 0.0;
            let mut heights = [0.0; 2];
            for k in 0..3 {
                let (under, over) = (self.min[k][l] - b.max[k], b.min[k] - self.max[k][l]);
                least = if under > least { under } else { least };
                least = if over > least { over } else { least };
                heights[0] += self.normal[k][l] * ends[0][k];
                heights[1] += self.normal[k][l] * ends[1][k];
            }
            let descending = heights[0] > heights[1];
            let lowest = if descending { heights[1] } else { heights[0] };
            let highest = if descending { heights[0] } else { heights[1] };
            let (under, over) = (self.low[l] - highest, lowest - self.high[l]);
            least = if under > least { under } else { least };
            least = if over > least { over } else { least };
            lower[l] = least - slack;
        }
        lower
    }
}

/// Bit `i` is set when child `i` of the node overlaps the box.
#[inline(always)]
pub(super) fn overlapping_children(node: &Node, b: &Box32) -> u32 {
    let mut hit = [0u32; LANES];
    for l in 0..LANES {
        let apart = (node.min[0][l] > b.max[0])
            | (node.max[0][l] < b.min[0])
            | (node.min[1][l] > b.max[1])
            | (node.max[1][l] < b.min[1])
            | (node.min[2][l] > b.max[2])
            | (node.max[2][l] < b.min[2]);
        hit[l] = u32::from(!apart) << l;
    }
    hit.iter().fold(0, |mask, h| mask | h)
}

/// The boxes of a node's children after a rigid motion, each grown by `margin` on all sides.
#[inline(always)]
pub(super) fn moved_children(node: &Node, motion: &Rigid, margin: f32) -> [Box32; LANES] {
    let mut result = [Box32 { min: [0.0; 3], max: [0.0; 3] }; LANES];
    for row in 0..3 {
        let r = motion.rotation[row].map(|c| c as f32);
        let t = motion.translation[row] as f32;
        for (l, moved) in result.iter_mut().enumerate() {
            let mut center = t;
            let mut half = margin;
            for k in 0..3 {
                center += r[k] * (0.5 * (node.min[k][l] + node.max[k][l]));
                half += r[k].abs() * (0.5 * (node.max[k][l] - node.min[k][l]));
            }
            moved.min[row] = center - half;
            moved.max[row] = center + half;
        }
    }
    result
}

/// The block after a rigid motion.
#[inline(always)]
pub(super) fn moved_block(block: &TriangleBlock, motion: &Rigid, to: &mut TriangleBlock) {
    for row in 0..3 {
        let r = motion.rotation[row];
        for l in 0..LANES {
            to.corner[row][l] = r[0] * block.corner[0][l]
                + r[1] * block.corner[1][l]
                + r[2] * block.corner[2][l]
                + motion.translation[row];
            to.edge1[row][l] = r[0] * block.edge1[0][l] + r[1] * block.edge1[1][l] + r[2] * block.edge1[2][l];
            to.edge2[row][l] = r[0] * block.edge2[0][l] + r[1] * block.edge2[1][l] + r[2] * block.edge2[2][l];
        }
    }
}

/// Least squared distance of a point to the triangles of a block, and in which lane (the first of equals).
///
/// The closest point's barycentric coordinates by region (Ericson, Real-Time Collision Detection, 5.1.5), with the choice
/// of region as selections and one division.
#[inline(always)]
pub(super) fn point_triangles(p: Vec3, b: &TriangleBlock) -> (f64, usize) {
    let mut squared = [0.0; LANES];
    for l in 0..LANES {
        let ab = [b.edge1[0][l], b.edge1[1][l], b.edge1[2][l]];
        let ac = [b.edge2[0][l], b.edge2[1][l], b.edge2[2][l]];
        let ap = [p[0] - b.corner[0][l], p[1] - b.corner[1][l], p[2] - b.corner[2][l]];
        let d1 = ab[0] * ap[0] + ab[1] * ap[1] + ab[2] * ap[2];
        let d2 = ac[0] * ap[0] + ac[1] * ap[1] + ac[2] * ap[2];
        let aa = ab[0] * ab[0] + ab[1] * ab[1] + ab[2] * ab[2];
        let bc = ab[0] * ac[0] + ab[1] * ac[1] + ab[2] * ac[2];
        let cc = ac[0] * ac[0] + ac[1] * ac[1] + ac[2] * ac[2];
        let (d3, d4, d5, d6) = (d1 - aa, d2 - bc, d1 - bc, d2 - cc);
        let va = d3 * d6 - d5 * d4;
        let vb = d5 * d2 - d1 * d6;
        let vc = d1 * d4 - d3 * d2;
        let (toward_c, toward_b) = (d4 - d3, d5 - d6);
        // Later selections take precedence: interior, then edges, then corners.
        let (mut v, mut w, mut whole) = (vb, vc, va + vb + vc);
        let on_bc = (va <= 0.0) & (toward_c >= 0.0) & (toward_b >= 0.0);
        v = if on_bc { toward_b } else { v };
        w = if on_bc { toward_c } else { w };
        whole = if on_bc { toward_c + toward_b } else { whole };
        let on_ac = (vb <= 0.0) & (d2 >= 0.0) & (d6 <= 0.0);
        v = if on_ac { 0.0 } else { v };
        w = if on_ac { d2 } else { w };
        whole = if on_ac { cc } else { whole };
        let at_c = (d6 >= 0.0) & (d5 <= d6);
        v = if at_c { 0.0 } else { v };
        w = if at_c { 1.0 } else { w };
        whole = if at_c { 1.0 } else { whole };
        let on_ab = (vc <= 0.0) & (d1 >= 0.0) & (d3 <= 0.0);
        v = if on_ab { d1 } else { v };
        w = if on_ab { 0.0 } else { w };
        whole = if on_ab { aa } else { whole };
        let at_b = (d3 >= 0.0) & (d4 <= d3);
        v = if at_b { 1.0 } else { v };
        w = if at_b { 0.0 } else { w };
        whole = if at_b { 1.0 } else { whole };
        let at_a = ((d1 <= 0.0) & (d2 <= 0.0)) | (whole <= 0.0);
        v = if at_a { 0.0 } else { v };
        w = if at_a { 0.0 } else { w };
        whole = if at_a { 1.0 } else { whole };
        let inverse = 1.0 / whole;
        let (v, w) = (v * inverse, w * inverse);
        let e = [ap[0] - v * ab[0] - w * ac[0], ap[1] - v * ab[1] - w * ac[1], ap[2] - v * ab[2] - w * ac[2]];
        squared[l] = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
    }
    first_least(&squared)
}

#[inline(always)]
pub(super) fn first_least32(values: &[f32; LANES]) -> usize {
    let mut lane = 0;
    for (l, &value) in values.iter().enumerate().skip(1) {
        if value < values[lane] {
            lane = l;
        }
    }
    lane
}

#[inline(always)]
fn first_least(values: &[f64; LANES]) -> (f64, usize) {
    let mut least = values[0];
    let mut lane = 0;
    for (l, &value) in values.iter().enumerate().skip(1) {
        if value < least {
            least = value;
            lane = l;
        }
    }
    (least, lane)
}

/// Eight edges as a start and a vector to the end, by axis and lane, with the distance within which each is of interest.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct RidgeBlock {
    pub start: [[f64; LANES]; 3],
    pub along: [[f64; LANES]; 3],
    pub within_squared: [f64; LANES],
    pub edge: [u32; LANES],
}

impl RidgeBlock {
    /// Lanes that meet nothing.
    pub(super) const EMPTY: Self = Self {
        start: [[0.0; LANES]; 3],
        along: [[0.0; LANES]; 3],
        within_squared: [0.0; LANES],
        edge: [u32::MAX; LANES],
    };
}

/// Bit `i` is set when the middle of the edge from `p` along `d` is close to the middle of edge `i` of the block: the
/// common perpendicular meets both between their ends and is short enough, or, on the inner side (against `outward`),
/// shorter than `crossing_squared`.
#[inline(always)]
pub(super) fn ridge_ridges(
    p: Vec3,
    d: Vec3,
    outward: Vec3,
    within_squared: f64,
    crossing_squared: f64,
    block: &RidgeBlock,
) -> u32 {
    let mut hit = [0u64; LANES];
    let a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    for l in 0..LANES {
        let e = [block.along[0][l], block.along[1][l], block.along[2][l]];
        let r = [p[0] - block.start[0][l], p[1] - block.start[1][l], p[2] - block.start[2][l]];
        let ee = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
        let b = d[0] * e[0] + d[1] * e[1] + d[2] * e[2];
        let c = d[0] * r[0] + d[1] * r[1] + d[2] * r[2];
        let f = e[0] * r[0] + e[1] * r[1] + e[2] * r[2];
        let whole = a * ee - b * b;
        let inverse = 1.0 / whole;
        let s = (b * f - c * ee) * inverse;
        let t = (a * f - b * c) * inverse;
        // From the point on the first edge to that on the block's.
        let u = [e[0] * t - d[0] * s - r[0], e[1] * t - d[1] * s - r[1], e[2] * t - d[2] * s - r[2]];
        let squared = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
        let side = u[0] * outward[0] + u[1] * outward[1] + u[2] * outward[2];
        let limit = within_squared.min(block.within_squared[l]);
        let limit = if side < 0.0 { crossing_squared } else { limit };
        // Comparisons with a NaN (parallel edges) are false.
        let inside = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0) & (squared < limit);
        hit[l] = u64::from(inside) << l;
    }
    hit.iter().fold(0, |mask, h| mask | h) as u32
}
