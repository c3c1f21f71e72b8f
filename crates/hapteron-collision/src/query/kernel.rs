//! The inner loops, eight lanes at a time. Branch-free, so that the compiler turns them into vector instructions; every
//! lane is the same IEEE arithmetic on any machine.

use crate::surface::{Cone, LANES, Node, Surface, TriangleBlock};
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

    /// Lower bounds of the squared distances of a point to the leaves.
    #[inline(always)]
    pub(super) fn lower(&self, p: [f32; 3], slack: f32) -> [f32; LANES] {
        let mut squared = [0.0; LANES];
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
        }
        squared
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

/// The box around a block after a rigid motion, grown by `margin`.
#[inline(always)]
pub(super) fn moved_block_box(block: &TriangleBlock, motion: &Rigid, margin: f32) -> Box32 {
    let origin = motion.point(block.origin.map(f64::from));
    let mut result = Box32 { min: [0.0; 3], max: [0.0; 3] };
    for row in 0..3 {
        let r = motion.rotation[row].map(|c| c as f32);
        let (mut low, mut high) = ([0.0f32; LANES], [0.0f32; LANES]);
        for l in 0..LANES {
            let turned = |v: &[[f32; LANES]; 3]| r[0] * v[0][l] + r[1] * v[1][l] + r[2] * v[2][l];
            let (along, across) = (turned(&block.along), turned(&block.across));
            let a = turned(&block.corner);
            let b = a + along * block.length[0][l];
            let (x, y) = (block.third[0][l] * block.length[2][l], block.third[1][l] * block.length[2][l]);
            let c = a + along * x + across * y;
            let (least, most) = if a < b { (a, b) } else { (b, a) };
            low[l] = if c < least { c } else { least };
            high[l] = if c > most { c } else { most };
        }
        let origin = origin[row] as f32;
        result.min[row] = origin + least(&low) - margin;
        result.max[row] = origin - least(&high.map(|h| -h)) + margin;
    }
    result
}

/// Squared distances of a point (from the block's origin) to the triangles of a block.
#[inline(always)]
pub(super) fn point_triangles(p: [f32; 3], b: &TriangleBlock) -> [f32; LANES] {
    let mut squared = [0.0; LANES];
    for l in 0..LANES {
        let q = [p[0] - b.corner[0][l], p[1] - b.corner[1][l], p[2] - b.corner[2][l]];
        let x = b.along[0][l] * q[0] + b.along[1][l] * q[1] + b.along[2][l] * q[2];
        let y = b.across[0][l] * q[0] + b.across[1][l] * q[1] + b.across[2][l] * q[2];
        let z = b.normal[0][l] * q[0] + b.normal[1][l] * q[1] + b.normal[2][l] * q[2];
        let beyond = x - b.length[0][l];
        let (u, v) = ([b.second[0][l], b.second[1][l]], [b.third[0][l], b.third[1][l]]);
        let (along2, across2) = (u[0] * beyond + u[1] * y, u[1] * beyond - u[0] * y);
        let (along3, across3) = (v[0] * x + v[1] * y, v[0] * y - v[1] * x);
        let side1 = beside(x, b.length[0][l], y);
        let side2 = beside(along2, b.length[1][l], across2);
        let side3 = beside(along3, b.length[2][l], across3);
        let sides = if side1 < side2 { side1 } else { side2 };
        let sides = if sides < side3 { sides } else { side3 };
        let over = (y >= 0.0) & (across2 <= 0.0) & (across3 <= 0.0);
        squared[l] = z * z + if over { 0.0 } else { sides };
    }
    squared
}

/// Squared distance in the plane to a side, from the coordinates along and across it.
#[inline(always)]
fn beside(along: f32, length: f32, across: f32) -> f32 {
    let (under, over) = (-along, along - length);
    let beyond = if under > over { under } else { over };
    let beyond = if beyond > 0.0 { beyond } else { 0.0 };
    beyond * beyond + across * across
}

/// The least of eight.
#[inline(always)]
pub(super) fn least(values: &[f32; LANES]) -> f32 {
    let lesser = |a: f32, b: f32| if a < b { a } else { b };
    let mut half = [0.0; 4];
    for l in 0..4 {
        half[l] = lesser(values[l], values[l + 4]);
    }
    lesser(lesser(half[0], half[2]), lesser(half[1], half[3]))
}

/// Bit `i` is set when value `i` is below `limit`.
#[inline(always)]
pub(super) fn below(values: &[f32; LANES], limit: f32) -> u32 {
    let mut hit = [0u32; LANES];
    for l in 0..LANES {
        hit[l] = u32::from(values[l] < limit) << l;
    }
    hit.iter().fold(0, |mask, h| mask | h)
}

/// Bit `i` is set when value `i` is at most `limit`.
#[inline(always)]
pub(super) fn at_most(values: &[f32; LANES], limit: f32) -> u32 {
    let mut hit = [0u32; LANES];
    for l in 0..LANES {
        hit[l] = u32::from(values[l] <= limit) << l;
    }
    hit.iter().fold(0, |mask, h| mask | h)
}

/// Eight edges as a start and a vector to the end, by axis and lane, with the distance within which each is of interest.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct RidgeBlock {
    pub start: [[f64; LANES]; 3],
    pub along: [[f64; LANES]; 3],
    pub within_squared: [f64; LANES],
    /// Normal cones of the edges.
    pub normal: [[f32; LANES]; 3],
    pub cos: [f32; LANES],
    pub sin: [f32; LANES],
    pub edge: [u32; LANES],
}

impl RidgeBlock {
    /// Lanes that meet nothing.
    pub(super) const EMPTY: Self = Self {
        start: [[0.0; LANES]; 3],
        along: [[0.0; LANES]; 3],
        within_squared: [0.0; LANES],
        normal: [[0.0; LANES]; 3],
        cos: [1.0; LANES],
        sin: [0.0; LANES],
        edge: [u32::MAX; LANES],
    };

    /// Bit `i` is set when a surface with edge `i` and one with an edge of this normal cone can touch there.
    #[inline(always)]
    pub(super) fn facing(&self, cone: &Cone) -> u32 {
        let mut hit = [0u32; LANES];
        for l in 0..LANES {
            let aligned = cone.axis[0] * self.normal[0][l]
                + cone.axis[1] * self.normal[1][l]
                + cone.axis[2] * self.normal[2][l];
            hit[l] = u32::from(cone.faces(self.cos[l], self.sin[l], aligned)) << l;
        }
        hit.iter().fold(0, |mask, h| mask | h)
    }
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
