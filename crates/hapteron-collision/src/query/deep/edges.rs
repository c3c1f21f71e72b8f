//! All edges of the leaves that queries have come across, made ready for sixteen at once, and what is known of their ends.

use crate::query::side::Side;
use crate::surface::{LANES, Surface};
use std::ops::Range;

/// Numbers by index, zero where none has been set; near ones are often set together, and most never.
#[derive(Clone, Debug, Default)]
struct Sparse {
    /// By page of indices: where its numbers are, plus one; zero when none has been set.
    pages: Vec<u32>,
    numbers: Vec<[u32; PAGE]>,
}

const PAGE: usize = 64;

impl Sparse {
    fn reset(&mut self, indices: usize) {
        self.numbers.clear();
        self.pages.clear();
        self.pages.resize(indices.div_ceil(PAGE), 0);
    }

    #[inline(always)]
    fn get(&self, index: u32) -> u32 {
        match self.pages[index as usize / PAGE] {
            0 => 0,
            page => self.numbers[page as usize - 1][index as usize % PAGE],
        }
    }

    #[inline(always)]
    fn set(&mut self, index: u32, number: u32) {
        let page = &mut self.pages[index as usize / PAGE];
        if *page == 0 {
            self.numbers.push([0; PAGE]);
            *page = self.numbers.len() as u32;
        }
        self.numbers[*page as usize - 1][index as usize % PAGE] = number;
    }
}

/// Up to sixteen edges of a leaf about its origin, as a start and a vector to the end, by axis and lane, with the places of their vertices.
/// Lanes without an edge have the vertices of the block's first edge and no length.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct EdgeBlock {
    pub start: [[f32; LANES]; 3],
    pub along: [[f32; LANES]; 3],
    pub places: [[u32; LANES]; 2],
}

/// The edges of a leaf.
#[inline(always)]
pub(super) fn edges_of(surface: &Surface, index: u32) -> Range<u32> {
    let next = surface.leaves.get(index as usize + 1);
    let end = next.map_or(surface.edges.len() as u32, |next| next.first_edge);
    surface.leaves[index as usize].first_edge..end
}

/// The edges of one surface, and what a query knows of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Edges {
    /// Which surface that is.
    identity: Option<u64>,
    blocks: Vec<EdgeBlock>,
    /// By leaf: where its blocks begin, plus one; zero when nobody has asked for them.
    begin: Sparse,
    /// By vertex: its place in the next list, plus one; zero when it is at no edge of those leaves.
    places: Sparse,
    /// A lower bound of the distance to the other surface, negative inside; zero when it is not known.
    known: Vec<f32>,
    /// One bit an edge: its far end is known, or known to lie on the other side.
    settled: Vec<u64>,
}

impl Edges {
    /// Makes room for a surface of which so many leaves are to be looked at.
    pub(super) fn expect(&mut self, surface: &Surface, leaves: usize) {
        if self.identity == Some(surface.identity) {
            return;
        }
        self.identity = Some(surface.identity);
        self.blocks.clear();
        self.blocks.reserve(2 * leaves + leaves / 4);
        self.begin.reset(surface.leaves.len());
        self.places.reset(surface.vertices.len());
        self.begin.numbers.reserve(leaves.min(4));
        self.places.numbers.reserve(leaves);
        self.known.clear();
        self.known.reserve(8 * leaves);
        self.settled.clear();
        self.settled.resize(surface.edges.len() / 64 + 2, 0);
    }

    /// Takes what is known of the vertices, and appends those that are inside to `open`.
    #[inline(always)]
    pub(super) fn take(&mut self, side: &Side, tolerance: f64, open: &mut Vec<u32>) {
        let found = side.found();
        open.clear();
        open.resize(found.len(), 0);
        let mut count = 0;
        for &vertex in found {
            let signed_distance = side.signed_distance(vertex);
            self.set(vertex, signed_distance, tolerance);
            // Never beyond the vertices looked at.
            if let Some(place) = open.get_mut(count) {
                *place = vertex;
            }
            count += usize::from(signed_distance < 0.0);
        }
        open.truncate(count);
    }

    /// Notes the distance of a vertex.
    #[inline(always)]
    pub(super) fn set(&mut self, vertex: u32, signed_distance: f64, tolerance: f64) {
        if let Some(place) = (self.places.get(vertex) as usize).checked_sub(1) {
            self.known[place] = lower(signed_distance, tolerance);
        }
    }

    /// The distance of the vertex at a place, zero when that is not known.
    #[inline(always)]
    pub(super) fn distance(&self, place: u32) -> f32 {
        self.known[place as usize]
    }

