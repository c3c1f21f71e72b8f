//! The front: which nodes of a surface stand for it where it is near the other one, and the samples of those nodes.
//!
//! Between queries two things are kept. For every vertex that was looked at: its exact distance then. Since no distance
//! changes by more than the surfaces have moved, that bounds its distance now, so most nodes are passed or refused without
//! a search. And for every node how far it is replaced by its children, so that levels change smoothly.

use super::known::Memory;
use super::metric::Judge;
use super::side::Search;
use crate::clod::middle::Middle;
use crate::clod::nearest::{Nearest, slack};
use crate::clod::{Hierarchy, Node, PURE_HULL, range};
use crate::query::feature::{self, Feature, Foot};
use crate::surface::{Surface, VertexNormal};
use crate::vector::{Rigid, Vec3, dot, norm, sub};

/// A change of level takes this many queries.
pub(super) const BLEND_STEPS: f32 = 20.0;
/// What is nearer than this many tolerances belongs to the front.
pub(super) const REACH: f64 = 1.25;

/// Searches note what is this many tolerances farther than they need to: more or less by vertex, so that what many vertices know does not
/// run out in the same query.
fn band(vertex: u32) -> f64 {
    // By the golden ratio neighbours are far apart, and all are spread evenly.
    let spread = vertex.wrapping_mul(0x9e37_79b9);
    0.25 + 0.5 * f64::from(spread) / f64::from(u32::MAX)
}

/// A sample within the tolerance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub vertex: u32,
    pub weight: f32,
    /// Where the vertex is, in the other surface's frame.
    pub point: Vec3,
    pub foot: Foot,
    /// Of the vertex, in its own surface's frame.
    pub normal: VertexNormal,
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

/// A sample that is looked at.
#[derive(Clone, Copy, Debug)]
struct Planned {
    vertex: u32,
    weight: f32,
    /// Where the memory of the vertex is.
    place: usize,
    /// Where the vertex is and its normal, own frame.
    own: Vec3,
    normal: VertexNormal,
}

/// The triangle that the foot of a sample was on, kept beside the sample: what is scattered over the memory takes longer to come than to use.
#[derive(Clone, Copy, Debug)]
struct Held {
    triangle: u32,
    corners: [Vec3; 3],
    /// Lower bound of the distances of all other triangles, plus what the surfaces had moved by then in all.
    until: f64,
}

impl Held {
    const NOTHING: Self = Self { triangle: 0, corners: [[0.0; 3]; 3], until: f64::NEG_INFINITY };
}

