//! The inner loops that find which edges may run through which triangles, eight at a time and stage by stage over flat lists.
//!
//! In single precision throughout: what they refuse is certain, and so is what they say of a triangle that is surely pierced; all
//! between is looked at again exactly.

use super::edges::{EdgeBlock, Edges, edges_of, filled};
use crate::query::kernel::{bits, lanes, lanes_of};
use crate::query::side::Side;
use crate::surface::{LANES, Leaf, Surface, TriangleBlock};
use crate::vector::{Rigid, Vec3};
use fearless_simd::{Simd, f32x8, mask32x8, prelude::*, u32x8};

/// Bound of the rounding of a segment's place, in units of the slack of single-precision coordinates.
pub(super) const WIDE: f32 = 5.0;
/// From how many blocks of edges on a batch is full. Its lists then still fit the nearest cache.
const BATCH: usize = 24;
/// Bits of eight meetings.
const WORD: usize = LANES * LANES;
/// Room for the edges of a leaf (three for each of its triangles), and for eight more that are written at once.
const ROOM: usize = 4 * LANES;

/// Up to eight edges in the other surface's frame, or what of them is farther from their ends than these are from the other surface.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Segments {
    /// Where they start, about an origin.
    start: [[f32; LANES]; 3],
    /// Vectors to their ends.
    along: [[f32; LANES]; 3],
    /// Sums of the magnitudes of the coordinates of these.
    size: [f32; LANES],
    /// Negative when one end is known to be inside.
    end: [f32; LANES],
    pub edges: [u32; LANES],
    /// The origin, and what it lacks in single precision.
    origin: [[f32; 3]; 2],
    /// How far off a distance from them may be as they are turned, metres.
    error: f32,
    /// The leaf that they are of.
    pub leaf: u32,
}

impl Segments {
    /// Lanes that are near nothing: so far away that they never are the closest, but not so far that a height is not a number.
    const EMPTY: Self = Self {
        start: [[1e30; LANES]; 3],
        along: [[0.0; LANES]; 3],
        size: [0.0; LANES],
        end: [0.0; LANES],
        edges: [0; LANES],
        origin: [[0.0; 3]; 2],
        error: 0.0,
        leaf: 0,
    };

    /// Takes eight edges from place `at` of the rows on, of which so many are left, and turns them into the other frame.
    #[inline(always)]
    fn turn<S: Simd>(&mut self, frame: &Frame<'_, S>, rows: &Rows, at: usize, left: usize) {
        let simd = frame.simd;
        let end = at + LANES;
        let start = eight_of(simd, &rows.start, at);
        let along = eight_of(simd, &rows.along, at);
        let [from, part] = eight_of(simd, &rows.part, at);
        let filled = f32x8::load_array(simd, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]).simd_lt(left as f32);
        let (far, zero) = (f32x8::splat(simd, 1e30), f32x8::splat(simd, 0.0));
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

/// A block of segments and a leaf whose bounds some of them meet.
#[derive(Clone, Copy, Debug, Default)]
struct Meeting {
    leaf: u32,
    block: u16,
    /// One bit for each triangle of the leaf.
    triangles: u16,
    /// From the leaf's origin to that of the segments.
    from: [f32; 3],
    /// How far off the distance of a segment from a plane of the leaf may be, metres.
    error: f32,
}

/// A segment and the triangles of a leaf, one bit each, that it may run through, and those of them that it surely does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub leaf: u32,
    pub block: usize,
    pub lane: usize,
    pub maybe: u32,
    pub surely: u32,
}

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

/// Segments with the leaves that they meet, and what comes of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Batch {
    segments: Vec<Segments>,
    filled: usize,
    meetings: Vec<Meeting>,
    /// By meeting: which lanes of the block meet the leaf's bounds.
    meeting_lanes: Vec<u8>,
    met: usize,
    /// Where a segment may run through triangles of a leaf: which those are and which surely, by eight bits, and the meeting and the lane.
    hits: Vec<u64>,
    pierced: usize,
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
}

impl Batch {
    pub(super) fn clear(&mut self) {
        (self.filled, self.met, self.pierced) = (0, 0, 0);
    }

    pub(super) fn is_full(&self) -> bool {
        self.filled >= BATCH
    }

    pub(super) fn segments(&self) -> &[Segments] {
        &self.segments[..self.filled]
    }

    pub(super) fn hits(&self) -> usize {
        self.pierced
    }

