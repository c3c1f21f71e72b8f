//! Edges in the other surface's frame: those of a leaf that may run through a face, and what of them.

use super::edges::{EdgeBlock, Edges, edges_of, filled};
use crate::query::kernel::{LaneMask, LaneNumbers, Lanes, NUMBERS, bits, dot, lanes, lanes_of, splat};
use crate::query::side::Side;
use crate::surface::{LANES, Leaf, Surface};
use crate::vector::Rigid;
use fearless_simd::{Simd, prelude::*};

/// Bound of the rounding of a segment's place, in units of the slack of single-precision coordinates. Each coordinate of a point of it is a
/// sum of a start and a share of a vector, both turned (three products of two rounded factors each), and of an origin: less than 45
/// roundings of numbers no greater than the radii and the translation together, so all three are less than 80 off, and five slacks are 84.
pub(super) const WIDE: f32 = 5.0;
/// Room for the edges of a leaf (three for each of its triangles), and for a block more that is written at once.
pub(super) const ROOM: usize = 4 * LANES;

/// How the edges of one surface lie in the frame of the other.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a, S> {
    pub simd: S,
    pub own: &'a Surface,
    pub other: &'a Surface,
    /// From the own frame to the other's.
    pub motion: &'a Rigid,
    pub rotation: [[f32; 3]; 3],
    pub exact_tolerance: f64,
    /// The same, rounded down.
    pub tolerance: f32,
    /// Covers the rounding of single-precision coordinates, metres.
    pub slack: f32,
    /// The same where segments are held against leaves.
    pub wide: f32,
}

/// Up to sixteen edges in the other surface's frame, or what of them is farther from their ends than these are from the other surface.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Segments {
    /// Where they start, about an origin.
    pub start: [[f32; LANES]; 3],
    /// Vectors to their ends.
    pub along: [[f32; LANES]; 3],
    /// Sums of the magnitudes of the coordinates of these.
    pub size: [f32; LANES],
    /// Negative when one end is known to be inside.
    pub end: [f32; LANES],
    pub edges: [u32; LANES],
    /// The origin, and what it lacks in single precision.
    pub origin: [[f32; 3]; 2],
    /// How far off a distance from them may be as they are turned, metres.
    pub error: f32,
    /// The leaf that they are of.
    pub leaf: u32,
}

impl Segments {
    /// Lanes that are near nothing: so far away that they never are the closest, but not so far that a height is not a number.
    pub(super) const EMPTY: Self = Self {
        start: [[1e30; LANES]; 3],
        along: [[0.0; LANES]; 3],
        size: [0.0; LANES],
        end: [0.0; LANES],
        edges: [0; LANES],
        origin: [[0.0; 3]; 2],
        error: 0.0,
        leaf: 0,
    };

    /// Takes a block of edges from place `at` of the rows on, of which so many are left, and turns them into the other frame.
    #[inline(always)]
    pub(super) fn turn<S: Simd>(&mut self, frame: &Frame<'_, S>, rows: &Rows, at: usize, left: usize) {
        let simd = frame.simd;
        let end = at + LANES;
        let start = lanes_at(simd, &rows.start, at);
        let along = lanes_at(simd, &rows.along, at);
        let [from, part] = lanes_at(simd, &rows.part, at);
        let filled = LaneNumbers::load_array_ref(simd, &NUMBERS).simd_lt(left as u32);
        let (far, zero) = (Lanes::splat(simd, 1e30), Lanes::splat(simd, 0.0));
        let mut size = zero;
        for k in 0..3 {
            let turn = splat(simd, frame.rotation[k]);
            let whole = dot(turn, along);
            let start = dot(turn, start) + whole * from;
            let along = whole * part;
            size += along.abs();
            filled.select(start, far).store_array(&mut self.start[k]);
            filled.select(along, zero).store_array(&mut self.along[k]);
        }
        size.store_array(&mut self.size);
        self.end.copy_from_slice(&rows.end[at..end]);
        self.edges.copy_from_slice(&rows.edges[at..end]);
    }

