//! Which pairs of edges may touch: many at a time, in stages that each are a simple loop over a flat list.

use super::kernel::{Lanes, bits, lanes};
use super::ridge_kernel::{Margins, MovedRidges, Segments, meeting};
use super::ridge_store::{About, Place, RidgeBlock, RidgeStore};
use crate::surface::{LANES, Surface};
use core::hint::select_unpredictable;
use fearless_simd::{Simd, prelude::*};

/// Blocks of the body that are worked on at a time: few enough for the nearest cache.
const BATCH: usize = 16;
/// Blocks of a leaf: sixteen triangles have no more edges than that.
const MOST_BLOCKS: usize = 3;

/// An edge of the body and one of the obstacle that may touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub edges: [u32; 2],
    /// Whether they may have passed each other: those lie in leaves that overlap.
    pub overlap: bool,
}

/// A block of the body and one of the obstacle: which edges of the first are near the leaf of the second, and which of them overlap it.
/// All in one number, as one is written for every pair of leaves and most of them are then passed over.
#[derive(Clone, Copy, Debug, Default)]
struct Work(u64);

impl Work {
    /// Where in the number the near edges, the overlapping ones and the own block begin; the other block comes first.
    const NEAR: usize = 28;
    const OVERLAP: usize = Self::NEAR + LANES;
    const OWN: usize = Self::OVERLAP + LANES;
    const EDGES: u64 = (1 << LANES) - 1;

    #[inline(always)]
    fn new(own: usize, near: u32, overlap: u32, other: u32) -> Self {
        Self(
            (own as u64) << Self::OWN
                | u64::from(overlap) << Self::OVERLAP
                | u64::from(near) << Self::NEAR
                | u64::from(other),
        )
    }

    /// The same with a block of the obstacle further on.
    #[inline(always)]
    fn after(self, blocks: u64) -> Self {
        Self(self.0 + blocks)
    }

    #[inline(always)]
    fn own(self) -> usize {
        (self.0 >> Self::OWN) as usize
    }

    #[inline(always)]
    fn near(self) -> u32 {
        (self.0 >> Self::NEAR & Self::EDGES) as u32
    }

    #[inline(always)]
    fn overlap(self) -> u32 {
        (self.0 >> Self::OVERLAP & Self::EDGES) as u32
    }

    /// The same for some of the near edges only.
    #[inline(always)]
    fn only(self, mask: u32) -> Self {
        Self(self.0 & !(Self::EDGES << Self::NEAR) | u64::from(self.near() & mask) << Self::NEAR)
    }

    #[inline(always)]
    fn overlaps(self, lane: usize) -> bool {
        self.0 >> (Self::OVERLAP + lane) & 1 == 1
    }

    #[inline(always)]
    fn other(self) -> usize {
        (self.0 & ((1 << Self::NEAR) - 1)) as usize
    }
}

const _: () = assert!(BATCH.ilog2() as usize + Work::OWN <= 64, "a number of a block of the body fits");

/// Blocks of the body in the obstacle's frame, what they are to be compared with, and what came of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Batch {
    own: Vec<MovedRidges>,
    used: usize,
    work: Vec<Work>,
    /// How much of the list is in use; there always is more.
    filled: usize,
    /// Distances of the edges of the last block from the leaves near it.
    apart: Vec<[f32; LANES]>,
    /// Which of the leaves are closer to some of the edges than their limits, and in the lowest bits, to which.
    close: Vec<u64>,
    pub found: Vec<Candidate>,
}

