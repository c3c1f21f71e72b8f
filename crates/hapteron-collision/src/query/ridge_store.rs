//! The ridges of the leaves that queries have come across, made ready for eight pairs of edges at once.
//!
//! They do not depend on the pose, so what one query needed serves the next ones. Kept here and not in the surface, most leaves of which no
//! query ever asks for.

use crate::surface::{Cone, LANES, Leaf, Surface};

/// Up to eight edges of a leaf about its origin, as a start and a vector to the end, by axis and lane, with their normal cones.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct RidgeBlock {
    pub start: [[f32; LANES]; 3],
    pub along: [[f32; LANES]; 3],
    pub normal: [[f32; LANES]; 3],
    pub cos: [f32; LANES],
}

impl RidgeBlock {
    /// Lanes without an edge are so far away that they never are the closest, but not so far that a height is not a number.
    pub(super) const EMPTY: Self = Self {
        start: [[1e30; LANES]; 3],
        along: [[0.0; LANES]; 3],
        normal: [[0.0; LANES]; 3],
        cos: [1.0; LANES],
    };

    /// The edge is given by its ends about the origin, the axis of its normal cone and the cosine of that.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, [a, b]: [[f32; 3]; 2], axis: [f32; 3], cos: f32) {
        for k in 0..3 {
            self.start[k][lane] = a[k];
            self.along[k][lane] = b[k] - a[k];
            self.normal[k][lane] = axis[k];
        }
        self.cos[lane] = cos;
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

    /// Makes room for the blocks of about so many leaves, if there are none yet.
    pub(super) fn expect(&mut self, leaves: usize) {
        if self.blocks.is_empty() {
            self.blocks.reserve(leaves + leaves / 4);
        }
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
        let origin = surface.blocks[index as usize].origin.map(f64::from);
        let first = leaf.first_edge as usize;
        for edges in surface.edges[first..first + usize::from(leaf.ridges)].chunks(LANES) {
            self.blocks.push(RidgeBlock::EMPTY);
            let Some(block) = self.blocks.last_mut() else { continue };
            for (lane, edge) in edges.iter().enumerate() {
                let [a, b] = edge.vertices;
                let (a, b) = (&surface.vertices[a as usize], &surface.vertices[b as usize]);
                let a = [(a[0] - origin[0]) as f32, (a[1] - origin[1]) as f32, (a[2] - origin[2]) as f32];
                let b = [(b[0] - origin[0]) as f32, (b[1] - origin[1]) as f32, (b[2] - origin[2]) as f32];
                block.set(lane, [a, b], edge.normal, Cone::wide_cos(edge.cone));
            }
        }
        begin
    }
}
