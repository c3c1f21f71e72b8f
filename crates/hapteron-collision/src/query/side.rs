//! What a query finds out about one of the two surfaces.

use crate::surface::Surface;

/// Marks a vertex that has had no closest leaf.
pub(super) const NOWHERE: u32 = u32::MAX;

/// Per-vertex results on one surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Side {
    /// By vertex: signed distance to the other surface, infinite when farther than the tolerance.
    pub signed: Vec<f64>,
    /// Vertices with a finite signed distance, in the order found.
    pub found: Vec<u32>,
    /// By vertex: the leaf of the other surface that was closest in the last query, a first guess for the next one.
    pub last: Vec<u32>,
}

impl Side {
    /// Forgets everything and makes room for a surface.
    pub(super) fn reset(&mut self, surface: &Surface) {
        self.found.clear();
        self.found.reserve(surface.vertices.len());
        self.signed.clear();
        self.signed.resize(surface.vertices.len(), f64::INFINITY);
        self.last.clear();
        self.last.resize(surface.vertices.len(), NOWHERE);
    }

    /// Forgets the distances of the last query, at a cost in proportion to what it found.
    pub(super) fn clear(&mut self) {
        for &vertex in &self.found {
            self.signed[vertex as usize] = f64::INFINITY;
        }
        self.found.clear();
    }
}
