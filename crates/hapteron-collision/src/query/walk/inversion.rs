//! Pairs of leaves listed from the other side.

use super::super::kernel::{LaneNumbers, bits};
use super::lists::{Neighbourhood, Pairs};
use crate::surface::LANES;
use fearless_simd::{Simd, prelude::*};

/// Leaves in a page: as many as there are bits in a word.
const PAGE: usize = 64;

/// Memory for listing pairs by leaf of the obstacle; all zero between two uses, so that only what is near costs time.
#[derive(Clone, Debug, Default)]
pub(super) struct Inversion {
    /// By leaf, in whole pages: how often it occurs, then where its next pair goes.
    counts: Vec<u32>,
    /// By page: whether any of its leaves occurs.
    occurs: Vec<bool>,
}

impl Inversion {
    /// The same pairs by leaf of the obstacle, in the order of its leaves.
    #[inline(always)]
    pub(super) fn invert<S: Simd>(&mut self, simd: S, pairs: &mut Pairs, leaves: usize) {
        let Pairs { body, obstacle } = pairs;
        self.counts.resize(leaves.next_multiple_of(PAGE), 0);
        self.occurs.resize(leaves.div_ceil(PAGE), false);
        for &other in &body.near {
            self.counts[other as usize] += 1;
            self.occurs[other as usize / PAGE] = true;
        }
        obstacle.of.clear();
        let mut begin = 0;
        let pages = self.counts.as_chunks_mut::<PAGE>().0.iter_mut().enumerate();
        for ((number, counts), occurs) in pages.zip(&mut self.occurs) {
            if !std::mem::take(occurs) {
                continue;
            }
            let mut some = occurring(simd, counts);
            while some != 0 {
                let place = some.trailing_zeros();
                some &= some - 1;
                let end = begin + std::mem::replace(&mut counts[place as usize % PAGE], begin);
                obstacle.of.push(Neighbourhood { leaf: (number * PAGE) as u32 + place, begin, end });
                begin = end;
            }
        }
        obstacle.near.resize(body.near.len(), 0);
        for &Neighbourhood { leaf, begin, end } in &body.of {
            for &other in &body.near[begin as usize..end as usize] {
                let place = &mut self.counts[other as usize];
                obstacle.near[*place as usize] = leaf;
                *place += 1;
            }
        }
        for of in &obstacle.of {
            self.counts[of.leaf as usize] = 0;
        }
    }
}

/// One bit a leaf of a page: whether it occurs.
#[inline(always)]
fn occurring<S: Simd>(simd: S, counts: &[u32; PAGE]) -> u64 {
    let mut result = 0;
    for (number, counts) in counts.as_chunks::<LANES>().0.iter().enumerate() {
        let some = LaneNumbers::load_array_ref(simd, counts).simd_gt(0);
        result |= u64::from(bits(some)) << (LANES * number);
    }
    result
}