    /// True when one end of the edge in a lane is known to be inside.
    #[inline(always)]
    pub(super) fn begins_inside(&self, lane: usize) -> bool {
        self.end[lane] < 0.0
    }
}

/// The edges of a leaf that are kept, one behind the other, as they are in the leaf.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Rows {
    start: [[f32; ROOM]; 3],
    along: [[f32; ROOM]; 3],
    /// Which part of them is kept: from where, as a share, and how much.
    part: [[f32; ROOM]; 2],
    end: [f32; ROOM],
    edges: [u32; ROOM],
}

impl Rows {
    pub(super) const EMPTY: Self = Self {
        start: [[0.0; ROOM]; 3],
        along: [[0.0; ROOM]; 3],
        part: [[0.0; ROOM]; 2],
        end: [0.0; ROOM],
        edges: [0; ROOM],
    };

    /// Takes the edges of a leaf that may run through a face: those with a far end that are longer than what their ends know to be
    /// empty. Gives how many those are, and how far the body may travel before others may run through a face, too.
    #[inline(always)]
    pub(super) fn take<S: Simd>(
        &mut self,
        frame: &Frame<'_, S>,
        edges: &mut Edges,
        side: &Side,
        leaf: u32,
    ) -> (usize, f32) {
        let range = edges_of(frame.own, leaf);
        let blocks = edges.of(frame.own, leaf, side, frame.exact_tolerance);
        let (mut count, mut known) = (0, 0u64);
        let mut spare = Lanes::splat(frame.simd, f32::INFINITY);
        for (index, block) in blocks.enumerate() {
            let block = edges.block(block);
            let ends = [distances(edges, &block.places[0]), distances(edges, &block.places[1])];
            let part = Part::new(frame, block, ends);
            spare = spare.min(part.spare);
            known |= u64::from(bits(part.known) & filled(range.len(), index)) << (index * LANES);
            let first = range.start + (index * LANES) as u32;
            part.write(frame.simd, block, first, count.min(ROOM - LANES), self);
            count += bits(part.long).count_ones() as usize;
        }
        edges.settle(range.start, known);
        (count.min(ROOM - LANES), spare.reduce_min())
    }
}

/// What is left of the edges of a block.
struct Part<S: Simd> {
    /// Which have two known ends.
    known: LaneMask<S>,
    /// Which may run through a face.
    long: LaneMask<S>,
    /// How much less the ends may know before the others may; infinite for these.
    spare: Lanes<S>,
    /// What is kept: from which share of the edge, and how much.
    part: [Lanes<S>; 2],
    /// Negative when one end is known to be inside.
    end: Lanes<S>,
}

impl<S: Simd> Part<S> {
    #[inline(always)]
    fn new(frame: &Frame<'_, S>, block: &EdgeBlock, ends: [[f32; LANES]; 2]) -> Self {
        let simd = frame.simd;
        let zero = Lanes::splat(simd, 0.0);
        let along = lanes_of(simd, &block.along);
        let length = dot(along, along).sqrt();
        let [a, b] = [lanes(simd, &ends[0]), lanes(simd, &ends[1])];
        let [far_a, far_b] = [a.simd_eq(zero), b.simd_eq(zero)];
        let tolerance = Lanes::splat(simd, frame.tolerance);
        // Less by the rounding of all that is measured here.
        let empty_a = (far_a.select(tolerance, a.abs()) - frame.slack).max(zero);
        let empty_b = (far_b.select(tolerance, b.abs()) - frame.slack).max(zero);
        let far = far_a | far_b;
        let covered = length.simd_le(empty_a + empty_b);
        // Both shrink as the body travels.
        let of_covered = (empty_a + empty_b - length) * 0.5;
        let of_known = tolerance - a.abs().max(b.abs()) * ROUNDED_UP - frame.slack;
        let spare = far.select(of_covered, of_known);
        let long = far & !covered;
        let spare = long.select(Lanes::splat(simd, f32::INFINITY), spare);
        let inverse = Lanes::splat(simd, 1.0) / length.max(f32::MIN_POSITIVE);
        let from = empty_a * inverse;
        let part = [from, Lanes::splat(simd, 1.0) - empty_b * inverse - from];
        Self { known: !far, long, spare, part, end: a.min(b) }
    }