    /// Marks edges of a leaf, by one bit each from the first.
    #[inline(always)]
    pub(super) fn settle(&mut self, first: u32, edges: u64) {
        let (word, bit) = (first as usize / 64, first % 64);
        let bits = u128::from(edges) << bit;
        self.settled[word] |= bits as u64;
        self.settled[word + 1] |= (bits >> 64) as u64;
    }

    /// Marks an edge that was not, or the other way round, when the last bit is set.
    #[inline(always)]
    pub(super) fn toggle(&mut self, edge: u32, odd: u32) {
        self.settled[edge as usize / 64] ^= u64::from(odd) << (edge % 64);
    }

    #[inline(always)]
    pub(super) fn is_settled(&self, edge: u32) -> bool {
        self.settled[edge as usize / 64] >> (edge % 64) & 1 == 1
    }

    /// Forgets what was noted of these vertices and of the edges of a leaf.
    #[inline(always)]
    pub(super) fn forget(&mut self, vertices: &[u32], leaves: impl Iterator<Item = u32>, surface: &Surface) {
        for &vertex in vertices {
            if let Some(place) = (self.places.get(vertex) as usize).checked_sub(1) {
                self.known[place] = 0.0;
            }
        }
        for leaf in leaves {
            let word = surface.leaves[leaf as usize].first_edge as usize / 64;
            self.settled[word] = 0;
            self.settled[word + 1] = 0;
        }
    }

    /// Where the blocks of a leaf are.
    #[inline(always)]
    pub(super) fn of(&mut self, surface: &Surface, index: u32, side: &Side, tolerance: f64) -> Range<usize> {
        let begin = match self.begin.get(index) {
            0 => self.gather(surface, index, side, tolerance),
            known => known as usize - 1,
        };
        begin..begin + edges_of(surface, index).len().div_ceil(LANES)
    }

    #[inline(always)]
    pub(super) fn block(&self, index: usize) -> &EdgeBlock {
        &self.blocks[index]
    }

    fn gather(&mut self, surface: &Surface, index: u32, side: &Side, tolerance: f64) -> usize {
        let begin = self.blocks.len();
        self.begin.set(index, begin as u32 + 1);
        let origin = surface.blocks[index as usize].origin.map(f64::from);
        let range = edges_of(surface, index);
        for some in surface.edges[range.start as usize..range.end as usize].chunks(LANES) {
            let (mut start, mut along) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            let mut places = [[0; LANES]; 2];
            for (lane, edge) in some.iter().enumerate() {
                let [a, b] = edge.vertices.map(|v| &surface.vertices[v as usize]);
                for k in 0..3 {
                    start[k][lane] = (a[k] - origin[k]) as f32;
                    along[k][lane] = (b[k] - a[k]) as f32;
                }
                for k in 0..2 {
                    places[k][lane] = self.place(edge.vertices[k], side, tolerance);
                }
            }
            for places in &mut places {
                let first = places[0];
                places[some.len()..].fill(first);
            }
            let block = EdgeBlock { start, along, places };
            self.blocks.push(block);
        }
        begin
    }

    /// The place of a vertex, a new one with what is known of it if it has none.
    #[inline(always)]
    fn place(&mut self, vertex: u32, side: &Side, tolerance: f64) -> u32 {
        if let Some(place) = self.places.get(vertex).checked_sub(1) {
            return place;
        }
        let signed_distance = side.signed_distance(vertex);
        let known = if signed_distance.is_finite() { lower(signed_distance, tolerance) } else { 0.0 };
        self.known.push(known);
        self.places.set(vertex, self.known.len() as u32);
        self.known.len() as u32 - 1
    }
}

/// A number that is a little less than the distance or the tolerance, with the sign of the distance, and not zero.
#[inline(always)]
fn lower(signed_distance: f64, tolerance: f64) -> f32 {
    let lower = (signed_distance.abs().min(tolerance) * ROUNDED_DOWN) as f32;
    let lower = lower.max(f32::MIN_POSITIVE);
    if signed_distance < 0.0 { -lower } else { lower }
}

/// One bit for each lane of block number `index` of so many edges that has one.
#[inline(always)]
pub(super) fn filled(edges: usize, index: usize) -> u32 {
    (1 << (edges - index * LANES).min(LANES)) - 1
}

/// Makes a positive number in double precision smaller by more than what rounding it to single precision adds.
pub(super) const ROUNDED_DOWN: f64 = 1.0 - 1e-6;