impl Batch {
    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        (self.used, self.filled) = (0, 0);
        self.found.clear();
    }

    /// True when [`Batch::meet`] must be called before anything is added.
    #[inline(always)]
    pub(super) fn full(&self) -> bool {
        self.used >= BATCH
    }

    /// Where the next block of the body comes.
    #[inline(always)]
    pub(super) fn own(&mut self) -> &mut MovedRidges {
        if self.own.len() == self.used {
            self.own.push(MovedRidges::EMPTY);
        }
        &mut self.own[self.used]
    }

    /// Notes how far edges are from leaves of the obstacle. Gives the least of the distances, rounding aside.
    #[inline(always)]
    pub(super) fn measure<S: Simd>(
        &mut self,
        simd: S,
        edges: &Segments<S>,
        obstacle: &Surface,
        near: &[u32],
    ) -> f32 {
        if self.apart.len() < near.len() {
            self.apart.resize(near.len(), [0.0; LANES]);
        }
        let mut least = Lanes::splat(simd, f32::INFINITY);
        for (&other, apart) in near.iter().zip(&mut self.apart) {
            let own = edges.apart(&obstacle.leaves[other as usize]);
            *apart = own.to_array();
            least = least.min(own);
        }
        least.reduce_min()
    }

    /// Takes the edges that were just measured, if they are closer to a leaf than their limits.
    #[inline(always)]
    pub(super) fn add<S: Simd>(
        &mut self,
        simd: S,
        slack: f32,
        obstacle: &Surface,
        near: &[u32],
        store: &mut RidgeStore,
    ) {
        let Self { own, used, work, filled, apart, close, .. } = self;
        let limit = lanes(simd, &own[*used].within) + slack;
        // Everything is written, and what is wanted kept: which that is would be too hard to foretell for branches.
        if close.len() <= near.len() {
            close.resize(near.len() + 1, 0);
        }
        let mut count = 0;
        for (i, apart) in apart[..near.len()].iter().enumerate() {
            let mask = bits(lanes(simd, apart).simd_le(limit));
            close[count] = (i as u64) << LANES | u64::from(mask);
            count += usize::from(mask != 0);
        }
        let room = *filled + MOST_BLOCKS * (count + 1);
        if work.len() < room {
            work.resize(room, Work::default());
        }
        let cones = own[*used].cones(simd);
        let mut end = *filled;
        for &close in &close[..count] {
            let i = (close >> LANES) as usize;
            let leaf = near[i];
            let mask = close as u32 & cones.face(&obstacle.leaves[leaf as usize].ridge_cone);
            let mut place = store.places[leaf as usize];
            if place == Place::UNKNOWN && mask != 0 {
                place = store.gather(simd, obstacle, leaf, About::Mesh);
            }
            let overlap = bits(lanes(simd, &apart[i]).simd_le(slack));
            let item = Work::new(*used, mask, overlap, place.begin());
            let Some(next) = work[end..].first_chunk_mut::<MOST_BLOCKS>() else { break };
            *next = [item, item.after(1), item.after(2)];
            end += place.count() * usize::from(mask != 0);
        }
        *filled = end;
        *used += 1;
    }

    /// Finds the pairs of edges that may touch among all that was added, and makes room for more.
    #[inline(always)]
    pub(super) fn meet<S: Simd>(&mut self, simd: S, others: &[RidgeBlock], margins: &Margins) {
        let Self { own, used, work, filled, found, .. } = self;
        if let Some(work) = work.get_mut(..=*filled) {
            // A function of its own: the loop needs all registers.
            simd.vectorize(
                #[inline(always)]
                || {
                    let count = sift(simd, own, work, others, margins);
                    meet_all(simd, own, &work[..=count], others, margins, found);
                },
            );
        }
        (*used, *filled) = (0, 0);
    }
}

/// Keeps of all but the last of the work what the boxes of the edges say is needed, at the beginning of the list. Gives how much that is.
#[inline(always)]
fn sift<S: Simd>(
    simd: S,
    own: &[MovedRidges],
    work: &mut [Work],
    others: &[RidgeBlock],
    margins: &Margins,
) -> usize {
    let margins = *margins;
    let mut count = 0;
    for i in 0..work.len() - 1 {
        let item = work[i];
        let [outside, within] = own[item.own()].close_to(simd, &others[item.other()], &margins);
        let item = item.only(outside | within & item.overlap());
        work[count] = item;
        count += usize::from(item.near() != 0);
    }
    count
}

/// The pairs of edges that may touch among all but the last of the work.
#[inline(always)]
fn meet_all<S: Simd>(
    simd: S,
    own: &[MovedRidges],
    work: &[Work],
    others: &[RidgeBlock],
    margins: &Margins,
    found: &mut Vec<Candidate>,
) {
    let margins = *margins;
    let end = work.len() - 1;
    let mut at = 0;
    let mut mask = work[0].near();
    while at < end {
        let item = work[at];
        let lane = mask.trailing_zeros() as usize % LANES;
        let (own, other) = (&own[item.own()], &others[item.other()]);
        let mut hits = meeting(simd, own, lane, item.overlaps(lane), other, &margins);
        // On to the next edge, without a branch for whether it is of the same block.
        let rest = mask & mask.wrapping_sub(1);
        at += usize::from(rest == 0);
        mask = select_unpredictable(rest == 0, work[at].near(), rest);
        while hits != 0 {
            let edges = [own.first + lane as u32, other.first + hits.trailing_zeros()];
            hits &= hits - 1;
            found.push(Candidate { edges, overlap: item.overlaps(lane) });
        }
    }
}
