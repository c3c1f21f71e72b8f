//! All edges of the leaves that queries have come across, made ready for eight at once, and what is known of their ends.

use crate::query::side::Side;
use crate::surface::{LANES, Surface};
use std::ops::Range;

/// Up to eight edges of a leaf about its origin, as a start and a vector to the end, by axis and lane, with their vertices. Lanes without an
/// edge have one without length at the first vertex of the leaf's first edge.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct EdgeBlock {
    pub start: [[f32; LANES]; 3],
    pub along: [[f32; LANES]; 3],
    pub vertices: [[u32; LANES]; 2],
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
    begin: Vec<u32>,
    /// By vertex: a lower bound of its distance to the other surface, negative inside; zero when it is not known.
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
        // Zeros that nobody touches cost nothing this way.
        self.begin = vec![0; surface.leaves.len()];
        self.known = vec![0.0; surface.vertices.len()];
        self.settled = vec![0; surface.edges.len() / 64 + 2];
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
        let lower = (signed_distance.abs().min(tolerance) * ROUNDED_DOWN) as f32;
        let lower = lower.max(f32::MIN_POSITIVE);
        self.known[vertex as usize] = if signed_distance < 0.0 { -lower } else { lower };
    }

    /// Zero when that is not known.
    #[inline(always)]
    pub(super) fn distance(&self, vertex: u32) -> f32 {
        self.known[vertex as usize]
    }

    /// Marks edges of a leaf, by one bit each from the first.
    #[inline(always)]
    pub(super) fn settle(&mut self, first: u32, edges: u32) {
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
            self.known[vertex as usize] = 0.0;
        }
        for leaf in leaves {
            let word = surface.leaves[leaf as usize].first_edge as usize / 64;
            self.settled[word] = 0;
            self.settled[word + 1] = 0;
        }
    }

    /// Where the blocks of a leaf are.
    #[inline(always)]
    pub(super) fn of(&mut self, surface: &Surface, index: u32) -> Range<usize> {
        let begin = match self.begin[index as usize] {
            0 => self.gather(surface, index),
            known => known as usize - 1,
        };
        begin..begin + edges_of(surface, index).len().div_ceil(LANES)
    }

    #[inline(always)]
    pub(super) fn block(&self, index: usize) -> &EdgeBlock {
        &self.blocks[index]
    }

    fn gather(&mut self, surface: &Surface, index: u32) -> usize {
        let begin = self.blocks.len();
        self.begin[index as usize] = begin as u32 + 1;
        let origin = surface.blocks[index as usize].origin.map(f64::from);
        let range = edges_of(surface, index);
        let edges = &surface.edges[range.start as usize..range.end as usize];
        for eight in edges.chunks(LANES) {
            let mut block = EdgeBlock {
                start: [[0.0; LANES]; 3],
                along: [[0.0; LANES]; 3],
                vertices: edges[0].vertices.map(|v| [v; LANES]),
            };
            for (lane, edge) in eight.iter().enumerate() {
                let [a, b] = edge.vertices.map(|v| &surface.vertices[v as usize]);
                for k in 0..3 {
                    block.start[k][lane] = (a[k] - origin[k]) as f32;
                    block.along[k][lane] = (b[k] - a[k]) as f32;
                }
                block.vertices[0][lane] = edge.vertices[0];
                block.vertices[1][lane] = edge.vertices[1];
            }
            self.blocks.push(block);
        }
        begin
    }

}

/// One bit for each lane of block number `index` of so many edges that has one.
#[inline(always)]
pub(super) fn filled(edges: usize, index: usize) -> u32 {
    (1 << (edges - index * LANES).min(LANES)) - 1
}

/// Makes a positive number in double precision smaller by more than what rounding it to single precision adds.
pub(super) const ROUNDED_DOWN: f64 = 1.0 - 1e-6;
