//! Leaves of the obstacle gathered for the leaves of one node of the body, which are then held against a block of them at a time.

use super::super::bounds::{Bounds, Boxes, Slab};
use super::super::kernel::{LaneMask, LaneNumbers, Lanes, bits, lanes};
use super::Margins;
use super::corners::Corners;
use super::lists::List;
use crate::surface::{LANES, Node};
use fearless_simd::{Simd, prelude::*};

/// Blocks of as many leaves as there are lanes, in one piece.
const BLOCKS: usize = 5;
/// No more leaves than this in one, so that a block more can be written behind them.
const FULL: usize = LANES * (BLOCKS - 1);

type Row = [[f32; LANES]; BLOCKS];

/// A number of leaves, by row.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Piece {
    min: [Row; 3],
    max: [Row; 3],
    normal: [Row; 3],
    low: Row,
    high: Row,
    leaf: [[u32; LANES]; BLOCKS],
    count: usize,
}

impl Piece {
    const EMPTY: Self = {
        let row = [[0.0; LANES]; BLOCKS];
        Self {
            min: [row; 3],
            max: [row; 3],
            normal: [row; 3],
            low: row,
            high: row,
            leaf: [[0; LANES]; BLOCKS],
            count: 0,
        }
    };
}

/// Coordinate of lanes that are far from everything.
const FAR: f32 = 1e30;

/// The gathered leaves, and where they end.
#[derive(Clone, Debug, Default)]
pub(super) struct Gathered {
    pieces: Vec<Piece>,
    /// Pieces in use.
    used: usize,
}

impl Gathered {
    pub(super) fn clear(&mut self) {
        if self.pieces.is_empty() {
            self.pieces.push(Piece::EMPTY);
        }
        self.used = 1;
        self.pieces[0].count = 0;
    }

    /// How many there are.
    #[inline(always)]
    pub(super) fn count(&self) -> usize {
        self.pieces[..self.used].iter().map(|piece| piece.count).sum()
    }

    /// Appends the children of a node that the mask says, all of which are leaves.
    #[inline(always)]
    pub(super) fn append<S: Simd>(&mut self, simd: S, node: &Node, mask: LaneMask<S>) {
        if self.pieces[self.used - 1].count + LANES > FULL {
            self.more(simd);
        }
        let piece = &mut self.pieces[self.used - 1];
        let begin = piece.count;
        for k in 0..3 {
            put(simd, &mut piece.min[k], begin, &node.min[k], mask);
            put(simd, &mut piece.max[k], begin, &node.max[k], mask);
            put(simd, &mut piece.normal[k], begin, &node.normal[k], mask);
        }
        put(simd, &mut piece.low, begin, &node.low, mask);
        put(simd, &mut piece.high, begin, &node.high, mask);
        let children = LaneNumbers::load_array_ref(simd, &node.child) & !crate::surface::LEAF;
        children.compress(mask).store_slice(&mut piece.leaf.as_flattened_mut()[begin..begin + LANES]);
        piece.count = begin + bits(mask).count_ones() as usize;
    }

    /// Begins another piece.
    #[inline(never)]
    fn more<S: Simd>(&mut self, simd: S) {
        self.finish(simd);
        if self.pieces.len() == self.used {
            self.pieces.push(Piece::EMPTY);
        }
        self.pieces[self.used].count = 0;
        self.used += 1;
    }

    /// Fills the last block up with lanes that are far from everything.
    #[inline(always)]
    pub(super) fn finish<S: Simd>(&mut self, simd: S) {
        let piece = &mut self.pieces[self.used - 1];
        let rest = piece.count..piece.count + LANES;
        let (far, zero) = (Lanes::splat(simd, FAR), Lanes::splat(simd, 0.0));
        for k in 0..3 {
            far.store_slice(&mut piece.min[k].as_flattened_mut()[rest.clone()]);
            far.store_slice(&mut piece.max[k].as_flattened_mut()[rest.clone()]);
            zero.store_slice(&mut piece.normal[k].as_flattened_mut()[rest.clone()]);
        }
        zero.store_slice(&mut piece.low.as_flattened_mut()[rest.clone()]);
        zero.store_slice(&mut piece.high.as_flattened_mut()[rest]);
    }

    /// True when none of the leaves may be within the margin of what is inside the bounds; not always found out.
    #[inline(always)]
    pub(super) fn far<S: Simd>(&self, simd: S, b: &Bounds, margin: f32) -> bool {
        let first = &self.pieces[0];
        first.count <= LANES && self.used == 1 && !first.boxes(0).near(simd, b, margin).any_true()
    }

