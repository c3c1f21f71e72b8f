//! The front: which nodes of a surface stand for it where it is near the other one, and the samples of those nodes.
//!
//! Between queries two things are kept. For every vertex that was looked at: its exact distance then. Since no distance
//! changes by more than the surfaces have moved, that bounds its distance now, so most nodes are passed or refused without
//! a search. And for every node how far it is replaced by its children, so that levels change smoothly.

use super::known::Known;
use super::metric::Judge;
use super::side::Search;
use crate::clod::nearest::{Nearest, slack};
use crate::clod::{Hierarchy, Node, PURE_HULL, Sample, range};
use crate::query::feature::Foot;
use crate::surface::Surface;
use crate::vector::{Rigid, Vec3, dot, norm, sub};

/// A change of level takes this many queries.
pub(super) const BLEND_STEPS: f32 = 20.0;
/// What is nearer than this many tolerances belongs to the front.
pub(super) const REACH: f64 = 1.25;

/// Searches note what is this many tolerances farther than they need to.
const BAND: f64 = 0.5;

/// A vertex of a node and the greatest distance of the node's vertices from it.
#[derive(Clone, Copy, Debug)]
struct Center {
    vertex: u32,
    extent: f64,
}

/// A sample within the tolerance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub vertex: u32,
    pub weight: f32,
    /// Where the vertex is, in the other surface's frame.
    pub point: Vec3,
    pub foot: Foot,
}

/// What a walk came past.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    /// Samples of the front.
    pub samples: usize,
    /// Vertices that they stand for.
    pub near: f64,
    /// Vertices in contact, each as much as its force: those where force begins count for nothing.
    pub contact: f64,
}

/// The samples of a front whose levels are settled. They stay the ones to look at until the surfaces have moved as far as the
/// reach goes beyond the tolerance, or other levels are wanted.
#[derive(Clone, Debug, Default)]
struct Plan {
    samples: Vec<Sample>,
    /// By sample a lower bound of its distance when it was last looked at, plus what the surfaces had moved by then in all.
    clear: Vec<f64>,
    /// What could be within the tolerance when the surfaces have moved this far in all, less the tolerance, is not planned for.
    until: f64,
    /// Which levels it was made for.
    level: f64,
    /// What the walk came past.
    tally: Tally,
}

impl Plan {
    fn begin(&mut self, judge: &Judge, search: &Search<'_>) {
        self.samples.clear();
        self.clear.clear();
        self.level = judge.weight * judge.leniency;
        self.until = search.travelled + REACH * search.tolerance;
    }

    fn serves(&self, judge: &Judge, search: &Search<'_>) -> bool {
        judge.depends_on_weight_alone()
            && self.level == judge.weight * judge.leniency
            && search.travelled + search.tolerance < self.until
    }
}

/// The front of one surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Front {
    centers: Vec<Center>,
    known: Vec<Known>,
    /// By node: 0 when it stands for itself, 1 when its children do, between the two while that changes.
    open: Vec<f32>,
    /// By node: the walk that looked at it last.
    seen: Vec<u32>,
    walk: u32,
    stack: Vec<(u32, f32)>,
    nearest: Nearest,
    plan: Plan,
    pub found: Vec<Found>,
    /// Somebody looks at the front: its nodes are noted as well.
    pub watched: bool,
    pub nodes: Vec<u32>,
}

impl Front {
    /// Forgets everything and makes room for a surface.
    pub(super) fn reset(&mut self, surface: &Surface, hierarchy: &Hierarchy) {
        let count = hierarchy.nodes.len();
        *self = Self {
            centers: centers(surface, hierarchy),
            known: vec![Known::UNKNOWN; surface.vertices.len()],
            open: vec![0.0; count],
            seen: vec![0; count],
            walk: 1,
            watched: self.watched,
            plan: Plan { until: f64::NEG_INFINITY, ..Plan::default() },
            ..Self::default()
        };
    }

    /// The next walk chooses levels at once, without a change that takes time.
    pub(super) fn settle(&mut self) {
        self.walk += 1;
        self.plan.until = f64::NEG_INFINITY;
    }

    /// Whether every node near the other surface is at the finest level.
    pub(super) fn is_finest(&self) -> bool {
        self.plan.level <= 1.0 && self.plan.until > f64::NEG_INFINITY
    }

    /// How far a node is replaced by its children, after a step towards what the metrics ask for.
    #[inline(always)]
    fn opened(&mut self, index: u32, node: &Node, search: &Search<'_>, judge: &Judge) -> f32 {
        let i = index as usize;
        if node.level == PURE_HULL {
            return 1.0;
        }
        let moved = || norm(sub(search.motion.point(node.center), search.last.point(node.center)));
        let wanted = if judge.refines(node, moved, self.open[i] > 0.5) { 1.0 } else { 0.0 };
        // What was not near until now has no force yet and may change at once.
        let step = (wanted - self.open[i]).clamp(-1.0 / BLEND_STEPS, 1.0 / BLEND_STEPS);
        let open = if self.seen[i] + 1 == self.walk { self.open[i] + step } else { wanted };
        // Steps of a twentieth do not sum up to one exactly.
        let open = if (open - wanted).abs() < 1e-3 { wanted } else { open };
        self.open[i] = open;
        self.seen[i] = self.walk;
        open
    }

