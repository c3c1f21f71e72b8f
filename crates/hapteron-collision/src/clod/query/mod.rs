//! Contacts at a level of detail.
//!
//! The hierarchy decides where and how densely contacts are made: a front of nodes, as coarse as the error metrics
//! allow, covers each surface where it is near the other. The contacts themselves are exact: each sample of a front
//! node is an original vertex, and its foot is found on the original other surface. What is lost is only what lies
//! between samples, and a contact carries the number of vertices that it stands for, so that the total stiffness does not
//! depend on the level.

mod budget;
mod emit;
mod front;
mod held;
mod known;
mod least;
mod memory;
mod metric;
mod plan;
mod side;
mod small;

pub use metric::{Combine, Detail, View};

use super::{Hierarchy, range};
use crate::contact::Contact;
use crate::query::{QueryResult, QueryWorkspace, query};
use crate::surface::Surface;
use crate::vector::{Rigid, Vec3, scale};
use budget::Leniency;
use emit::Emit;
use fearless_simd::Level;
use front::{Front, Tally, find};
use least::Least;
use metric::{Density, Judge, least_samples};
use nalgebra::Isometry3;
use side::Search;
use small::{Pace, Seen, Warmth, Way};

/// Smaller and greater tolerances count as these, metres, as in the exact query.
const LEAST_TOLERANCE: f64 = 1e-12;
const GREATEST_TOLERANCE: f64 = 1e12;

/// In contacts of more vertices than this nothing is looked for that is closer than the samples show: it would take several milliseconds every now and then.
const LARGEST: f64 = 10_000.0;
/// What could come closer than the samples show is collected as far away as this share of the tolerance.
const AHEAD: f64 = 0.1;
/// Where the levels leave nothing that could be closer, at least what crosses is looked for, and what is closer than this share of the tolerance.
const CROSSING: f64 = 0.01;

/// A surface with its hierarchy.
#[derive(Clone, Copy, Debug)]
pub struct Lod<'a> {
    /// The original surface.
    pub surface: &'a Surface,
    /// Its levels.
    pub hierarchy: &'a Hierarchy,
}

impl Lod<'_> {
    /// The original triangles that a node stands for, three corners each with their unit normals; mesh frame. For pictures.
    pub fn corners(&self, node: u32) -> impl Iterator<Item = ([f64; 3], [f32; 3])> {
        let triangles = self.hierarchy.nodes.get(node as usize).map_or([0; 2], |n| n.triangles);
        let surface = self.surface;
        let corners =
            self.hierarchy.triangles[range(triangles)].iter().flat_map(|&t| surface.triangles[t as usize]);
        corners.map(|v| (surface.vertices[v as usize], surface.vertex_normals[v as usize].normal))
    }
}

/// Memory of a query at a level of detail, to be kept for the next one on the same pair. Use one for each pair.
#[derive(Clone, Debug, Default)]
pub struct LodWorkspace {
    exact: QueryWorkspace,
    /// For what is closer than the samples show.
    closer: QueryWorkspace,
    state: Option<State>,
    /// Of the body and of the obstacle.
    fronts: [Front; 2],
    densities: [Density; 2],
    tallies: [Tally; 2],
    contacts: Vec<Contact>,
    least: Least,
    leniency: Leniency,
    way: Way,
    warmth: Warmth,
    pace: Pace,
    /// By side the weights of the front's samples, while they matter.
    weights: [Vec<(u32, f32)>; 2],
}

/// Of the last query.
#[derive(Clone, Copy, Debug)]
struct State {
    identities: [u64; 2],
    motion: Rigid,
    travelled: f64,
}

impl LodWorkspace {
    /// An empty workspace.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Samples of the fronts on body and obstacle in the last query; none where it was exact.
    #[must_use]
    pub fn samples(&self) -> [usize; 2] {
        self.tallies.map(|t| t.samples)
    }

    /// Whether the next queries note which nodes their fronts consist of.
    pub fn watch(&mut self, on: bool) {
        for front in &mut self.fronts {
            front.watched = on;
        }
    }

