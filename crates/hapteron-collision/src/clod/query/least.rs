//! The least distance: from the closest samples down to a local minimum of the exact distance.

use super::front::{Front, foot};
use super::side::Search;
use crate::clod::nearest::{NOWHERE, Nearest, search, slack};
use crate::query::feature::Feature;
use crate::vector::{Vec3, add, dot, norm, scale, sub};

/// Steps of a descent; each goes to the closest of the neighbours, so few are needed.
const STEPS: usize = 32;
/// Steps of projecting to and fro between the surfaces, where they do not cross.
const PROJECTIONS: usize = 16;

/// The closest samples of a query, and the closest vertices of the last one to begin with.
#[derive(Clone, Debug, Default)]
pub(super) struct Least {
    best: [Option<(u32, f64)>; 2],
    last: [Option<u32>; 2],
    /// From which sample the last descent began, and at which vertex it ended.
    descents: [Option<[u32; 2]>; 2],
    nearest: Nearest,
}

impl Least {
    pub(super) fn reset(&mut self) {
        self.last = [None; 2];
        self.descents = [None; 2];
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
            let best = self.best[k].map(|b| b.0);
            let from_best = best.and_then(|best| {
                // From the same sample it goes where it went the last time, as far as that is still near.
                let known = self.descents[k].filter(|d| d[0] == best).map(|d| d[1]);
                let end = known.and_then(|known| Self::descend(front, searches[k], known));
                let end = end.filter(|end| self.best[k].is_none_or(|best| end.1 <= best.1));
                end.or_else(|| Self::descend(front, searches[k], best))
            });
            let last =
                core::mem::take(&mut self.last[k]).filter(|&last| from_best.is_none_or(|end| end.0 != last));
            self.descents[k] = best.zip(from_best).map(|(best, end)| [best, end.0]);
            let mut own = f64::INFINITY;
            let from_last = last.and_then(|last| Self::descend(front, searches[k], last));
            for end in [from_best, from_last] {
                if let Some((vertex, signed)) = end.filter(|e| e.1 < own) {
                    own = signed;
                    self.last[k] = Some(vertex);
                }
            }
            if own > 0.0 && own.is_finite() {
                own = own.min(self.project(k, front, searches)).min(self.cross(k, front, searches));
            }
            least = least.min(own);
        }
        least
    }

    /// From vertex to vertex as long as the signed distance falls.
    fn descend(front: &mut Front, look: &Search<'_>, start: u32) -> Option<(u32, f64)> {
        let mut signed =
            |vertex: u32| foot(front, look, vertex, look.tolerance).map(|(_, f)| f.signed_distance);
        let mut at = (start, signed(start)?);
        for _ in 0..STEPS {
            let mut better = at;
            for &edge in look.own.edges_at(at.0) {
                let [a, b] = look.own.edges[edge as usize].vertices;
                let v = if a == at.0 { b } else { a };
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
            if gain < 1e-5 * distance {
                break;
            }
            p = motion.point(on);
        }
        distance
    }

    /// Least distance of the edges at the closest vertex to those around its foot, in their middles, where they have not passed each other.
    fn cross(&self, k: usize, front: &mut Front, searches: [&Search<'_>; 2]) -> f64 {
        let look = searches[k];
        let found = self.last[k].and_then(|v| foot(front, look, v, look.tolerance).map(|(p, f)| (v, p, f)));
        let Some((vertex, p, foot)) = found else { return f64::INFINITY };
        let corners: &[u32] = match foot.feature {
            Feature::Vertex(v) => &[v],
            Feature::Edge(e) => &look.other.edges[e as usize].vertices,
            Feature::Face(t) => &look.other.triangles[t as usize],
        };
        let mut least = f64::INFINITY;
        for &edge in look.own.edges_at(vertex) {
            let own = &look.own.edges[edge as usize];
            let end = own.vertices[usize::from(own.vertices[0] == vertex)];
            let along = sub(look.motion.point(look.own.vertices[end as usize]), p);
            let outward = look.motion.direction(own.normal.map(f64::from));
            for &edge in corners.iter().flat_map(|&c| look.other.edges_at(c)) {
                let theirs = look.other.edges[edge as usize].vertices;
                let [start, end] = theirs.map(|v| look.other.vertices[v as usize]);
                if let Some(between) = between_middles([p, along], [start, sub(end, start)]) {
                    let ahead = dot(between, outward) > 0.0;
                    least = if ahead { least.min(norm(between)) } else { least };
                }
            }
        }
        least
    }
}

/// From one segment (start and direction) to another along their common perpendicular, when that meets both between their ends.
fn between_middles([p, d]: [Vec3; 2], [q, e]: [Vec3; 2]) -> Option<Vec3> {
    let r = sub(p, q);
    let (a, b, c) = (dot(d, d), dot(d, e), dot(e, e));
    let whole = a * c - b * b;
    let s = (b * dot(e, r) - c * dot(d, r)) / whole;
    let t = (a * dot(e, r) - b * dot(d, r)) / whole;
    // Comparisons with a NaN (parallel segments) are false.
    let within = s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0;
    within.then(|| sub(add(q, scale(e, t)), add(p, scale(d, s))))
}
