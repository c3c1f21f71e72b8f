//! The front: which nodes of a surface stand for it where it is near the other one, and the samples of those nodes.
//!
//! Between queries two things are kept. For every vertex that was looked at: its exact distance then. Since no distance
//! changes by more than the surfaces have moved, that bounds its distance now, so most nodes are passed or refused without
//! a search. And for every node how far it is replaced by its children, so that levels change smoothly.

use super::emit::Emit;
use super::known::Looks;
use super::memory::Memory;
use super::metric::Judge;
use super::plan::{Plan, Planned};
use super::side::Search;
use crate::clod::middle::Middle;
use crate::clod::nearest::{Nearest, slack};
use crate::clod::{Hierarchy, Node, PURE_HULL, range};
use crate::query::feature::Foot;
use crate::surface::Surface;
use crate::vector::{Rigid, Vec3, dot, norm, sub};

/// A change of level takes this many queries.
pub(super) const BLEND_STEPS: f32 = 20.0;
/// What is nearer than this many tolerances belongs to the front.
pub(super) const REACH: f64 = 1.25;

/// The triangles that are held for a sample are those that are this many tolerances farther than the closest, as far as there is room.
const AROUND: f64 = 0.3;

/// Searches note what is this many tolerances farther than they need to: more or less by vertex, so that what many vertices know does not
/// run out in the same query.
fn band(vertex: u32) -> f64 {
    // By the golden ratio neighbours are far apart, and all are spread evenly.
    let spread = vertex.wrapping_mul(0x9e37_79b9);
    0.25 + 0.5 * f64::from(spread) / f64::from(u32::MAX)
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

/// The front of one surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Front {
    memory: Memory,
    /// By node: 0 when it stands for itself, 1 when its children do, between the two while that changes.
    open: Vec<f32>,
    /// By node: the walk that looked at it last.
    seen: Vec<u32>,
    walk: u32,
    stack: Vec<(u32, f32)>,
    nearest: Nearest,
    looks: Looks,
    /// Searches through the tree in this query, and how many there may be.
    searches: usize,
    allowed: usize,
    plan: Plan,
    /// Somebody looks at the front: its nodes are noted as well.
    pub watched: bool,
    pub nodes: Vec<u32>,
}

impl Front {
    /// Forgets everything and makes room for a surface.
    pub(super) fn reset(&mut self, surface: &Surface, hierarchy: &Hierarchy) {
        let count = hierarchy.nodes.len();
        *self = Self {
            memory: Memory::new(surface),
            open: vec![0.0; count],
            seen: vec![0; count],
            walk: 1,
            watched: self.watched,
            plan: Plan::none(),
            allowed: usize::MAX,
            ..Self::default()
        };
    }

    /// How far the finest of its nodes is off; zero where there are only faces without a vertex near.
    pub(super) fn deviation(&self) -> f64 {
        if self.plan.deviation.is_finite() { self.plan.deviation } else { 0.0 }
    }

    /// The next walk chooses levels at once, without a change that takes time.
    pub(super) fn settle(&mut self) {
        self.walk = self.walk.wrapping_add(1);
        self.plan.until = f64::NEG_INFINITY;
    }

    /// By vertex the weight of its sample, in the order of vertices.
    pub(super) fn weights(&self, weights: &mut Vec<(u32, f32)>) {
        weights.clear();
        weights.extend(self.plan.samples.iter().map(|s| (s.vertex, s.weight)));
        weights.sort_unstable_by_key(|w| w.0);
        // While levels change, a vertex can be a sample of two nodes.
        weights.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            kept.1 += if same { next.1 } else { 0.0 };
            same
        });
    }

    /// How far a node is replaced by its children, after a step towards what the metrics ask for.
    #[inline(always)]
    fn opened(&mut self, index: u32, node: &Node, search: &Search<'_>, judge: &Judge) -> f32 {
        let i = index as usize;
        if node.level == PURE_HULL {
            return 1.0;
        }
        let moved = || norm(sub(search.motion.point(node.center), search.last.point(node.center)));
        let lately = self.seen[i].wrapping_add(1) == self.walk;
        // What is new to the front begins on the fine side.
        let wanted = if judge.refines(node, moved, !lately || self.open[i] > 0.5) { 1.0 } else { 0.0 };
        // What was not near until now has no force yet and may change at once.
        let step = (wanted - self.open[i]).clamp(-1.0 / BLEND_STEPS, 1.0 / BLEND_STEPS);
        let open = if lately { self.open[i] + step } else { wanted };
        // Steps of a twentieth do not sum up to one exactly.
        let open = if (open - wanted).abs() < 1e-3 { wanted } else { open };
        self.open[i] = open;
        self.seen[i] = self.walk;
        open
    }

    /// Whether some vertex of a node may be within the reach.
    #[inline(always)]
    fn is_near(&mut self, middle: Middle, search: &Search<'_>) -> bool {
        let place = self.memory.place(middle.vertex);
        let known = self.memory.at(place);
        let (moved, limit) = (search.travelled - known.at, REACH * search.tolerance + middle.extent);
        if known.distance - moved > limit {
            return false;
        }
        if known.exact && known.distance + moved <= limit {
            return true;
        }
        let p = search.motion.point(search.own.vertices[middle.vertex as usize]);
        known.is_within(p, search, limit) || self.look(middle.vertex, place, search, limit).is_some()
    }

    /// A lower bound of the distance of a sample of a node with this middle, plus what the surfaces have moved in all.
    #[inline(always)]
    fn clear(&mut self, place: usize, vertex: u32, middle: Middle, own: &Surface) -> f64 {
        let clear = self.memory.clear[place];
        if clear > f64::NEG_INFINITY {
            return clear;
        }
        let at = self.memory.place(middle.vertex);
        let apart = norm(sub(own.vertices[vertex as usize], own.vertices[middle.vertex as usize]));
        self.memory.clear[at] - apart
    }

    /// The place of a sample and its foot, when that is within the tolerance; otherwise `clear` tells from when on it could be.
    #[inline(always)]
    fn look_again(
        &mut self,
        sample: &Planned,
        held_at: &mut u32,
        clear: &mut f64,
        search: &Search<'_>,
    ) -> Option<(Vec3, Foot)> {
        if let Some(held) = self.memory.held(*held_at) {
            let p = search.motion.point(sample.own);
            if let Some(foot) = held.foot(p, search.other) {
                let distance = foot.signed_distance.abs();
                *clear = distance + search.travelled;
                self.memory.clear[sample.place] = *clear;
                return (distance <= search.tolerance).then_some((p, foot));
            }
        }
        let found = self.look(sample.vertex, sample.place, search, search.tolerance);
        *clear = self.memory.clear[sample.place];
        if let Some((p, foot)) = found {
            let reach = foot.signed_distance.abs() + AROUND * search.tolerance;
            *held_at = self.memory.hold(sample.place, p, search, reach, &mut self.looks);
        }
        found
    }

    /// The place of a vertex and its foot, when that is within the limit.
    #[inline(always)]
    fn look(&mut self, vertex: u32, place: usize, search: &Search<'_>, limit: f64) -> Option<(Vec3, Foot)> {
        let p = search.motion.point(search.own.vertices[vertex as usize]);
        let slack = slack(search.other.radius + search.tolerance);
        let known = self.memory.at(place);
        let band = band(vertex) * search.tolerance;
        let Self { nearest, looks, searches, .. } = self;
        let foot = known.look(p, search, limit, band, slack, nearest, looks, searches);
        self.memory.clear[place] = known.distance + search.travelled;
        foot.map(|foot| (p, foot))
    }
}

