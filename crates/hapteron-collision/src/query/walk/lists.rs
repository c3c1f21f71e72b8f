//! Lists of near leaves.

use super::super::kernel::{LaneMask, LaneNumbers, bits};
use crate::surface::LANES;
use fearless_simd::{Simd, prelude::*};

/// A leaf with the leaves of the other surface that come close to it, a range of a list.
#[derive(Clone, Copy, Debug)]
pub(in crate::query) struct Neighbourhood {
    pub leaf: u32,
    pub begin: u32,
    pub end: u32,
}

/// Leaves of one surface with those of the other that are near, in a fixed order of the first.
#[derive(Clone, Debug, Default)]
pub(in crate::query) struct Neighbours {
    pub of: Vec<Neighbourhood>,
    pub near: Vec<u32>,
}

/// Pairs of leaves, from both sides.
#[derive(Clone, Debug, Default)]
pub(in crate::query) struct Pairs {
    pub body: Neighbours,
    pub obstacle: Neighbours,
}

/// The end of a list of near leaves that grows by up to as many as there are lanes at a time.
pub(super) struct List<'a> {
    near: &'a mut [u32],
    pub len: usize,
}

impl List<'_> {
    /// Appends the leaves in the lanes that the mask says.
    #[inline(always)]
    pub(super) fn append<S: Simd>(&mut self, leaves: LaneNumbers<S>, mask: LaneMask<S>) {
        leaves.compress(mask).store_slice(&mut self.near[self.len..self.len + LANES]);
        self.len += bits(mask).count_ones() as usize;
    }
}

impl Neighbours {
    /// Makes room for so many leaves more.
    #[inline(always)]
    pub(super) fn reserve(&mut self, more: usize) {
        let least = self.len() + more + LANES;
        if self.near.len() < least {
            self.near.resize(2 * least, 0);
        }
    }

    /// Length of the list, behind which is free room.
    #[inline(always)]
    fn len(&self) -> usize {
        self.of.last().map_or(0, |of| of.end as usize)
    }

    /// The end of the list.
    #[inline(always)]
    pub(super) fn list(&mut self) -> List<'_> {
        let len = self.len();
        List { near: &mut self.near, len }
    }

    /// Ends the list of a leaf that began where the one before it ended.
    #[inline(always)]
    pub(super) fn end(&mut self, leaf: u32, end: usize) {
        let begin = self.len();
        if begin != end {
            self.of.push(Neighbourhood { leaf, begin: begin as u32, end: end as u32 });
        }
    }

    /// Cuts off what was made room for.
    pub(super) fn finish(&mut self) {
        self.near.truncate(self.len());
    }
}
