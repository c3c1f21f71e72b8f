//! The ridges of the leaves that queries have come across, made ready for sixteen pairs of edges at once.
//!
//! They do not depend on the pose, so what one query needed serves the next ones. Kept here and not in the surface, most leaves of which no
//! query ever asks for.

use super::kernel::{LaneNumbers, Lanes, NUMBERS, lanes, lanes_of};
use crate::surface::{Cone, LANES, Surface};
use crate::vector::{Vec3, sub};
use fearless_simd::{Simd, prelude::*};

/// Shorter edges have no length, metres: their squares would be lost.
const TINY: f32 = 1e-18;

/// Up to sixteen edges of a leaf, by axis and lane.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct RidgeBlock {
    pub start: [[f32; LANES]; 3],
    /// The unit vector towards the end, and how far away that is.
    pub along: [[f32; LANES]; 3],
    pub length: [f32; LANES],
    /// `along` times the axis of the normal cone (the vector product), and the cosine of that cone.
    pub across: [[f32; LANES]; 3],
    pub cos: [f32; LANES],
    /// The box of all edges.
    pub low: [f32; 3],
    pub high: [f32; 3],
    /// The number of the first edge.
    pub first: u32,
}

impl RidgeBlock {
    pub(super) const EMPTY: Self = Self {
        start: [[0.0; LANES]; 3],
        along: [[0.0; LANES]; 3],
        length: [0.0; LANES],
        across: [[0.0; LANES]; 3],
        cos: [1.0; LANES],
        low: [0.0; 3],
        high: [0.0; 3],
        first: 0,
    };

    /// Takes an edge between two points; the normal cone has this axis and cosine. [`RidgeBlock::finish`] makes the rest from that.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, [a, b]: [Vec3; 2], axis: [f32; 3], cos: f32) {
        for k in 0..3 {
            self.start[k][lane] = a[k] as f32;
            self.along[k][lane] = (b[k] - a[k]) as f32;
            self.across[k][lane] = axis[k];
        }
        self.cos[lane] = cos;
    }

    /// To be called after so many edges have been set, at least one; the empty lanes then begin at `empty` on each axis.
    #[inline(always)]
    pub(super) fn finish<S: Simd>(&mut self, simd: S, edges: usize, empty: f32) {
        let (vector, axis) = (lanes_of(simd, &self.along), lanes_of(simd, &self.across));
        let squared = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2];
        let length = squared.sqrt();
        let zero = Lanes::splat(simd, 0.0);
        // An edge without a length has no direction, and is never refused for it.
        let inverse = length.simd_gt(TINY).select(Lanes::splat(simd, 1.0) / length, zero);
        let along = [vector[0] * inverse, vector[1] * inverse, vector[2] * inverse];
        let filled = LaneNumbers::load_array_ref(simd, &NUMBERS).simd_lt(edges as u32);
        self.length = length.to_array();
        for k in 0..3 {
            let start = filled.select(lanes(simd, &self.start[k]), Lanes::splat(simd, self.start[k][0]));
            let end = start + vector[k];
            (self.low[k], self.high[k]) = (start.min(end).reduce_min(), start.max(end).reduce_max());
            self.start[k] = filled.select(start, Lanes::splat(simd, empty)).to_array();
            let (l, m) = ((k + 1) % 3, (k + 2) % 3);
            self.along[k] = along[k].to_array();
            self.across[k] = (along[l] * axis[m] - along[m] * axis[l]).to_array();
        }
    }
}

/// Which blocks are a leaf's: of how many, in the lowest bits, the first, and one more than both. So zero stands for blocks that nobody has
/// asked for yet, which costs the least to write for all leaves of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Place(u32);

impl Place {
    const BITS: u32 = 2;
    pub(super) const UNKNOWN: Self = Self(0);

    #[inline(always)]
    fn new(begin: usize, count: usize) -> Self {
        Self(((begin as u32) << Self::BITS | count as u32) + 1)
    }

    #[inline(always)]
    pub(super) fn begin(self) -> u32 {
        self.0.wrapping_sub(1) >> Self::BITS
    }

    #[inline(always)]
    pub(super) fn count(self) -> usize {
        (self.0.wrapping_sub(1) & ((1 << Self::BITS) - 1)) as usize
    }
}

/// The blocks of one surface's leaves.
#[derive(Clone, Debug, Default)]
pub(super) struct RidgeStore {
    pub blocks: Vec<RidgeBlock>,
    /// By leaf.
    pub places: Vec<Place>,
}

/// About what the edges of a block are, and what is in the lanes that it does not fill.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum About {
    /// The leaf's origin. Empty lanes are so far away that they never are the closest, but not so far that a height is not a number.
    Leaf,
    /// The origin of the mesh. Empty lanes are no numbers, and so never less than anything.
    Mesh,
}

impl RidgeStore {
    /// Forgets everything and makes room for a surface.
    pub(super) fn reset(&mut self, surface: &Surface) {
        self.blocks.clear();
        self.places.clear();
        self.places.resize(surface.leaves.len(), Place::UNKNOWN);
    }

    /// Makes room for the blocks of about so many leaves, if there are none yet.
    pub(super) fn expect(&mut self, leaves: usize) {
        if self.blocks.is_empty() {
            self.blocks.reserve(leaves + leaves / 4);
        }
    }

    /// The blocks of a leaf that has ridges.
    #[inline(always)]
    pub(super) fn of<S: Simd>(
        &mut self,
        simd: S,
        surface: &Surface,
        index: u32,
        about: About,
    ) -> &[RidgeBlock] {
        let mut place = self.places[index as usize];
        if place == Place::UNKNOWN {
            place = self.gather(simd, surface, index, about);
        }
        &self.blocks[place.begin() as usize..][..place.count()]
    }

    /// Makes the blocks of a leaf.
    #[inline(always)]
    pub(super) fn gather<S: Simd>(&mut self, simd: S, surface: &Surface, index: u32, about: About) -> Place {
        // Rarely needed, so a function of its own.
        simd.vectorize(
            #[inline(always)]
            || self.make(simd, surface, index, about),
        )
    }

    #[inline(always)]
    fn make<S: Simd>(&mut self, simd: S, surface: &Surface, index: u32, about: About) -> Place {
        let begin = self.blocks.len();
        let leaf = &surface.leaves[index as usize];
        let (origin, empty) = match about {
            About::Leaf => (surface.blocks[index as usize].origin.map(f64::from), 1e30),
            About::Mesh => ([0.0; 3], f32::NAN),
        };
        let mut first = leaf.first_edge;
        let edges = first as usize..first as usize + usize::from(leaf.ridges);
        for edges in surface.edges[edges].chunks(LANES) {
            self.blocks.push(RidgeBlock::EMPTY);
            let Some(block) = self.blocks.last_mut() else { continue };
            block.first = first;
            first += LANES as u32;
            for (lane, edge) in edges.iter().enumerate().take(LANES) {
                let [a, b] = edge.vertices;
                let (a, b) = (surface.vertices[a as usize], surface.vertices[b as usize]);
                block.set(lane, [sub(a, origin), sub(b, origin)], edge.normal, Cone::wide_cos(edge.cone));
            }
            block.finish(simd, edges.len(), empty);
        }
        let place = Place::new(begin, self.blocks.len() - begin);
        self.places[index as usize] = place;
        place
    }
}
