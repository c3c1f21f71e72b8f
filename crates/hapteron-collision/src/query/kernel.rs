//! The inner loops, eight lanes at a time. Branch-free, so that the compiler turns them into vector instructions; every
//! lane is the same IEEE arithmetic on any machine.

use crate::surface::{LANES, Node, Surface, TriangleBlock};
use crate::vector::Rigid;

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
pub(crate) fn point_triangles(p: [f32; 3], b: &TriangleBlock) -> [f32; LANES] {
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
pub(crate) fn least(values: &[f32; LANES]) -> f32 {
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
pub(crate) fn at_most(values: &[f32; LANES], limit: f32) -> u32 {
    let mut hit = [0u32; LANES];
    for l in 0..LANES {
        hit[l] = u32::from(values[l] <= limit) << l;
    }
    hit.iter().fold(0, |mask, h| mask | h)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::mesh::TriMesh;
    use crate::query::feature;

    /// Would catch a distance in single precision that is farther off than the block says, thin and tiny triangles included: then
    /// the closest triangle could be missed.
    #[test]
    fn distances_to_a_block_are_as_certain_as_it_says() {
        let mut seed = 7u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let mut inside = 0;
        for round in 0..4000 {
            // From equilateral to a millionth as high as wide, far from the origin, up to a metre in size.
            let (thin, size) = (0.1f64.powi(round % 7), 0.1f64.powi(round / 7 % 5));
            let a = [0; 3].map(|_| 5.0 * number());
            let side = [0; 3].map(|_| size * number());
            let b = crate::vector::add(a, side);
            let along = number();
            let c = [0, 1, 2].map(|k| a[k] + along * side[k] + thin * size * number());
            let Ok(mesh) = TriMesh::new(vec![a, b, c], vec![[0, 1, 2]]) else { continue };
            let surface = Surface::build(&mesh);
            let (leaf, block) = (&surface.leaves[0], &surface.blocks[0]);
            for _ in 0..20 {
                let p = a.map(|x| x + 1.5 * size * number());
                let local = [0, 1, 2].map(|k| (p[k] - f64::from(block.origin[k])) as f32);
                let found = f64::from(least(&point_triangles(local, block)).sqrt());
                let exact = feature::foot(p, leaf.triangle(0), &surface).signed_distance.abs();
                let error = f64::from(block.error) + f64::from(crate::surface::ERROR) * exact;
                assert!((found - exact).abs() <= error, "{found} {exact} {error} {thin} {size}");
                inside += 1;
            }
        }
        assert!(inside > 50_000, "{inside}");
    }
}