    #[inline(always)]
    pub(super) fn hit(&self, index: usize) -> Hit {
        let hit = self.hits[index];
        let meeting = &self.meetings[(hit >> 19) as usize];
        let (maybe, surely) = (hit as u32 & 0xff, hit as u32 >> 8 & 0xff);
        let (block, lane) = (usize::from(meeting.block), (hit >> 16) as usize % LANES);
        Hit { leaf: meeting.leaf, block, lane, maybe, surely }
    }

    /// Takes the edges of a leaf that may run through a face: those with a far end that are longer than what their ends know to be
    /// empty. Gives by how much less the ends of the others may know before one of them may, too.
    #[inline(always)]
    pub(super) fn take<S: Simd>(&mut self, frame: &Frame<'_, S>, edges: &mut Edges, side: &Side, leaf: u32, rows: &mut Rows) -> f32 {
        let range = edges_of(frame.own, leaf);
        let blocks = edges.of(frame.own, leaf, side, frame.exact_tolerance);
        let (mut count, mut known) = (0, 0);
        let mut spare = f32x8::splat(frame.simd, f32::INFINITY);
        for (index, block) in blocks.enumerate() {
            let block = edges.block(block);
            let ends = [distances(edges, &block.places[0]), distances(edges, &block.places[1])];
            let part = Part::new(frame, block, ends);
            spare = spare.min(part.spare);
            known |= (bits(part.known) & filled(range.len(), index)) << (index * LANES);
            let first = range.start + (index * LANES) as u32;
            part.write(frame.simd, block, first, count.min(ROOM - LANES), rows);
            count += bits(part.long).count_ones() as usize;
        }
        edges.settle(range.start, known);
        self.append(frame, leaf, count.min(ROOM - LANES), rows);
        spare.reduce_min()
    }

    /// Turns the rows into the other surface's frame.
    #[inline(always)]
    fn append<S: Simd>(&mut self, frame: &Frame<'_, S>, leaf: u32, count: usize, rows: &Rows) {
        let own = &frame.own.blocks[leaf as usize];
        let origin = frame.motion.point(own.origin.map(f64::from));
        let (mut near, mut rest) = ([0.0; 3], [0.0; 3]);
        for k in 0..3 {
            near[k] = origin[k] as f32;
            rest[k] = (origin[k] - f64::from(near[k])) as f32;
        }
        let error = 6.0 * own.error + 1e-4 * frame.slack;
        let blocks = count.div_ceil(LANES);
        while self.segments.len() < self.filled + blocks {
            self.segments.push(Segments::EMPTY);
        }
        for (index, block) in self.segments[self.filled..self.filled + blocks].iter_mut().enumerate() {
            let at = (index * LANES).min(ROOM - LANES);
            block.turn(frame, rows, at, count - at);
            (block.origin, block.error, block.leaf) = ([near, rest], error, leaf);
        }
        self.filled += blocks;
    }

    /// Lists which of the segments from number `first` on meet the bounds of which of the near leaves. Gives how far away at least any of them
    /// is from any leaf; not positive when some meet.
    #[inline(always)]
    pub(super) fn meet<S: Simd>(&mut self, frame: &Frame<'_, S>, first: usize, near: &[u32]) -> f32 {
        let most = self.met + (self.filled - first) * near.len() + LANES;
        if self.meetings.len() < most {
            self.meetings.resize(2 * most, Meeting::default());
            self.meeting_lanes.resize(2 * most, 0);
        }
        let mut apart = f32x8::splat(frame.simd, f32::INFINITY);
        let leaves = frame.other.leaves.as_slice();
        let (meetings, meeting_lanes) = (&mut self.meetings[..most], &mut self.meeting_lanes[..most]);
        let mut met = self.met;
        for (index, block) in self.segments[..self.filled].iter().enumerate().skip(first) {
            let segments = Moved::new(frame.simd, block);
            for &leaf in near {
                let own = segments.apart(frame.simd, &leaves[leaf as usize], frame.wide);
                apart = apart.min(own);
                let lanes = bits(own.simd_le(0.0));
                (meetings[met].leaf, meetings[met].block) = (leaf, index as u16);
                meeting_lanes[met] = lanes as u8;
                met += usize::from(lanes != 0);
            }
        }
        self.met = met;
        apart.reduce_min()
    }