    /// Writes those that may run through a face into the rows, from place `at` on.
    #[inline(always)]
    fn write(&self, simd: S, block: &EdgeBlock, first: u32, at: usize, rows: &mut Rows) {
        let end = at + LANES;
        for k in 0..3 {
            lanes(simd, &block.start[k]).compress(self.long).store_slice(&mut rows.start[k][at..end]);
            lanes(simd, &block.along[k]).compress(self.long).store_slice(&mut rows.along[k][at..end]);
        }
        for k in 0..2 {
            self.part[k].compress(self.long).store_slice(&mut rows.part[k][at..end]);
        }
        self.end.compress(self.long).store_slice(&mut rows.end[at..end]);
        let edges = LaneNumbers::load_array_ref(simd, &NUMBERS) + first;
        edges.compress(self.long).store_slice(&mut rows.edges[at..end]);
    }
}

/// Makes a positive number greater by more than it has been rounded down.
const ROUNDED_UP: f32 = 1.0 + 3e-6;

/// A block of segments that is held against one leaf after the other.
pub(super) struct Moved<S: Simd> {
    start: [Lanes<S>; 3],
    along: [Lanes<S>; 3],
    low: [Lanes<S>; 3],
    high: [Lanes<S>; 3],
}

impl<S: Simd> Moved<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, block: &Segments) -> Self {
        let (mut start, along) = (lanes_of(simd, &block.start), lanes_of(simd, &block.along));
        let zero = Lanes::splat(simd, 0.0);
        let (mut low, mut high) = (start, start);
        for k in 0..3 {
            start[k] += block.origin[0][k];
            low[k] = start[k] + along[k].min(zero);
            high[k] = start[k] + along[k].max(zero);
        }
        Self { start, along, low, high }
    }

    /// How far beside a leaf's box, along an axis.
    #[inline(always)]
    fn beside(&self, simd: S, leaf: &Leaf, axis: usize) -> Lanes<S> {
        let under = Lanes::splat(simd, leaf.min[axis]) - self.high[axis];
        under.max(self.low[axis] - leaf.max[axis])
    }

    /// Lower bounds of the distances to a leaf; not positive where they may meet its bounds.
    #[inline(always)]
    pub(super) fn apart(&self, simd: S, leaf: &Leaf, wide: f32) -> Lanes<S> {
        let mut apart = self.beside(simd, leaf, 0);
        apart = apart.max(self.beside(simd, leaf, 1)).max(self.beside(simd, leaf, 2));
        let normal = splat(simd, leaf.normal);
        let (height, rise) = (dot(normal, self.start), dot(normal, self.along));
        let other = height + rise;
        let under = Lanes::splat(simd, leaf.low) - height.max(other);
        apart.max(under).max(height.min(other) - leaf.high) - wide
    }
}

/// The numbers of a block from each row, from place `at` on.
#[inline(always)]
fn lanes_at<S: Simd, const N: usize>(simd: S, rows: &[[f32; ROOM]; N], at: usize) -> [Lanes<S>; N] {
    let mut result = [Lanes::splat(simd, 0.0); N];
    for (lanes, row) in result.iter_mut().zip(rows) {
        *lanes = Lanes::from_slice(simd, &row[at..at + LANES]);
    }
    result
}

#[inline(always)]
fn distances(edges: &Edges, places: &[u32; LANES]) -> [f32; LANES] {
    let mut result = [0.0; LANES];
    for lane in 0..LANES {
        result[lane] = edges.distance(places[lane]);
    }
    result
}
