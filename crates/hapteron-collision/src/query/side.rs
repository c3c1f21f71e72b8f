//! What a query finds out about one of the two surfaces.

use crate::surface::Surface;

/// Per-vertex results on one surface. Zero bits mean nothing known: memory that no query touches need not be written.
#[derive(Clone, Debug, Default)]
pub(super) struct Side {
    /// By vertex: signed distance to the other surface, zero when farther than the tolerance.
    signed: Vec<f64>,
    /// Vertices with a signed distance, in the order found.
    found: Vec<u32>,
    /// By vertex: the leaf of the other surface that was closest in the last query, plus one.
    last: Vec<u32>,
}

impl Side {
    /// Forgets everything and makes room for a surface.
    pub(super) fn reset(&mut self, surface: &Surface) {
        self.found = Vec::with_capacity(surface.vertices.len());
        self.signed = vec![0.0; surface.vertices.len()];
        self.last = vec![0; surface.vertices.len()];
    }

    /// Forgets the distances of the last query, at a cost in proportion to what it found.
    pub(super) fn clear(&mut self) {
        for &vertex in &self.found {
            self.signed[vertex as usize] = 0.0;
        }
        self.found.clear();
    }

    /// Signed distance of a vertex to the other surface, infinite when farther than the tolerance.
    #[inline(always)]
    pub(super) fn signed_distance(&self, vertex: u32) -> f64 {
        let signed = self.signed[vertex as usize];
        if signed.to_bits() == 0 { f64::INFINITY } else { signed }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, vertex: u32, signed_distance: f64) {
        // A distance of zero is written as a negative one, which has a bit set.
        self.signed[vertex as usize] = if signed_distance == 0.0 { -0.0 } else { signed_distance };
        self.found.push(vertex);
    }

    /// The leaf of the other surface that was closest when last asked, a first guess for the next time.
    #[inline(always)]
    pub(super) fn last_leaf(&self, vertex: u32) -> Option<u32> {
        self.last[vertex as usize].checked_sub(1)
    }

    #[inline(always)]
    pub(super) fn set_last_leaf(&mut self, vertex: u32, leaf: Option<u32>) {
        self.last[vertex as usize] = leaf.map_or(0, |leaf| leaf + 1);
    }
}