/// Finds the samples of the front that are within the tolerance, with no more searches through the tree than about so many; none
/// when these are not enough. What was found out by then is remembered.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn find(
    front: &mut Front,
    hierarchy: &Hierarchy,
    search: &Search<'_>,
    judge: &Judge,
    allowed: usize,
    emit: &mut Emit<'_>,
) -> Option<Tally> {
    (front.searches, front.allowed) = (0, allowed);
    if !front.watched {
        front.nodes.clear();
    }
    if !front.plan.serves(judge, search) || (front.watched && front.nodes.is_empty()) {
        walk(front, hierarchy, search, judge)?;
    }
    let mut plan = core::mem::take(&mut front.plan);
    let mut tally = plan.tally;
    let force_from =
        judge.detail.force_from.unwrap_or(search.tolerance).min(search.tolerance).max(f64::MIN_POSITIVE);
    for ((sample, clear), held_at) in plan.samples.iter().zip(&mut plan.clear).zip(&mut plan.held_at) {
        if *clear > search.travelled + search.tolerance {
            continue;
        }
        if front.searches >= front.allowed {
            break;
        }
        let Some((point, foot)) = front.look_again(sample, held_at, clear, search) else {
            continue;
        };
        let pressed = 1.0 - foot.signed_distance / force_from;
        tally.contact += f64::from(sample.weight) * pressed.clamp(0.0, 1.0);
        emit.sample(sample, point, &foot);
    }
    front.plan = plan;
    (front.searches < front.allowed).then_some(tally)
}

/// Walks from the root to the front and plans which samples to look at.
#[inline(always)]
fn walk(front: &mut Front, hierarchy: &Hierarchy, search: &Search<'_>, judge: &Judge) -> Option<()> {
    // Around once in seven weeks; what is then taken for new changes its level a bit sooner.
    front.walk = front.walk.wrapping_add(1);
    front.nodes.clear();
    front.plan.begin(judge, search);
    front.stack.clear();
    front.stack.push((0, 1.0));
    let mut tally = Tally::default();
    let reach = REACH * search.tolerance;
    while let Some((index, share)) = front.stack.pop() {
        if front.searches >= front.allowed {
            front.plan.until = f64::NEG_INFINITY;
            return None;
        }
        let middle = hierarchy.middles[index as usize];
        if !front.is_near(middle, search) {
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
        front.plan.deviation = front.plan.deviation.min(node.deviation);
        for sample in &hierarchy.samples[range(node.samples)] {
            let weight = sample.weight * share * (1.0 - open);
            tally.samples += 1;
            tally.near += f64::from(weight);
            let place = front.memory.place(sample.vertex);
            let lower = front.clear(place, sample.vertex, middle, search.own);
            if lower - search.travelled <= reach {
                front.plan.push(sample.vertex, weight, place, lower, search.own);
                front.plan.held_at.push(front.memory.held_at(place));
            }
        }
    }
    front.plan.tally = tally;
    if front.plan.until > f64::NEG_INFINITY {
        front.memory.arrange(&front.plan.samples, &mut front.plan.held_at);
    }
    Some(())
}

/// The place of a vertex and its foot within the limit.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn foot(front: &mut Front, search: &Search<'_>, vertex: u32, limit: f64) -> Option<(Vec3, Foot)> {
    let place = front.memory.place(vertex);
    front.look(vertex, place, search, limit)
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
    // A turn about any axis has two unit vectors that it moves, at right angles, by the same amount.
    norm(shift) + root.radius * (0.5 * turn).sqrt()
}
