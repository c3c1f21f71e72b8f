//! What a query finds out about one of the two surfaces.

use crate::surface::Surface;

/// Vertices whose results lie together. Near vertices have close numbers, so few pages are ever used.
const PAGE: usize = 64;

/// Per-vertex results on one surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Side {
    /// By page of vertices: where its results are, plus one; zero when none of its vertices has any.
    pages: Vec<u32>,
    results: Vec<Page>,
    /// One bit a vertex: whether it has a signed distance now. Most that are asked for have none, and this fits the nearest cache.
    known: Vec<u64>,
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

#[derive(Clone, Debug)]
struct Page {
    /// Signed distance to the other surface, where one is known.
    signed: [f64; PAGE],
    /// The leaf of the other surface that was closest in the last query, plus one.
    last: [u32; PAGE],
}

impl Side {
    /// Forgets everything and makes room for a surface.
    pub(super) fn reset(&mut self, surface: &Surface) {
        self.found.clear();
        self.results.clear();
        self.pages.clear();
        self.pages.resize(surface.vertices.len().div_ceil(PAGE), 0);
        self.known.clear();
        self.known.resize(self.pages.len(), 0);
    }

    /// Forgets the distances of the last query, at a cost in proportion to what it found.
    pub(super) fn clear(&mut self) {
        for &vertex in &self.found {
            self.known[vertex as usize / PAGE] = 0;
        }
        self.found.clear();
    }

    /// Vertices with a signed distance, in the order found.
    pub(super) fn found(&self) -> &[u32] {
        &self.found
    }

    #[inline(always)]
    fn page(&self, vertex: u32) -> Option<&Page> {
        let page = self.pages[vertex as usize / PAGE].checked_sub(1)?;
        self.results.get(page as usize)
    }

    /// Signed distance of a vertex to the other surface, infinite when farther than the tolerance.
    #[inline(always)]
    pub(super) fn signed_distance(&self, vertex: u32) -> f64 {
        if self.known[vertex as usize / PAGE] >> (vertex as usize % PAGE) & 1 == 0 {
            return f64::INFINITY;
        }
        self.page(vertex).map_or(f64::INFINITY, |page| page.signed[vertex as usize % PAGE])
    }

    /// The leaf of the other surface that was closest when last asked, a first guess for the next time.
    #[inline(always)]
    pub(super) fn last_leaf(&self, vertex: u32) -> Option<u32> {
        self.page(vertex).and_then(|page| page.last[vertex as usize % PAGE].checked_sub(1))
    }

    /// Notes the signed distance of a vertex and the leaf where it was found.
    #[inline(always)]
    pub(super) fn set(&mut self, vertex: u32, signed_distance: f64, leaf: u32) {
        let place = &mut self.pages[vertex as usize / PAGE];
        if *place == 0 {
            self.results.push(Page { signed: [f64::INFINITY; PAGE], last: [0; PAGE] });
            *place = self.results.len() as u32;
        }
        let page = &mut self.results[*place as usize - 1];
        page.signed[vertex as usize % PAGE] = signed_distance;
        page.last[vertex as usize % PAGE] = leaf + 1;
        self.known[vertex as usize / PAGE] |= 1 << (vertex as usize % PAGE);
        self.found.push(vertex);
    }
}