    /// Nodes of the fronts on body and obstacle in the last query, coarse ones before those that are taking their place; none unless
    /// it was watched, and none where the contact was small or deep and so exact.
    #[must_use]
    pub fn front(&self) -> [&[u32]; 2] {
        [&self.fronts[0].nodes, &self.fronts[1].nodes]
    }

    /// The last query had no fronts.
    fn without_fronts(&mut self) {
        self.tallies = [Tally::default(); 2];
        self.fronts.iter_mut().for_each(|front| front.nodes.clear());
    }

    /// Begins anew when the surfaces are others than last time, or were far apart.
    fn prepare(&mut self, pair: &Pair<'_>) -> Option<State> {
        let identities = [pair.body.surface.identity, pair.obstacle.surface.identity];
        let known = self.state.filter(|s| s.identities == identities);
        let root = &pair.body.hierarchy.nodes[0];
        let travelled = known.map_or(0.0, |s| {
            let step = front::displacement(root, &s.motion, &pair.motion);
            // Rounded up, or a slow motion after a long way would not count.
            if step > 0.0 { (s.travelled + step).next_up() } else { s.travelled }
        });
        if let Some(known) = known {
            self.pace.observe((travelled - known.travelled) / pair.tolerance);
        }
        self.state = Some(State { identities, motion: pair.motion, travelled });
        if known.is_none() {
            for (front, lod) in self.fronts.iter_mut().zip([pair.body, pair.obstacle]) {
                front.reset(lod.surface, lod.hierarchy);
            }
            self.least.reset();
            self.closer.look_ahead(AHEAD * pair.tolerance);
            self.leniency = Leniency::default();
            self.way = Way::default();
            self.warmth = Warmth::Cold;
            self.pace = Pace::default();
        }
        known
    }
}

/// The two surfaces and where they are.
struct Pair<'a> {
    body: Lod<'a>,
    obstacle: Lod<'a>,
    /// Of the mesh frames in the world.
    poses: [&'a Isometry3<f64>; 2],
    /// From the body's mesh frame to the obstacle's, and back.
    motion: Rigid,
    inverse: Rigid,
    tolerance: f64,
}

/// A pair with what its levels depend on.
struct Scenery<'a> {
    pair: Pair<'a>,
    /// From the obstacle's mesh frame to the world.
    world: Rigid,
    /// From the body's mesh frame to the obstacle's in the last query.
    last: Rigid,
    detail: &'a Detail,
    /// The eye in either mesh frame.
    eye: [Vec3; 2],
}

fn inverse(motion: &Rigid) -> Rigid {
    let r = motion.rotation;
    let rotation = [0, 1, 2].map(|i| [r[0][i], r[1][i], r[2][i]]);
    let back = Rigid { rotation, translation: [0.0; 3] };
    Rigid { rotation, translation: scale(back.direction(motion.translation), -1.0) }
}