    /// Makes the meetings ready for the triangles.
    #[inline(always)]
    fn refine<S: Simd>(&mut self, frame: &Frame<'_, S>) {
        let (leaves, blocks) = (frame.other.leaves.as_slice(), frame.other.blocks.as_slice());
        let segments = self.segments.as_slice();
        for meeting in &mut self.meetings[..self.met] {
            let block = &blocks[meeting.leaf as usize];
            let segments = &segments[usize::from(meeting.block)];
            let [near, rest] = &segments.origin;
            for k in 0..3 {
                meeting.from[k] = near[k] - block.origin[k] + rest[k];
            }
            meeting.error = segments.error + 4.0 * block.error;
            meeting.triangles = (1 << leaves[meeting.leaf as usize].triangles) - 1;
        }
    }

    /// Lists which segments may run through which triangles.
    #[inline(always)]
    pub(super) fn pierce<S: Simd>(&mut self, frame: &Frame<'_, S>) {
        self.refine(frame);
        self.meeting_lanes[self.met..].iter_mut().take(LANES).for_each(|lanes| *lanes = 0);
        let (words, _) = self.meeting_lanes.as_chunks::<LANES>();
        let (eights, _) = self.meetings.as_chunks::<LANES>();
        let (segments, blocks) = (self.segments.as_slice(), frame.other.blocks.as_slice());
        let mut count = 0;
        let words = words.iter().zip(eights).take(self.met.div_ceil(LANES));
        for (number, (word, meetings)) in words.enumerate() {
            if self.hits.len() < count + WORD {
                self.hits.resize(2 * count + WORD, 0);
            }
            let Some(hits) = self.hits[count..].first_chunk_mut::<WORD>() else { continue };
            let mut rest = u64::from_le_bytes(*word);
            let mut own = 0;
            while rest != 0 {
                let bit = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let (meeting, lane) = (&meetings[bit / LANES % LANES], bit % LANES);
                let segments = &segments[usize::from(meeting.block)];
                let block = &blocks[meeting.leaf as usize];
                let [maybe, surely] = pierced(frame.simd, segments, lane, block, meeting);
                let triangles = u32::from(meeting.triangles);
                let (maybe, surely) = (maybe & triangles, surely & triangles);
                hits[own % WORD] = u64::from(surely << 8 | maybe) | ((number * WORD + bit) as u64) << 16;
                own += usize::from(maybe != 0);
            }
            count += own;
        }
        self.pierced = count;
    }
}

