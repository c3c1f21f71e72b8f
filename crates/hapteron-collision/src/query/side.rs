//! What a query finds out about one of the two surfaces.

use crate::surface::{LANES, Surface};

/// Vertices whose results lie together. Near vertices have close numbers, so few pages are ever used.
const PAGE: usize = 64;

/// Per-vertex results on one surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Side {
    /// By page of vertices: where its results are; zero, where no vertex has any, when none of its vertices does.
    pages: Vec<u32>,
    /// Signed distances to the other surface, infinite where none is known.
    signed: Vec<[f64; PAGE]>,
    /// The leaves of the other surface that were closest when last asked, plus one.
    last: Vec<[u32; PAGE]>,
    /// Vertices with a signed distance, in the order found.
    found: Vec<u32>,
    /// By neighbourhood of the last walk.
    pub clear: Vec<Clear>,
}

/// How far the body must have travelled before something can come within a distance: a lower bound of the distance when it
/// was last looked at, plus what the body had travelled by then. While that is less, there is no need to look.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clear(f64);

impl Clear {
    pub(super) const UNKNOWN: Self = Self(f64::NEG_INFINITY);

    #[inline(always)]
    pub(super) fn new(lower: f64, travelled: f64) -> Self {
        Self(lower + travelled)
    }

    /// True when nothing can be closer than `distance` now.
    #[inline(always)]
    pub(super) fn holds(self, travelled: f64, distance: f64) -> bool {
        self.0 - travelled >= distance
    }
}

impl Side {
    /// Forgets everything and makes room for a surface.
    pub(super) fn reset(&mut self, surface: &Surface) {
        self.found.clear();
        self.signed.clear();
        self.signed.push([f64::INFINITY; PAGE]);
        self.last.clear();
        self.last.push([0; PAGE]);
        self.pages.clear();
        self.pages.resize(surface.vertices.len().div_ceil(PAGE), 0);
    }

    /// Forgets the distances of the last query, at a cost in proportion to what it found.
    pub(super) fn clear(&mut self) {
        for &vertex in &self.found {
            let page = self.pages[vertex as usize / PAGE] as usize;
            self.signed[page][vertex as usize % PAGE] = f64::INFINITY;
        }
        self.found.clear();
    }

    /// Vertices with a signed distance, in the order found.
    pub(super) fn found(&self) -> &[u32] {
        &self.found
    }

    /// Signed distance of a vertex to the other surface, infinite when farther than the tolerance.
    #[inline(always)]
    pub(super) fn signed_distance(&self, vertex: u32) -> f64 {
        let page = self.pages[vertex as usize / PAGE] as usize;
        self.signed[page][vertex as usize % PAGE]
    }

    /// For some vertices in a row, the leaves of the other surface that were closest when last asked, plus one: first guesses for the next time.
    #[inline(always)]
    pub(super) fn last_leaves(&self, first: u32, count: usize) -> [u32; LANES] {
        let mut result = [0; LANES];
        for (vertex, last) in (first as usize..).zip(result.iter_mut().take(count)) {
            *last = self.last[self.pages[vertex / PAGE] as usize][vertex % PAGE];
        }
        result
    }

    /// Notes the signed distance of a vertex and the leaf where it was found.
    #[inline(always)]
    pub(super) fn set(&mut self, vertex: u32, signed_distance: f64, leaf: u32) {
        let page = &mut self.pages[vertex as usize / PAGE];
        if *page == 0 {
            *page = self.signed.len() as u32;
            self.signed.push([f64::INFINITY; PAGE]);
            self.last.push([0; PAGE]);
        }
        let page = *page as usize;
        self.signed[page][vertex as usize % PAGE] = signed_distance;
        self.last[page][vertex as usize % PAGE] = leaf + 1;
        self.found.push(vertex);
    }
}
