//! The least distance: from the closest samples down to a local minimum of the exact distance.

use super::front::{Front, foot};
use super::side::Search;
use crate::clod::nearest::{NOWHERE, Nearest, search, slack};
use crate::surface::Surface;
use crate::vector::{norm, sub};

/// Steps of a descent; each goes to the closest of the neighbours, so few are needed.
const STEPS: usize = 32;
/// Steps of projecting to and fro between the surfaces, where they do not cross.
const PROJECTIONS: usize = 8;

/// The closest samples of a query, and the closest vertices of the last one to begin with.
#[derive(Clone, Debug, Default)]
pub(super) struct Least {
    best: [Option<(u32, f64)>; 2],
    last: [Option<u32>; 2],
    around: [Around; 2],
    nearest: Nearest,
}

/// By vertex the vertices next to it.
#[derive(Clone, Debug, Default)]
struct Around {
    begin: Vec<u32>,
    next: Vec<u32>,
}

impl Around {
    fn new(surface: &Surface) -> Self {
        let mut begin = vec![0u32; surface.vertices.len() + 1];
        surface.edges.iter().flat_map(|e| e.vertices).for_each(|v| begin[v as usize + 1] += 1);
        for v in 0..surface.vertices.len() {
            begin[v + 1] += begin[v];
        }
        let mut place = begin.clone();
        let mut next = vec![0; 2 * surface.edges.len()];
        for [a, b] in surface.edges.iter().map(|e| e.vertices) {
            for (from, to) in [(a, b), (b, a)] {
                next[place[from as usize] as usize] = to;
                place[from as usize] += 1;
            }
        }
        Self { begin, next }
    }
}

impl Least {
    pub(super) fn reset(&mut self, body: &Surface, obstacle: &Surface) {
        *self = Self { around: [Around::new(body), Around::new(obstacle)], ..Self::default() };
    }

    pub(super) fn begin(&mut self) {
        self.best = [None; 2];
    }

    /// A sample of side 0 (the body) or 1 with its signed distance.
    #[inline(always)]
    pub(super) fn offer(&mut self, side: usize, vertex: u32, signed: f64) {
        if self.best[side].is_none_or(|(_, least)| signed < least) {
            self.best[side] = Some((vertex, signed));
        }
    }

    /// The least signed distance that the descents from the closest samples come to; infinite without any.
    pub(super) fn refine(&mut self, fronts: &mut [Front; 2], searches: [&Search<'_>; 2]) -> f64 {
        let mut least = f64::INFINITY;
        for (k, front) in fronts.iter_mut().enumerate() {
            let mut starts = [self.best[k].map(|b| b.0), self.last[k]];
            if starts[0] == starts[1] {
                starts[1] = None;
            }
            self.last[k] = None;
            let mut own = f64::INFINITY;
            for start in starts.into_iter().flatten() {
                let end = self.descend(k, front, searches[k], start);
                if let Some((vertex, signed)) = end.filter(|e| e.1 < own) {
                    own = signed;
                    self.last[k] = Some(vertex);
                }
            }
            if own > 0.0 && own.is_finite() {
                own = own.min(self.project(k, front, searches));
            }
            least = least.min(own);
        }
        least
    }

    /// From vertex to vertex as long as the signed distance falls.
    fn descend(&self, k: usize, front: &mut Front, look: &Search<'_>, start: u32) -> Option<(u32, f64)> {
        let mut signed =
            |vertex: u32| foot(front, look, vertex, look.tolerance).map(|(_, f)| f.signed_distance);
        let mut at = (start, signed(start)?);
        for _ in 0..STEPS {
            let mut better = at;
            let around = &self.around[k];
            for &v in
                &around.next[around.begin[at.0 as usize] as usize..around.begin[at.0 as usize + 1] as usize]
            {
                if let Some(d) = signed(v).filter(|&d| d < better.1) {
                    better = (v, d);
                }
            }
            if better.0 == at.0 {
                break;
            }
            at = better;
        }
        Some(at)
    }

    /// From the closest vertex to the other surface, from there back, and so on: the distance only falls, towards where
    /// faces or edges are closest.
    fn project(&mut self, k: usize, front: &mut Front, searches: [&Search<'_>; 2]) -> f64 {
        let (own, other) = (searches[k], searches[1 - k]);
        let Some((_, foot)) = self.last[k].and_then(|v| foot(front, own, v, own.tolerance)) else {
            return f64::INFINITY;
        };
        let mut distance = foot.signed_distance;
        // In the own frame and in the other's by turns.
        let mut p = other.motion.point(foot.point);
        let mut leaves = [NOWHERE; 2];
        for step in 0..PROJECTIONS {
            let (surface, motion) =
                if step % 2 == 0 { (own.own, own.motion) } else { (own.other, other.motion) };
            let slack = slack(surface.radius + own.tolerance);
            let limit = distance * (1.0 + 1e-9) + 1e-12;
            if !search(&mut self.nearest, surface, p, leaves[step % 2], limit, slack) {
                break;
            }
            leaves[step % 2] = self.nearest.leaf;
            let on = crate::query::feature::foot(p, self.nearest.triangle, surface).point;
            let closer = norm(sub(on, p));
            let gain = distance - closer;
            distance = distance.min(closer);
            if gain < 1e-3 * distance {
                break;
            }
            p = motion.point(on);
        }
        distance
    }
}
