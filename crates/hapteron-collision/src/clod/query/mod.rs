//! Contacts at a level of detail.
//!
//! The hierarchy decides where and how densely contacts are made: a front of nodes, as coarse as the error metrics
//! allow, covers each surface where it is near the other. The contacts themselves are exact: each sample of a front
//! node is an original vertex, and its foot is found on the original other surface. What is lost is only what lies
//! between samples, and a contact carries the number of vertices that it stands for, so that the total stiffness does not
//! depend on the level.

mod front;
mod known;
mod least;
mod metric;
mod side;
mod small;

pub use metric::{Combine, Detail, View};

use super::{Hierarchy, range};
use crate::contact::Contact;
use crate::query::feature::{Feature, Foot};
use crate::query::{QueryResult, QueryWorkspace, query};
use crate::surface::{Surface, VertexNormal};
use crate::vector::{Rigid, Vec3, dot, scale};
use front::{Found, Front, Tally, find};
use least::Least;
use metric::{Density, Judge};
use nalgebra::{Isometry3, Vector3};
use side::Search;
use small::{Pace, Way};

/// The first query of a pair looks this often.
const FIRST_LOOKS: usize = 4;

/// A query that takes longer than its budget makes the next ones this much more lenient, up to a limit.
const LENIENT: f64 = 1.2;
const MOST_LENIENT: f64 = 1e6;
/// One that takes less than this share of it makes them stricter again.
const SPARE: f64 = 0.6;

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
    state: Option<State>,
    /// Of the body and of the obstacle.
    fronts: [Front; 2],
    densities: [Density; 2],
    tallies: [Tally; 2],
    contacts: Vec<Contact>,
    least: Least,
    leniency: f64,
    way: Way,
    pace: Pace,
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

    /// Samples of the fronts on body and obstacle in the last query.
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

    /// Begins anew when the surfaces are others than last time.
    fn prepare(&mut self, pair: &Pair<'_>) -> Option<State> {
        let identities = [pair.body.surface.identity, pair.obstacle.surface.identity];
        let known = self.state.filter(|s| s.identities == identities);
        let root = &pair.body.hierarchy.nodes[0];
        let travelled =
            known.map_or(0.0, |s| s.travelled + front::displacement(root, &s.motion, &pair.motion));
        if let Some(known) = known {
            self.pace.observe((travelled - known.travelled) / pair.tolerance);
        }
        self.state = Some(State { identities, motion: pair.motion, travelled });
        if known.is_none() {
            for (front, lod) in self.fronts.iter_mut().zip([pair.body, pair.obstacle]) {
                front.reset(lod.surface, lod.hierarchy);
            }
            self.least.reset(pair.body.surface, pair.obstacle.surface);
            self.densities = [Density::default(); 2];
            self.leniency = 1.0;
            self.way = Way::Levels;
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

fn inverse(motion: &Rigid) -> Rigid {
    let r = motion.rotation;
    let rotation = [0, 1, 2].map(|i| [r[0][i], r[1][i], r[2][i]]);
    let back = Rigid { rotation, translation: [0.0; 3] };
    Rigid { rotation, translation: scale(back.direction(motion.translation), -1.0) }
}

/// Finds where two surfaces are closer than `tolerance` (metres) or cross, in as much detail as `detail` asks for.
///
/// With an exact `detail` it is [`query()`]. Otherwise contacts stand for `weight` vertices each; the points, normals
/// and depths are exact where they are. The least distance is that of a local minimum of the exact distance. Hierarchies that do not belong
/// to their surfaces, poses and tolerances that are not finite, find nothing. Not for the haptic thread.
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
        let exact = &mut workspace.exact;
        return query(body.surface, world_from_body, obstacle.surface, world_from_obstacle, tolerance, exact);
    }
    workspace.contacts.clear();
    let relative = world_from_obstacle.inv_mul(world_from_body);
    let finite = |pose: &Isometry3<f64>| {
        pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|c| c.is_finite())
    };
    let valid = tolerance > 0.0 && tolerance.is_finite() && finite(&relative) && finite(world_from_obstacle);
    let fits =
        [body, obstacle].iter().all(|l| l.hierarchy.belongs_to(l.surface) && !l.hierarchy.nodes.is_empty());
    if !(valid && fits) {
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
    let min_distance = match (workspace.way, known.is_some()) {
        (Way::Exact(share), true) => workspace.find_exactly(&pair, share),
        (_, true) => workspace.find_next(&pair, &last, detail, eye, &world),
        (_, false) => workspace.find_first(&pair, detail, eye, &world),
    };
    if let (Some(started), Some(budget)) = (started, detail.budget_us) {
        let share = started.elapsed().as_secs_f64() * 1e6 / budget;
        if share > 1.0 {
            workspace.leniency = (workspace.leniency * LENIENT).min(MOST_LENIENT);
        } else if share < SPARE {
            workspace.leniency = (workspace.leniency / LENIENT).max(1.0);
        }
    }
    QueryResult { min_distance, contacts: &workspace.contacts }
}

impl LodWorkspace {
    /// The first query on two surfaces.
    fn find_first(&mut self, pair: &Pair<'_>, detail: &Detail, eye: [Vec3; 2], world: &Rigid) -> f64 {
        let mut min_distance = f64::INFINITY;
        // How large the contact is shows only when it has been looked at.
        for _ in 0..FIRST_LOOKS {
            self.fronts.iter_mut().for_each(Front::settle);
            self.densities.iter_mut().for_each(Density::forget);
            min_distance = self.find(pair, &pair.motion, detail, eye, world);
        }
        self.way = Way::first(self.vertices());
        if let Way::Exact(share) = self.way { self.find_exactly(pair, share) } else { min_distance }
    }

