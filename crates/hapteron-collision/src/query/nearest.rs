//! The exact foot of a point on a surface, however far away it is.

use super::feature::{self, Foot};
use super::kernel;
use crate::surface::{EMPTY, ERROR, LEAF, Surface};
use crate::vector::Vec3;
use fearless_simd::{Simd, prelude::*};

/// Covers the rounding of squares in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;

/// Memory of the search: parts of the tree to be looked at, with a lower bound of their squared distance.
#[derive(Clone, Debug, Default)]
pub(super) struct Nearest {
    stack: Vec<(f32, u32)>,
}

/// The closest triangle so far, with the foot on it.
struct Best {
    within: f32,
    found: Option<(u32, Foot)>,
}

impl Nearest {
    /// The closest triangle (of equals the first) and the foot on it; none when it is farther than `within` metres. `slack` covers the
    /// rounding of single-precision coordinates.
    #[inline(always)]
    pub(super) fn foot<S: Simd>(
        &mut self,
        simd: S,
        surface: &Surface,
        point: Vec3,
        within: f64,
        slack: f32,
    ) -> Option<(u32, Foot)> {
        let point32 = point.map(|c| c as f32);
        let mut best = Best { within: (within as f32).next_up() * ROUNDING + slack, found: None };
        self.stack.clear();
        if !surface.nodes.is_empty() {
            self.stack.push((0.0, 0));
        }
        while let Some((lower, child)) = self.stack.pop() {
            let limit = best.within * best.within * ROUNDING;
            if lower > limit {
                continue;
            }
            if child & LEAF != 0 {
                best.look(simd, surface, point, child & !LEAF);
                continue;
            }
            let node = &surface.nodes[child as usize];
            let squared = kernel::children_squared(simd, node, point32, slack);
            let first = self.stack.len();
            for (lane, &squared) in squared.iter().enumerate() {
                if node.child[lane] != EMPTY && squared <= limit {
                    self.stack.push((squared, node.child[lane]));
                }
            }
            // The closest is looked at first.
            self.stack[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
        }
        best.found
    }
}

impl Best {
    /// Looks at the triangles of a leaf that may be the closest, the likeliest first.
    #[inline(always)]
    fn look<S: Simd>(&mut self, simd: S, surface: &Surface, point: Vec3, leaf: u32) {
        let block = &surface.blocks[leaf as usize];
        let local = [0, 1, 2].map(|k| (point[k] - f64::from(block.origin[k])) as f32);
        let squared = kernel::squared_distances(simd, local, block);
        let own = &surface.leaves[leaf as usize];
        let filled = (1u32 << own.triangles) - 1;
        let likeliest = kernel::bits(squared.simd_le(squared.reduce_min())) & filled;
        let mut looked = 0;
        for of in [likeliest, filled] {
            let reach = self.within * (1.0 + ERROR) + block.error;
            let mut mask = kernel::bits(squared.simd_le(reach * reach * ROUNDING)) & of & !looked;
            looked |= of;
            while mask != 0 {
                let triangle = own.first_triangle + mask.trailing_zeros();
                mask &= mask - 1;
                self.take(triangle, feature::foot(point, triangle, surface));
            }
        }
    }

    #[inline(always)]
    fn take(&mut self, triangle: u32, foot: Foot) {
        let distance = foot.signed_distance.abs();
        let closer = self.found.is_none_or(|(other, held)| {
            let held = held.signed_distance.abs();
            distance < held || (distance == held && triangle < other)
        });
        if closer && distance <= f64::from(self.within) {
            self.within = (distance as f32).next_up();
            self.found = Some((triangle, foot));
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::mesh::TriMesh;
    use fearless_simd::{Level, dispatch};

    /// Would catch a triangle that the search passes over: the foot is that of brute force, near and far, inside and outside.
    #[test]
    fn feet_are_those_of_brute_force() {
        let mut seed = 3u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let vertices: Vec<Vec3> = (0..300).map(|_| [0; 3].map(|_| number())).collect();
        let triangles = (0..100).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let surface = Surface::build(&TriMesh::new(vertices, triangles).unwrap());
        let mut nearest = Nearest::default();
        for round in 0..500 {
            let size = if round % 2 == 0 { 1.0 } else { 10.0 };
            let point = [0; 3].map(|_| size * number());
            let brute = (0..surface.triangle_count() as u32)
                .map(|t| feature::foot(point, t, &surface).signed_distance.abs())
                .enumerate()
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap();
            let mut find =
                |within| dispatch!(Level::new(), simd => nearest.foot(simd, &surface, point, within, 1e-5));
            let (triangle, foot) = find(f64::MAX.sqrt()).unwrap();
            assert_eq!((triangle as usize, foot.signed_distance.abs()), brute, "{point:?}");
            assert!(find(1.0001 * brute.1).is_some());
        }
    }
}