    /// Whether some vertex of a node may be within the reach.
    #[inline(always)]
    fn is_near(&mut self, center: Center, search: &Search<'_>) -> bool {
        let known = self.known[center.vertex as usize];
        let (moved, limit) = (search.travelled - known.at, REACH * search.tolerance + center.extent);
        if known.distance - moved > limit {
            return false;
        }
        if known.exact && known.distance + moved <= limit {
            return true;
        }
        self.look(center.vertex, search, limit).is_some()
    }

    /// The place of a vertex and its foot, when that is within the limit.
    #[inline(always)]
    fn look(&mut self, vertex: u32, search: &Search<'_>, limit: f64) -> Option<(Vec3, Foot)> {
        let p = search.motion.point(search.own.vertices[vertex as usize]);
        let slack = slack(search.other.radius + search.tolerance);
        let known = &mut self.known[vertex as usize];
        let foot = known.look(p, search, limit, BAND * search.tolerance, slack, &mut self.nearest)?;
        Some((p, foot))
    }
}

/// Makes `found` the samples of the front that are within the tolerance.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn find(front: &mut Front, hierarchy: &Hierarchy, search: &Search<'_>, judge: &Judge) -> Tally {
    front.found.clear();
    if !front.watched {
        front.nodes.clear();
    }
    if !front.plan.serves(judge, search) || (front.watched && front.nodes.is_empty()) {
        walk(front, hierarchy, search, judge);
    }
    let mut plan = core::mem::take(&mut front.plan);
    let mut tally = plan.tally;
    let force_from =
        judge.detail.force_from.unwrap_or(search.tolerance).clamp(f64::MIN_POSITIVE, search.tolerance);
    for (sample, clear) in plan.samples.iter().zip(&mut plan.clear) {
        if *clear > search.travelled + search.tolerance {
            continue;
        }
        let Some((point, foot)) = front.look(sample.vertex, search, search.tolerance) else {
            *clear = front.known[sample.vertex as usize].distance + search.travelled;
            continue;
        };
        let pressed = 1.0 - foot.signed_distance / force_from;
        tally.contact += f64::from(sample.weight) * pressed.clamp(0.0, 1.0);
        front.found.push(Found { vertex: sample.vertex, weight: sample.weight, point, foot });
    }
    front.plan = plan;
    tally
}

/// Walks from the root to the front and plans which samples to look at.
#[inline(always)]
fn walk(front: &mut Front, hierarchy: &Hierarchy, search: &Search<'_>, judge: &Judge) {
    front.walk += 1;
    front.nodes.clear();
    front.plan.begin(judge, search);
    front.stack.clear();
    front.stack.push((0, 1.0));
    let mut tally = Tally::default();
    let reach = REACH * search.tolerance;
    while let Some((index, share)) = front.stack.pop() {
        if !front.is_near(front.centers[index as usize], search) {
            continue;
        }
        let node = &hierarchy.nodes[index as usize];
        let open = if node.level == 0 { 0.0 } else { front.opened(index, node, search, judge) };
        if open > 0.0 {
            front.stack.extend((node.children[0]..node.children[1]).rev().map(|c| (c, share * open)));
        }
        if open == 1.0 {
            continue;
        }
        if front.watched {
            front.nodes.push(index);
        }
        if open > 0.0 {
            // The next query takes another step.
            front.plan.until = f64::NEG_INFINITY;
        }
        for sample in &hierarchy.samples[range(node.samples)] {
            let weight = sample.weight * share * (1.0 - open);
            tally.samples += 1;
            tally.near += f64::from(weight);
            let known = front.known[sample.vertex as usize];
            let lower = known.distance + known.at;
            if lower - search.travelled <= reach {
                front.plan.samples.push(Sample { weight, ..*sample });
                front.plan.clear.push(lower);
            }
        }
    }
    front.plan.tally = tally;
}

/// The place of a vertex and its foot within the limit.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn foot(front: &mut Front, search: &Search<'_>, vertex: u32, limit: f64) -> Option<(Vec3, Foot)> {
    front.look(vertex, search, limit)
}

/// By node the vertex in its middle. A node without vertices of its own is never near.
fn centers(surface: &Surface, hierarchy: &Hierarchy) -> Vec<Center> {
    let at = |v: u32| surface.vertices[v as usize];
    hierarchy
        .nodes
        .iter()
        .map(|node| {
            let own = &hierarchy.vertices[range(node.vertices)];
            let squared = |v: u32, p: Vec3| {
                let d = sub(at(v), p);
                dot(d, d)
            };
            let nearest = own
                .iter()
                .copied()
                .min_by(|&a, &b| squared(a, node.center).total_cmp(&squared(b, node.center)));
            let Some(vertex) = nearest else {
                return Center { vertex: 0, extent: f64::NEG_INFINITY };
            };
            let extent = own.iter().map(|&v| squared(v, at(vertex))).fold(0.0, f64::max).sqrt();
            Center { vertex, extent: extent * (1.0 + 1e-12) }
        })
        .collect()
}

/// Upper bound of how far any point of the sphere around a surface moves between two motions.
pub(super) fn displacement(root: &Node, from: &Rigid, to: &Rigid) -> f64 {
    let turn: f64 = (0..3)
        .map(|i| {
            let d = sub(to.rotation[i], from.rotation[i]);
            dot(d, d)
        })
        .sum();
    let shift = sub(to.point(root.center), from.point(root.center));
    norm(shift) + root.radius * turn.sqrt()
}