/// Eight numbers of each row, from place `at` on.
#[inline(always)]
fn eight_of<S: Simd, const N: usize>(simd: S, rows: &[[f32; ROOM]; N], at: usize) -> [f32x8<S>; N] {
    let mut result = [f32x8::splat(simd, 0.0); N];
    for (eight, row) in result.iter_mut().zip(rows) {
        *eight = f32x8::from_slice(simd, &row[at..at + LANES]);
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

/// What is left of eight edges.
struct Part<S: Simd> {
    /// Which have two known ends.
    known: mask32x8<S>,
    /// Which may run through a face.
    long: mask32x8<S>,
    /// How much less the ends may know before the others may; infinite for these.
    spare: f32x8<S>,
    /// What is kept: from which share of the edge, and how much.
    part: [f32x8<S>; 2],
    /// Negative when one end is known to be inside.
    end: f32x8<S>,
}

impl<S: Simd> Part<S> {
    #[inline(always)]
    fn new(frame: &Frame<'_, S>, block: &EdgeBlock, ends: [[f32; LANES]; 2]) -> Self {
        let simd = frame.simd;
        let zero = f32x8::splat(simd, 0.0);
        let along = lanes_of(simd, &block.along);
        let length = dot(along, along).sqrt();
        let [a, b] = [lanes(simd, &ends[0]), lanes(simd, &ends[1])];
        let [far_a, far_b] = [a.simd_eq(zero), b.simd_eq(zero)];
        let tolerance = f32x8::splat(simd, frame.tolerance);
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
        let spare = long.select(f32x8::splat(simd, f32::INFINITY), spare);
        let inverse = f32x8::splat(simd, 1.0) / length.max(f32::MIN_POSITIVE);
        let from = empty_a * inverse;
        let part = [from, f32x8::splat(simd, 1.0) - empty_b * inverse - from];
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
        let edges = u32x8::load_array(simd, [0, 1, 2, 3, 4, 5, 6, 7]) + first;
        edges.compress(self.long).store_slice(&mut rows.edges[at..end]);
    }
}

/// Makes a positive number greater by more than it has been rounded down.
const ROUNDED_UP: f32 = 1.0 + 3e-6;

/// A block of segments that is held against one leaf after the other.
struct Moved<S: Simd> {
    start: [f32x8<S>; 3],
    along: [f32x8<S>; 3],
    low: [f32x8<S>; 3],
    high: [f32x8<S>; 3],
}

impl<S: Simd> Moved<S> {
    #[inline(always)]
    fn new(simd: S, block: &Segments) -> Self {
        let (mut start, along) = (lanes_of(simd, &block.start), lanes_of(simd, &block.along));
        let zero = f32x8::splat(simd, 0.0);
        let (mut low, mut high) = (start, start);
        for k in 0..3 {
            start[k] = start[k] + block.origin[0][k];
            low[k] = start[k] + along[k].min(zero);
            high[k] = start[k] + along[k].max(zero);
        }
        Self { start, along, low, high }
    }

    /// How far beside a leaf's box, along an axis.
    #[inline(always)]
    fn beside(&self, simd: S, leaf: &Leaf, axis: usize) -> f32x8<S> {
        let under = f32x8::splat(simd, leaf.min[axis]) - self.high[axis];
        under.max(self.low[axis] - leaf.max[axis])
    }

    /// Lower bounds of the distances to a leaf; not positive where they may meet its bounds.
    #[inline(always)]
    fn apart(&self, simd: S, leaf: &Leaf, wide: f32) -> f32x8<S> {
        let mut apart = self.beside(simd, leaf, 0);
        apart = apart.max(self.beside(simd, leaf, 1)).max(self.beside(simd, leaf, 2));
        let normal = splat(simd, leaf.normal);
        let (height, rise) = (dot(normal, self.start), dot(normal, self.along));
        let other = height + rise;
        let under = f32x8::splat(simd, leaf.low) - height.max(other);
        apart.max(under).max(height.min(other) - leaf.high) - wide
    }
}

/// Bit `i` of the first number is set when a segment that meets the bounds of a leaf may run through triangle `i` of its block, and of the
/// second when it surely does.
#[inline(always)]
fn pierced<S: Simd>(simd: S, segments: &Segments, lane: usize, b: &TriangleBlock, meeting: &Meeting) -> [u32; 2] {
    let lane = lane % LANES;
    let size = segments.size[lane];
    let error = meeting.error;
    let along = [segments.along[0][lane], segments.along[1][lane], segments.along[2][lane]];
    let d = splat(simd, along);
    let mut from = d;
    for k in 0..3 {
        from[k] = f32x8::splat(simd, segments.start[k][lane] + meeting.from[k]) - lanes(simd, &b.corner[k]);
    }
    let normal = lanes_of(simd, &b.normal);
    let (z, dz) = (dot(normal, from), dot(normal, d));
    let to_z = z + dz;
    let (low, high) = (z.min(to_z), z.max(to_z));
    // Where the segment is almost in the plane the share of it is uncertain, and infinite or not a number in it.
    let inverse = f32x8::splat(simd, 1.0) / dz;
    let share = z * inverse;
    let margin = inverse.abs() * (2.0 * error * size) + 2.0 * error;
    let at = [from[0] - share * d[0], from[1] - share * d[1], from[2] - share * d[2]];
    let (x, y) = (dot(lanes_of(simd, &b.along), at), dot(lanes_of(simd, &b.across), at));
    let (u, v) = (lanes_of(simd, &b.second), lanes_of(simd, &b.third));
    let across2 = u[1] * (x - lanes(simd, &b.length[0])) - u[0] * y;
    let across3 = v[0] * y - v[1] * x;
    let outside = across2.max(across3).max(-y);
    let refused = low.simd_gt(error) | high.simd_lt(-error) | outside.simd_gt(margin);
    let surely = low.simd_lt(-error) & high.simd_gt(error) & outside.simd_lt(-margin);
    [bits(!refused), bits(surely)]
}

#[inline(always)]
fn splat<S: Simd>(simd: S, v: [f32; 3]) -> [f32x8<S>; 3] {
    [f32x8::splat(simd, v[0]), f32x8::splat(simd, v[1]), f32x8::splat(simd, v[2])]
}

#[inline(always)]
fn dot<S: Simd>(a: [f32x8<S>; 3], b: [f32x8<S>; 3]) -> f32x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