/// Finds where two surfaces are closer than `tolerance` (metres) or cross, in as much detail as `detail` asks for.
///
/// With an exact `detail` it is [`query()`]. Otherwise contacts stand for `weight` vertices each; the points, normals
/// and depths are exact where they are. The least distance is no farther from the exact one than both surfaces' nodes are off at the place where they are closest;
/// in contacts of more than 10,000 vertices it is that of a local minimum. Hierarchies that do not belong
/// to their surfaces, poses and tolerances that are not finite, and negative tolerances, find nothing; a tolerance of zero finds what crosses.
/// Not for the haptic thread.
pub fn query_levels<'a>(
    body: Lod<'_>,
    world_from_body: &Isometry3<f64>,
    obstacle: Lod<'_>,
    world_from_obstacle: &Isometry3<f64>,
    tolerance: f64,
    detail: &Detail,
    workspace: &'a mut LodWorkspace,
) -> QueryResult<'a> {
    if detail.is_exact() {
        workspace.without_fronts();
        let exact = &mut workspace.exact;
        return query(body.surface, world_from_body, obstacle.surface, world_from_obstacle, tolerance, exact);
    }
    workspace.contacts.clear();
    let relative = world_from_obstacle.inv_mul(world_from_body);
    let finite = |pose: &Isometry3<f64>| {
        pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|c| c.is_finite())
    };
    let valid = tolerance >= 0.0 && tolerance.is_finite() && finite(&relative) && finite(world_from_obstacle);
    let fits =
        [body, obstacle].iter().all(|l| l.hierarchy.belongs_to(l.surface) && !l.hierarchy.nodes.is_empty());
    let tolerance = tolerance.clamp(LEAST_TOLERANCE, GREATEST_TOLERANCE);
    let near =
        relative.translation.vector.amax() <= tolerance + body.surface.radius + obstacle.surface.radius;
    if !(valid && fits && near) {
        workspace.without_fronts();
        // The way from far apart would be so long that short ones no longer show beside it.
        workspace.state = workspace.state.filter(|_| near);
        return QueryResult { min_distance: f64::INFINITY, contacts: &workspace.contacts };
    }
    let started = detail.budget_us.map(|_| std::time::Instant::now());
    let motion = Rigid::from_isometry(&relative);
    let poses = [world_from_body, world_from_obstacle];
    let pair = Pair { body, obstacle, poses, inverse: inverse(&motion), motion, tolerance };
    let eye = detail.view.map_or([[0.0; 3]; 2], |view| {
        [world_from_body, world_from_obstacle]
            .map(|pose| pose.inverse_transform_point(&view.eye).coords.into())
    });
    let world = Rigid::from_isometry(world_from_obstacle);
    let known = workspace.prepare(&pair);
    let last = known.map_or(pair.motion, |s| s.motion);
    let scenery = Scenery { pair, world, last, detail, eye };
    let min_distance = match workspace.way {
        Way::Exact(share) => workspace.find_exactly(&scenery, share),
        Way::Levels => workspace.find_by_levels(&scenery),
    };
    if let (Some(started), Some(budget)) = (started, detail.budget_us) {
        let by_levels = workspace.tallies.iter().any(|t| t.samples > 0);
        workspace.leniency.observe(started.elapsed().as_secs_f64() * 1e6 / budget, by_levels);
    }
    QueryResult { min_distance, contacts: &workspace.contacts }
}

impl LodWorkspace {
    /// By levels.
    fn find_by_levels(&mut self, scenery: &Scenery<'_>) -> f64 {
        self.contacts.clear();
        self.look(scenery, usize::MAX);
        let back = inverse(&scenery.last);
        let [of_body, of_obstacle] = self.searches(scenery, &back);
        let least = self.least.refine(&mut self.fronts, [&of_body, &of_obstacle]);
        let vertices: f64 = self.contacts.iter().map(|c| c.weight).sum();
        let min_distance = if vertices < LARGEST { self.assure(scenery, least) } else { least };
        self.way = small::after_levels(vertices, self.seen(scenery, self.contacts.len(), min_distance));
        if self.way != Way::Levels {
            let Self { fronts, weights, .. } = self;
            fronts.iter().zip(weights).for_each(|(front, weights)| front.weights(weights));
        }
        min_distance
    }

    /// The least distance, which is known for the samples and what is around them: no farther from the exact one than the deviations of the nodes where that is.
    fn assure(&mut self, scenery: &Scenery<'_>, least: f64) -> f64 {
        let pair = &scenery.pair;
        // What is closer by more than the finest nodes are off is looked for exactly.
        let deviation = self.fronts[0].deviation() + self.fronts[1].deviation();
        let closer = if least.is_finite() { least - deviation } else { pair.tolerance };
        let tolerance = closer.max(CROSSING * pair.tolerance).min(pair.tolerance);
        let [world_from_body, world_from_obstacle] = pair.poses;
        let (a, b) = (pair.body.surface, pair.obstacle.surface);
        let found = query(a, world_from_body, b, world_from_obstacle, tolerance, &mut self.closer);
        least.min(found.min_distance)
    }

    fn seen(&self, scenery: &Scenery<'_>, contacts: usize, min_distance: f64) -> Seen {
        let pair = &scenery.pair;
        let wanted = least_samples(scenery.detail, pair.body.hierarchy.radius());
        let pressed = -min_distance / pair.tolerance;
        Seen { contacts, pressed, late: self.leniency.is_late(), pace: self.pace, wanted }
    }

