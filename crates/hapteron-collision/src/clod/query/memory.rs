//! What is remembered of the vertices of a surface.

use super::held::Held;
use super::known::{Known, Looks};
use super::plan::Planned;
use super::side::Search;
use crate::clod::nearest::NOWHERE;
use crate::surface::Surface;
use crate::vector::Vec3;

/// What is known of the vertices of a surface, in pages: only those near the other surface are ever looked at, and near vertices have
/// close numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    /// By page of vertices: where it is, plus one; zero as long as none of its vertices was looked at.
    pages: Vec<u32>,
    known: Vec<Known>,
    /// By place a lower bound of the distance of the vertex, plus what the surfaces had moved by then in all; more often asked for than all the rest.
    pub clear: Vec<f64>,
    /// By place where the triangles that are held for the vertex are, plus one; zero where there are none.
    held_at: Vec<u32>,
    held: Vec<Held>,
}

/// Vertices in a page.
const PAGE: usize = 32;

impl Memory {
    /// Forgets everything and makes room for a surface.
    pub(super) fn new(surface: &Surface) -> Self {
        Self { pages: vec![0; surface.vertices.len().div_ceil(PAGE)], ..Self::default() }
    }

    /// Where a vertex has its place.
    #[inline(always)]
    pub(super) fn place(&mut self, vertex: u32) -> usize {
        let page = vertex as usize / PAGE;
        if self.pages[page] == 0 {
            let size = self.known.len() + PAGE;
            self.known.resize(size, Known::UNKNOWN);
            self.clear.resize(size, f64::NEG_INFINITY);
            self.held_at.resize(size, 0);
            self.pages[page] = (self.known.len() / PAGE) as u32;
        }
        (self.pages[page] as usize - 1) * PAGE + vertex as usize % PAGE
    }

    #[inline(always)]
    pub(super) fn at(&mut self, place: usize) -> &mut Known {
        &mut self.known[place]
    }

    /// Where the triangles of the vertex with this place are held, when they are.
    #[inline(always)]
    pub(super) fn held_at(&self, place: usize) -> u32 {
        self.held_at[place]
    }

    #[inline(always)]
    pub(super) fn held(&mut self, held_at: u32) -> Option<&mut Held> {
        self.held.get_mut((held_at as usize).wrapping_sub(1))
    }

    /// Puts what is held for some samples into their order, so that it comes from memory one after the other; forgets all else that is held.
    pub(super) fn arrange(&mut self, samples: &[Planned], held_at: &mut [u32]) {
        let mut held = Vec::with_capacity(samples.len());
        self.held_at.fill(0);
        for (sample, at) in samples.iter().zip(held_at) {
            let Some(own) = self.held.get((*at as usize).wrapping_sub(1)) else { continue };
            held.push(own.clone());
            *at = held.len() as u32;
            self.held_at[sample.place] = *at;
        }
        self.held = held;
    }

    /// Holds the triangles around the vertex at `p`, within `reach`, whose foot was found; gives where.
    #[inline(always)]
    pub(super) fn hold(
        &mut self,
        place: usize,
        p: Vec3,
        search: &Search<'_>,
        reach: f64,
        looks: &mut Looks,
    ) -> u32 {
        let known = &self.known[place];
        let other = search.other;
        let closest = known.closest(p, search, reach, looks);
        let triangle = known.triangle;
        if triangle == NOWHERE {
            return 0;
        }
        let at = &mut self.held_at[place];
        if *at == 0 {
            self.held.push(Held::NOTHING);
            *at = self.held.len() as u32;
        }
        self.held[*at as usize - 1].renew(p, triangle, &closest, other);
        *at
    }
}