    /// Lists the leaves that may be within the margins of one of the body.
    #[inline(always)]
    pub(super) fn meet<S: Simd>(
        &self,
        simd: S,
        corners: &Corners,
        slab: &Slab,
        margins: Margins,
        close: &mut Close,
        [near, touching]: &mut [List<'_>; 2],
    ) {
        for piece in &self.pieces[..self.used] {
            piece.choose(simd, corners, slab, margins.near, close);
            for block in 0..close.count.div_ceil(LANES).min(BLOCKS) {
                let gap = close.gap(simd, block, corners);
                let leaves = LaneNumbers::load_array_ref(simd, &close.leaf[block]);
                near.append(leaves, gap.simd_le(margins.near));
                touching.append(leaves, gap.simd_le(margins.touching));
            }
        }
    }
}

#[inline(always)]
fn put<S: Simd>(simd: S, row: &mut Row, begin: usize, values: &[f32; LANES], mask: LaneMask<S>) {
    lanes(simd, values).compress(mask).store_slice(&mut row.as_flattened_mut()[begin..begin + LANES]);
}

impl Piece {
    #[inline(always)]
    fn boxes(&self, block: usize) -> Boxes<'_> {
        Boxes {
            min: [&self.min[0][block], &self.min[1][block], &self.min[2][block]],
            max: [&self.max[0][block], &self.max[1][block], &self.max[2][block]],
            normal: [&self.normal[0][block], &self.normal[1][block], &self.normal[2][block]],
            low: &self.low[block],
            high: &self.high[block],
        }
    }

    /// Takes those that box and slab of a leaf of the body do not refuse.
    #[inline(always)]
    fn choose<S: Simd>(&self, simd: S, corners: &Corners, slab: &Slab, margin: f32, close: &mut Close) {
        let mut count = 0;
        for block in 0..self.count.div_ceil(LANES).min(BLOCKS) {
            let gap = self.gap(simd, block, corners, slab);
            let mask = gap.simd_le(margin);
            for k in 0..3 {
                put(simd, &mut close.normal[k], count, &self.normal[k][block], mask);
            }
            put(simd, &mut close.low, count, &self.low[block], mask);
            put(simd, &mut close.high, count, &self.high[block], mask);
            gap.compress(mask).store_slice(&mut close.gap.as_flattened_mut()[count..count + LANES]);
            let leaves = LaneNumbers::load_array_ref(simd, &self.leaf[block]);
            leaves.compress(mask).store_slice(&mut close.leaf.as_flattened_mut()[count..count + LANES]);
            count = (count + bits(mask).count_ones() as usize).min(FULL);
        }
        Lanes::splat(simd, FAR).store_slice(&mut close.gap.as_flattened_mut()[count..count + LANES]);
        close.count = count;
    }

    /// Lower bounds of the distances of a leaf of the body to the leaves of a block by its box and slab; negative where they may overlap.
    #[inline(always)]
    fn gap<S: Simd>(&self, simd: S, block: usize, corners: &Corners, slab: &Slab) -> Lanes<S> {
        let mut gap = Lanes::splat(simd, f32::NEG_INFINITY);
        let (mut middle, mut reach) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 0.0));
        for k in 0..3 {
            let (min, max) = (lanes(simd, &self.min[k][block]), lanes(simd, &self.max[k][block]));
            gap = gap.max(min - corners.max[k]).max(Lanes::splat(simd, corners.min[k]) - max);
            middle += (min + max) * (0.5 * slab.normal[k]);
            reach += (max - min) * (0.5 * slab.normal[k].abs());
        }
        gap.max((middle - slab.high).max(Lanes::splat(simd, slab.low) - middle) - reach)
    }
}

/// Those of the leaves in a piece that are close to one of the body, as far as has been seen.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Close {
    normal: [Row; 3],
    low: Row,
    high: Row,
    /// Lower bound of the distance.
    gap: Row,
    leaf: [[u32; LANES]; BLOCKS],
    count: usize,
}

impl Default for Close {
    fn default() -> Self {
        let row = [[0.0; LANES]; BLOCKS];
        Self { normal: [row; 3], low: row, high: row, gap: row, leaf: [[0; LANES]; BLOCKS], count: 0 }
    }
}

impl Close {
    /// Lower bounds of the distances that allow for the slabs of the leaves of a block.
    #[inline(always)]
    fn gap<S: Simd>(&self, simd: S, block: usize, corners: &Corners) -> Lanes<S> {
        let [x, y, z] = &self.normal;
        let normal = [lanes(simd, &x[block]), lanes(simd, &y[block]), lanes(simd, &z[block])];
        let [low, high] = corners.heights(simd, normal);
        let gap = lanes(simd, &self.gap[block]);
        gap.max(low - lanes(simd, &self.high[block])).max(lanes(simd, &self.low[block]) - high)
    }
}
