//! The ridges of the leaves that queries have come across, made ready for eight pairs of edges at once.
//!
//! They do not depend on the pose, so what one query needed serves the next ones. Kept here and not in the surface, most leaves of which no
//! query ever asks for.

use crate::surface::{Cone, LANES, Leaf, Surface};

/// Up to eight edges of a leaf about its origin, as a start and a vector to the end, by axis and lane, with their normal cones.
/// Lanes that have no edge repeat the last one.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct RidgeBlock {
    pub start: [[f32; LANES]; 3],
    pub along: [[f32; LANES]; 3],
    pub normal: [[f32; LANES]; 3],
    pub cos: [f32; LANES],
}

impl RidgeBlock {
    pub(super) const EMPTY: Self = Self {
        start: [[0.0; LANES]; 3],
        along: [[0.0; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        cos: [1.0; LANES],
    };

    /// The edge is given by its ends about the origin.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, [a, b]: [[f32; 3]; 2], cone: &Cone) {
        for axis in 0..3 {
            self.start[axis][lane] = a[axis];
            self.along[axis][lane] = b[axis] - a[axis];
            self.normal[axis][lane] = cone.axis[axis];
        }
        self.cos[lane] = cone.cos;
    }

    /// Copies a lane to another one.
    fn repeat(&mut self, from: usize, to: usize) {
        for row in self.start.iter_mut().chain(&mut self.along).chain(&mut self.normal) {
            row[to] = row[from];
        }
        self.cos[to] = self.cos[from];
    }

    /// One bit for each lane of block number `index` of a leaf that has an edge of its own.
    #[inline(always)]
    pub(super) fn filled(leaf: &Leaf, index: usize) -> u32 {
        (1 << (usize::from(leaf.ridges) - index * LANES).min(LANES)) - 1
    }
}

/// The blocks of one surface's leaves.
#[derive(Clone, Debug, Default)]
pub(super) struct RidgeStore {
    blocks: Vec<RidgeBlock>,
    /// By leaf: where its blocks begin, plus one; zero when nobody has asked for them.
    begin: Vec<u32>,
}

impl RidgeStore {
    /// Forgets everything and makes room for a surface.
    pub(super) fn reset(&mut self, surface: &Surface) {
        self.blocks.clear();
        self.begin.clear();
        self.begin.resize(surface.leaves.len(), 0);
    }

    /// The blocks of a leaf.
    #[inline(always)]
    pub(super) fn of(&mut self, surface: &Surface, index: u32) -> &[RidgeBlock] {
        let leaf = &surface.leaves[index as usize];
        let begin = match self.begin[index as usize] {
            0 => self.gather(surface, index),
            known => known as usize - 1,
        };
        &self.blocks[begin..begin + usize::from(leaf.ridges).div_ceil(LANES)]
    }

    fn gather(&mut self, surface: &Surface, index: u32) -> usize {
        let begin = self.blocks.len();
        self.begin[index as usize] = begin as u32 + 1;
        let leaf = &surface.leaves[index as usize];
        let origin = surface.blocks[index as usize].origin;
        let ridges = usize::from(leaf.ridges);
        for first in (0..ridges).step_by(LANES) {
            let mut block = RidgeBlock::EMPTY;
            let edges = &surface.edges[leaf.first_edge as usize + first..leaf.first_edge as usize + ridges];
            for (lane, edge) in edges.iter().take(LANES).enumerate() {
                let mut ends = [[0.0; 3]; 2];
                for (end, &vertex) in ends.iter_mut().zip(&edge.vertices) {
                    let p = &surface.vertices[vertex as usize];
                    for axis in 0..3 {
                        end[axis] = (p[axis] - f64::from(origin[axis])) as f32;
                    }
                }
                block.set(lane, ends, &Cone::wide(edge.normal, edge.cone));
            }
            for lane in edges.len()..LANES {
                block.repeat(edges.len() - 1, lane);
            }
            self.blocks.push(block);
        }
        begin
    }
}
