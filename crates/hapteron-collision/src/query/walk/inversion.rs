//! Pairs of leaves listed from the other side.

use super::{Neighbourhood, Pairs};

/// Memory for listing pairs by leaf of the obstacle; all zero between two uses, so that only what is near costs time.
#[derive(Clone, Debug, Default)]
pub(super) struct Inversion {
    /// By leaf: how often it occurs, then where its next pair goes.
    counts: Vec<u32>,
    /// One bit a leaf: whether it occurs.
    occurs: Vec<u64>,
}

impl Inversion {
    /// The same pairs by leaf of the obstacle, in the order of its leaves.
    #[inline(always)]
    pub(super) fn invert(&mut self, pairs: &mut Pairs, leaves: usize) {
        let Pairs { body, obstacle } = pairs;
        self.counts.resize(leaves, 0);
        self.occurs.resize(leaves.div_ceil(64), 0);
        for &other in &body.near {
            self.counts[other as usize] += 1;
            self.occurs[other as usize / 64] |= 1 << (other % 64);
        }
        obstacle.of.clear();
        let mut begin = 0;
        for (word, occurs) in self.occurs.iter_mut().enumerate() {
            let mut bits = std::mem::take(occurs);
            while bits != 0 {
                let leaf = 64 * word as u32 + bits.trailing_zeros();
                bits &= bits - 1;
                let end = begin + std::mem::replace(&mut self.counts[leaf as usize], begin);
                obstacle.of.push(Neighbourhood { leaf, begin, end });
                begin = end;
            }
        }
        obstacle.near.clear();
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
