//! The inner loops that find which edges may run through which triangles, sixteen at a time and stage by stage over flat lists.
//!
//! In single precision throughout: what they refuse is certain, and so is what they say of a triangle that is surely pierced; all
//! between is looked at again exactly.

use super::edges::Edges;
use super::segments::{Frame, Moved, ROOM, Rows, Segments};
use crate::query::kernel::{Lanes, bits, dot, lanes, lanes_of, splat};
use crate::query::side::Side;
use crate::surface::{LANES, TriangleBlock};
use fearless_simd::{Simd, prelude::*};

/// From how many blocks of edges on a batch is full. Its lists then still fit the nearest cache.
const BATCH: usize = 24;
/// As many meetings as there is room for, one bit a lane, in a number.
const GROUP: usize = u64::BITS as usize / LANES;
/// Bits of a group.
const WORD: usize = GROUP * LANES;
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

/// Segments with the leaves that they meet, and what comes of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Batch {
    segments: Vec<Segments>,
    filled: usize,
    meetings: Vec<Meeting>,
    /// By meeting: which lanes of the block meet the leaf's bounds.
    meeting_lanes: Vec<u16>,
    met: usize,
    /// Where a segment may run through triangles of a leaf: one bit for each, one for each that it surely does, and the meeting and the lane.
    hits: Vec<u64>,
    pierced: usize,
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
        let place = (hit >> (2 * LANES)) as usize;
        let meeting = &self.meetings[place / LANES];
        let triangles = |bits: u64| bits as u32 & ((1 << LANES) - 1);
        let (maybe, surely) = (triangles(hit), triangles(hit >> LANES));
        let (block, lane) = (usize::from(meeting.block), place % LANES);
        Hit { leaf: meeting.leaf, block, lane, maybe, surely }
    }

    /// Takes the edges of a leaf that may run through a face. Gives how far the body may travel before others may, too.
    #[inline(always)]
    pub(super) fn take<S: Simd>(
        &mut self,
        frame: &Frame<'_, S>,
        edges: &mut Edges,
        side: &Side,
        leaf: u32,
        rows: &mut Rows,
    ) -> f32 {
        let (count, spare) = rows.take(frame, edges, side, leaf);
        self.append(frame, leaf, count, rows);
        spare
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
        let mut apart = Lanes::splat(frame.simd, f32::INFINITY);
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
                meeting_lanes[met] = lanes as u16;
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
            meeting.triangles = ((1u32 << leaves[meeting.leaf as usize].triangles) - 1) as u16;
        }
    }

    /// Lists which segments may run through which triangles.
    #[inline(always)]
    pub(super) fn pierce<S: Simd>(&mut self, frame: &Frame<'_, S>) {
        self.refine(frame);
        self.meeting_lanes[self.met..].iter_mut().take(GROUP).for_each(|lanes| *lanes = 0);
        let (words, _) = self.meeting_lanes.as_chunks::<GROUP>();
        let (groups, _) = self.meetings.as_chunks::<GROUP>();
        let (segments, blocks) = (self.segments.as_slice(), frame.other.blocks.as_slice());
        let mut count = 0;
        let words = words.iter().zip(groups).take(self.met.div_ceil(GROUP));
        for (number, (word, meetings)) in words.enumerate() {
            if self.hits.len() < count + WORD {
                self.hits.resize(2 * count + WORD, 0);
            }
            let Some(hits) = self.hits[count..].first_chunk_mut::<WORD>() else { continue };
            let mut rest = word.iter().rev().fold(0, |bits, &lanes| bits << LANES | u64::from(lanes));
            let mut own = 0;
            while rest != 0 {
                let bit = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let (meeting, lane) = (&meetings[bit / LANES % GROUP], bit % LANES);
                let segments = &segments[usize::from(meeting.block)];
                let block = &blocks[meeting.leaf as usize];
                let [maybe, surely] = pierced(frame.simd, segments, lane, block, meeting);
                let triangles = u32::from(meeting.triangles);
                let (maybe, surely) = (maybe & triangles, surely & triangles);
                hits[own % WORD] = ((number * WORD + bit) as u64) << (2 * LANES)
                    | u64::from(surely) << LANES
                    | u64::from(maybe);
                own += usize::from(maybe != 0);
            }
            count += own;
        }
        self.pierced = count;
    }
}

/// Bit `i` of the first number is set when a segment that meets the bounds of a leaf may run through triangle `i` of its block, and of the
/// second when it surely does.
///
/// About the leaf's origin the segment is off by less than 70 roundings of its own leaf's radius (turned start and vector, as for its place),
/// which is what the error of that leaf's block covers. A height over a plane adds six roundings of the leaf's radius and five of the
/// segment's distance. As the segment meets the leaf's box, its coordinates are less than three radii and its own length off the origin, so
/// that six times the error of the one block and four times that of the other bound all of it several times over. Where the segment meets
/// a plane is then off by no more than its length times the error over the slope, and by the error beside that: twice both is the margin.
/// The exact test is certain to a millionth of the slack, which is in the error, too.
#[inline(always)]
fn pierced<S: Simd>(
    simd: S,
    segments: &Segments,
    lane: usize,
    b: &TriangleBlock,
    meeting: &Meeting,
) -> [u32; 2] {
    let lane = lane % LANES;
    let size = segments.size[lane];
    let error = meeting.error;
    let along = [segments.along[0][lane], segments.along[1][lane], segments.along[2][lane]];
    let d = splat(simd, along);
    let mut from = d;
    for k in 0..3 {
        from[k] = Lanes::splat(simd, segments.start[k][lane] + meeting.from[k]) - lanes(simd, &b.corner[k]);
    }
    let normal = lanes_of(simd, &b.normal);
    let (z, dz) = (dot(normal, from), dot(normal, d));
    let to_z = z + dz;
    let (low, high) = (z.min(to_z), z.max(to_z));
    // Where the segment is almost in the plane the share of it is uncertain, and infinite or not a number in it.
    let inverse = Lanes::splat(simd, 1.0) / dz;
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