    /// By the exact query, and on towards the levels when these would be better.
    fn find_exactly(&mut self, scenery: &Scenery<'_>, share: f32) -> f64 {
        let pair = &scenery.pair;
        let [world_from_body, world_from_obstacle] = pair.poses;
        let surfaces = [pair.body.surface, pair.obstacle.surface];
        let [a, b] = surfaces;
        let found = query(a, world_from_body, b, world_from_obstacle, pair.tolerance, &mut self.exact);
        small::fade(found.contacts, surfaces, share, &self.weights, pair.tolerance, &mut self.contacts);
        let min_distance = found.min_distance;
        let contacts = found.contacts.len();
        let seen = self.seen(scenery, contacts, min_distance);
        if seen.asks_for_levels() {
            let count = self.contacts.len();
            self.way = self.approach_levels(scenery, share, seen.searches());
            // Those of the fronts do not count yet.
            self.contacts.truncate(count);
        } else {
            self.way = small::blended(share, false);
            if self.way == Way::Exact(1.0) && !matches!(self.warmth, Warmth::Resting(_)) {
                self.warmth = Warmth::Cold;
            }
        }
        self.without_fronts();
        min_distance
    }

    /// Makes the fronts readier, and lets them take over when they are ready.
    fn approach_levels(&mut self, scenery: &Scenery<'_>, share: f32, searches: usize) -> Way {
        match self.warmth {
            Warmth::Warm => {
                self.look(scenery, usize::MAX);
                let Self { fronts, weights, .. } = self;
                fronts.iter().zip(weights).for_each(|(front, weights)| front.weights(weights));
                return small::blended(share, true);
            }
            Warmth::Resting(queries) => {
                self.warmth = if queries > 0 { Warmth::Resting(queries - 1) } else { Warmth::Cold };
            }
            Warmth::Cold => {
                let hierarchies = [scenery.pair.body.hierarchy, scenery.pair.obstacle.hierarchy];
                self.densities = hierarchies.map(Density::coarsest);
                self.warmth = Warmth::Warming(0);
            }
            Warmth::Warming(_) => {
                self.fronts.iter_mut().for_each(Front::settle);
                self.densities.iter_mut().for_each(Density::forget);
                let ready = self.look(scenery, searches);
                self.warmth = self.warmth.after(ready);
            }
        }
        Way::Exact(share)
    }

    fn searches<'a>(&self, scenery: &'a Scenery<'_>, back: &'a Rigid) -> [Search<'a>; 2] {
        let Scenery { pair, last, .. } = scenery;
        let (own, other) = (pair.body.surface, pair.obstacle.surface);
        let travelled = self.state.map_or(0.0, |s| s.travelled);
        let (level, tolerance) = (Level::new(), pair.tolerance);
        let of_body = Search { own, other, motion: &pair.motion, last, level, tolerance, travelled };
        [of_body, Search { own: other, other: own, motion: &pair.inverse, last: back, ..of_body }]
    }

    /// Looks for the samples within the tolerance, with no more searches than about so many. True when that was enough and the levels
    /// are those that the contact asks for.
    fn look(&mut self, scenery: &Scenery<'_>, allowed: usize) -> bool {
        let Scenery { pair, world, detail, eye, .. } = scenery;
        let back = inverse(&scenery.last);
        let radius = pair.body.hierarchy.radius();
        let searches = self.searches(scenery, &back);
        let mut settled = true;
        self.least.begin();
        for (k, hierarchy) in [pair.body.hierarchy, pair.obstacle.hierarchy].into_iter().enumerate() {
            let weight = self.densities[k].weight(detail, radius);
            let judge = Judge { detail: **detail, weight, eye: eye[k], leniency: self.leniency.factor() };
            let mut emit =
                Emit { pair, world, side: k, contacts: &mut self.contacts, least: &mut self.least };
            let found = find(&mut self.fronts[k], hierarchy, &searches[k], &judge, allowed, &mut emit);
            let Some(tally) = found else { return false };
            self.tallies[k] = tally;
            self.densities[k].observe(&tally);
            settled &= self.densities[k].weight(detail, radius) == weight;
        }
        settled
    }
}

#[cfg(test)]
mod tests;