/// The samples of a front whose levels are settled. They stay the ones to look at until the surfaces have moved as far as the
/// reach goes beyond the tolerance, or other levels are wanted.
#[derive(Clone, Debug, Default)]
struct Plan {
    samples: Vec<Planned>,
    /// By sample a lower bound of its distance when it was last looked at, plus what the surfaces had moved by then in all.
    clear: Vec<f64>,
    /// By sample.
    held: Vec<Held>,
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
        self.held.clear();
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
    memory: Memory,
    /// By node: 0 when it stands for itself, 1 when its children do, between the two while that changes.
    open: Vec<f32>,
    /// By node: the walk that looked at it last.
    seen: Vec<u32>,
    walk: u32,
    stack: Vec<(u32, f32)>,
    nearest: Nearest,
    /// Searches through the tree in this query, and how many there may be.
    searches: usize,
    allowed: usize,
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
            memory: Memory::new(surface),
            open: vec![0.0; count],
            seen: vec![0; count],
            walk: 1,
            watched: self.watched,
            plan: Plan { until: f64::NEG_INFINITY, ..Plan::default() },
            allowed: usize::MAX,
            ..Self::default()
        };
    }

    /// The next walk chooses levels at once, without a change that takes time.
    pub(super) fn settle(&mut self) {
        self.walk += 1;
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
        let lately = self.seen[i] + 1 == self.walk;
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
        self.look(middle.vertex, place, search, limit).is_some()
    }

    /// The place of a sample and its foot, when that is within the tolerance; otherwise `clear` tells from when on it could be.
    #[inline(always)]
    fn look_again(
        &mut self,
        sample: &Planned,
        held: &mut Held,
        clear: &mut f64,
        search: &Search<'_>,
    ) -> Option<(Vec3, Foot)> {
        let others = held.until - search.travelled;
        if others > 0.0 {
            let p = search.motion.point(sample.own);
            let foot = feature::foot_between(p, held.corners, held.triangle, search.other);
            let distance = foot.signed_distance.abs();
            if distance < others {
                *clear = distance + search.travelled;
                return (distance <= search.tolerance).then_some((p, foot));
            }
        }
        let found = self.look(sample.vertex, sample.place, search, search.tolerance);
        let known = self.memory.at(sample.place);
        *clear = known.distance + search.travelled;
        // Beside an edge or a vertex another triangle is as close.
        let face = found.filter(|(_, foot)| matches!(foot.feature, Feature::Face(_)));
        *held = face.and_then(|_| known.held()).map_or(Held::NOTHING, |(triangle, until)| {
            let corners = feature::corners(triangle, search.other);
            Held { triangle, corners, until }
        });
        found
    }

    /// The place of a vertex and its foot, when that is within the limit.
    #[inline(always)]
    fn look(&mut self, vertex: u32, place: usize, search: &Search<'_>, limit: f64) -> Option<(Vec3, Foot)> {
        let p = search.motion.point(search.own.vertices[vertex as usize]);
        let slack = slack(search.other.radius + search.tolerance);
        let known = self.memory.at(place);
        let before = known.searched;
        let foot = known.look(p, search, limit, band(vertex) * search.tolerance, slack, &mut self.nearest);
        self.searches += usize::from(known.searched != before);
        foot.map(|foot| (p, foot))
    }
}

/// Makes `found` the samples of the front that are within the tolerance, with no more searches through the tree than about so many; none
/// when these are not enough. What was found out by then is remembered.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn find(
    front: &mut Front,
    hierarchy: &Hierarchy,
    search: &Search<'_>,
    judge: &Judge,
    allowed: usize,
) -> Option<Tally> {
    front.found.clear();
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
    for ((sample, clear), held) in plan.samples.iter().zip(&mut plan.clear).zip(&mut plan.held) {
        if *clear > search.travelled + search.tolerance {
            continue;
        }
        let Some((point, foot)) = front.look_again(sample, held, clear, search) else {
            continue;
        };
        let pressed = 1.0 - foot.signed_distance / force_from;
        tally.contact += f64::from(sample.weight) * pressed.clamp(0.0, 1.0);
        front.found.push(Found {
            vertex: sample.vertex,
            weight: sample.weight,
            point,
            foot,
            normal: sample.normal,
        });
        if front.searches >= front.allowed {
            break;
        }
    }
    front.plan = plan;
    (front.searches < front.allowed).then_some(tally)
}

/// Walks from the root to the front and plans which samples to look at.
#[inline(always)]
fn walk(front: &mut Front, hierarchy: &Hierarchy, search: &Search<'_>, judge: &Judge) -> Option<()> {
    front.walk += 1;
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
        if !front.is_near(hierarchy.middles[index as usize], search) {
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
            let place = front.memory.place(sample.vertex);
            let known = front.memory.at(place);
            let lower = known.distance + known.at;
            if lower - search.travelled <= reach {
                let own = search.own.vertices[sample.vertex as usize];
                let normal = search.own.vertex_normals[sample.vertex as usize];
                front.plan.samples.push(Planned { vertex: sample.vertex, weight, place, own, normal });
                front.plan.clear.push(lower);
                front.plan.held.push(Held::NOTHING);
            }
        }
    }
    front.plan.tally = tally;
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
    norm(shift) + root.radius * turn.sqrt()
}
