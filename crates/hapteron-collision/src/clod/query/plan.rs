//! The samples of a front whose levels are settled.

use super::front::REACH;
use super::front::Tally;
use super::metric::Judge;
use super::side::Search;
use crate::surface::{Surface, VertexNormal};
use crate::vector::Vec3;

/// A sample that is looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planned {
    pub vertex: u32,
    pub weight: f32,
    /// Where the memory of the vertex is.
    pub place: usize,
    /// Where the vertex is and its normal, own frame.
    pub own: Vec3,
    pub normal: VertexNormal,
}

/// The samples to look at. They stay these until the surfaces have moved as far as the reach goes beyond the tolerance, or other levels are wanted.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    pub samples: Vec<Planned>,
    /// By sample a lower bound of its distance when it was last looked at, plus what the surfaces had moved by then in all.
    pub clear: Vec<f64>,
    /// By sample where its triangles are held.
    pub held_at: Vec<u32>,
    /// What could be within the tolerance when the surfaces have moved this far in all, less the tolerance, is not planned for.
    pub until: f64,
    /// Which levels it was made for.
    level: f64,
    /// The least deviation of its nodes, metres.
    pub deviation: f64,
    /// What the walk came past.
    pub tally: Tally,
}

impl Plan {
    /// One that serves nobody.
    pub(super) fn none() -> Self {
        Self { until: f64::NEG_INFINITY, ..Self::default() }
    }

    pub(super) fn begin(&mut self, judge: &Judge, search: &Search<'_>) {
        self.samples.clear();
        self.clear.clear();
        self.held_at.clear();
        self.deviation = f64::INFINITY;
        self.level = judge.weight * judge.leniency;
        self.until = search.travelled + REACH * search.tolerance;
    }

    pub(super) fn serves(&self, judge: &Judge, search: &Search<'_>) -> bool {
        judge.depends_on_weight_alone()
            && self.level == judge.weight * judge.leniency
            && search.travelled + search.tolerance < self.until
    }

    /// Adds a sample, whose distance is at least `clear` less what the surfaces will have moved in all.
    #[inline(always)]
    pub(super) fn push(&mut self, vertex: u32, weight: f32, place: usize, clear: f64, surface: &Surface) {
        let (own, normal) = (surface.vertices[vertex as usize], surface.vertex_normals[vertex as usize]);
        self.samples.push(Planned { vertex, weight, place, own, normal });
        self.clear.push(clear);
    }
}