    /// The next query by levels.
    fn find_next(
        &mut self,
        pair: &Pair<'_>,
        last: &Rigid,
        detail: &Detail,
        eye: [Vec3; 2],
        world: &Rigid,
    ) -> f64 {
        let min_distance = self.find(pair, last, detail, eye, world);
        let finest = self.fronts.iter().all(Front::is_finest);
        let pressed = -min_distance / pair.tolerance;
        self.way = self.way.after_levels(self.vertices(), finest, self.pace, pressed);
        min_distance
    }

    /// By the exact query.
    fn find_exactly(&mut self, pair: &Pair<'_>, share: f32) -> f64 {
        let [world_from_body, world_from_obstacle] = pair.poses;
        let surfaces = [pair.body.surface, pair.obstacle.surface];
        let [a, b] = surfaces;
        let found = query(a, world_from_body, b, world_from_obstacle, pair.tolerance, &mut self.exact);
        small::fade(found.contacts, surfaces, share, &mut self.contacts);
        let pressed = -found.min_distance / pair.tolerance;
        self.way = self.way.after_exact(found.contacts.len(), self.leniency > 1.0, self.pace, pressed);
        self.tallies = [Tally::default(); 2];
        self.fronts.iter_mut().for_each(|front| front.nodes.clear());
        if self.way == Way::Levels {
            // They begin at the finest level, where the contacts are the same.
            self.fronts.iter_mut().for_each(Front::settle);
            self.densities = [Density::default(); 2];
        }
        found.min_distance
    }

    /// Vertices that the contacts stand for.
    fn vertices(&self) -> f64 {
        self.contacts.iter().map(|c| c.weight).sum()
    }

    /// Makes the contacts; returns the least distance.
    fn find(&mut self, pair: &Pair<'_>, last: &Rigid, detail: &Detail, eye: [Vec3; 2], world: &Rigid) -> f64 {
        let (a, b) = (pair.body.surface, pair.obstacle.surface);
        let travelled = self.state.map_or(0.0, |s| s.travelled);
        let back = inverse(last);
        let of_body =
            Search { own: a, other: b, motion: &pair.motion, last, tolerance: pair.tolerance, travelled };
        let of_obstacle = Search { own: b, other: a, motion: &pair.inverse, last: &back, ..of_body };
        let radius = pair.body.hierarchy.radius();
        let hierarchies = [pair.body.hierarchy, pair.obstacle.hierarchy];
        for (k, search) in [&of_body, &of_obstacle].into_iter().enumerate() {
            let weight =
                if self.way == Way::Refining { 1.0 } else { self.densities[k].weight(detail, radius) };
            let judge = Judge { detail: *detail, weight, eye: eye[k], leniency: self.leniency };
            self.tallies[k] = find(&mut self.fronts[k], hierarchies[k], search, &judge);
            self.densities[k].observe(&self.tallies[k]);
        }
        self.contacts.clear();
        self.least.begin();
        self.push_body(pair, world);
        self.push_obstacle(pair, world);
        self.least.refine(&mut self.fronts, [&of_body, &of_obstacle])
    }

    fn push_body(&mut self, pair: &Pair<'_>, world: &Rigid) {
        let (a, b) = (pair.body.surface, pair.obstacle.surface);
        for Found { vertex, weight, point, foot } in &self.fronts[0].found {
            self.least.offer(0, *vertex, foot.signed_distance);
            let normal = scale(foot.normal, -1.0);
            let own = &a.vertex_normals[*vertex as usize];
            if faces(own, pair.motion.direction(own.normal.map(f64::from)), normal, foot.signed_distance) {
                let features = [Feature::Vertex(*vertex).number(a), foot.feature.number(b)];
                push(&mut self.contacts, world, [*point, foot.point], normal, foot, *weight, features);
            }
        }
    }

    fn push_obstacle(&mut self, pair: &Pair<'_>, world: &Rigid) {
        let (a, b) = (pair.body.surface, pair.obstacle.surface);
        for Found { vertex, weight, foot, .. } in &self.fronts[1].found {
            self.least.offer(1, *vertex, foot.signed_distance);
            let normal = pair.motion.direction(foot.normal);
            let own = &b.vertex_normals[*vertex as usize];
            if faces(own, own.normal.map(f64::from), scale(normal, -1.0), foot.signed_distance) {
                let features = [foot.feature.number(a), Feature::Vertex(*vertex).number(b)];
                let points = [pair.motion.point(foot.point), b.vertices[*vertex as usize]];
                push(&mut self.contacts, world, points, normal, foot, *weight, features);
            }
        }
    }
}

/// Whether a surface with this vertex can touch along `direction` (outward); the rule of the exact query.
fn faces(vertex: &VertexNormal, normal: Vec3, direction: Vec3, signed_distance: f64) -> bool {
    let cone = f64::from(vertex.cone);
    dot(normal, direction) >= if signed_distance <= 0.0 { cone.min(0.0) } else { cone }
}

/// `points` on body and obstacle and `normal` are in the obstacle's frame.
fn push(
    contacts: &mut Vec<Contact>,
    world: &Rigid,
    points: [Vec3; 2],
    normal: Vec3,
    foot: &Foot,
    weight: f32,
    [body_feature, obstacle_feature]: [u32; 2],
) {
    contacts.push(Contact {
        point_body: Vector3::from(world.point(points[0])),
        point_obstacle: Vector3::from(world.point(points[1])),
        normal: Vector3::from(world.direction(normal)),
        depth: -foot.signed_distance,
        weight: f64::from(weight),
        body_feature,
        obstacle_feature,
    });
}
