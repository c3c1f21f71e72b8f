//! Exact contacts between two surfaces at full resolution.
//!
//! Every local minimum of the distance between two triangle meshes lies between a vertex and a face (or edge or vertex)
//! or between two edges. So a query finds, for every vertex of either surface, its foot on the other one, as far as that
//! is within the tolerance, with its side (the sign rule stands at [`Surface`]); and for pairs of edges their common
//! perpendicular where it shows more than the vertices do. That covers all regions of the two surfaces that are
//! closer than the tolerance with one contact at each vertex there, and its least distance is the exact one, at a
//! fraction of the cost of listing all pairs of close triangles.

mod bounds;
mod deep;
pub(crate) mod feature;
pub(crate) mod kernel;
mod nearest;
mod result;
mod ridge_kernel;
mod ridge_pairs;
mod ridge_store;
mod ridges;
mod side;
mod vertices;
mod walk;

use crate::contact::Contact;
use crate::surface::Surface;
use crate::vector::{self, Rigid};
use fearless_simd::{Level, Simd, dispatch};
use nalgebra::Isometry3;
use result::Sink;
use walk::Walk;

/// Share of the tolerance by which the near leaves are collected from farther away than needed, so that the next queries
/// find them without a walk; and the number of steps like the last one that this should last for.
const AHEAD: f64 = 0.5;
const STEPS_AHEAD: f64 = 8.0;
/// For a workspace that was told how far to look ahead.
const MORE_STEPS_AHEAD: f64 = 32.0;
/// A smaller tolerance counts as this one, metres: nothing but what crosses.
const LEAST_TOLERANCE: f64 = 1e-12;
/// A greater tolerance counts as this one, metres: farther apart than the largest meshes are wide, and with squares that single
/// precision holds.
const GREATEST_TOLERANCE: f64 = 1e12;

/// The two surfaces and where they are.
#[derive(Clone, Copy)]
struct Pair<'a> {
    body: &'a Surface,
    obstacle: &'a Surface,
    /// From the body's mesh frame to the obstacle's.
    motion: &'a Rigid,
    inverse: &'a Rigid,
    tolerance: f64,
    /// Sum of the displacements of the body over the queries with this workspace, metres.
    travelled: f64,
}

impl Pair<'_> {
    /// Covers the rounding of single-precision coordinates, in metres.
    fn slack(&self) -> f64 {
        1e-6 * (self.body.radius + self.obstacle.radius + vector::norm(self.motion.translation))
    }

    /// The rotation of the motion in single precision.
    fn rotation32(&self) -> [[f32; 3]; 3] {
        self.motion.rotation.map(|row| row.map(|c| c as f32))
    }
}

/// Memory of a query, to be kept for the next one on the same pair of surfaces, which is then faster: it remembers which
/// parts were near and which triangles closest. It never changes a result by more than rounding. Use one for each pair.
#[derive(Clone, Debug, Default)]
pub struct QueryWorkspace {
    walk: Walk,
    collected: Option<Collected>,
    /// How far near leaves are collected beyond the tolerance, metres, if not as far as that suggests.
    ahead: Option<f64>,
    ridges: ridges::Ridges,
    deep: deep::Memory,
    body: side::Side,
    obstacle: side::Side,
    scratch: vertices::Scratch,
    contacts: Vec<Contact>,
}

/// For which surfaces, pose and distance the near leaves have been collected.
#[derive(Clone, Copy, Debug)]
struct Collected {
    surfaces: [u64; 2],
    motion: Rigid,
    reach: f64,
    /// The pose of the last query.
    last: Rigid,
    travelled: f64,
}

impl QueryWorkspace {
    /// An empty workspace.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// From now on near leaves are collected less often, as far away as `ahead` beyond the tolerance: the better way where that is short and little is found.
    pub(crate) fn look_ahead(&mut self, ahead: f64) {
        self.ahead = Some(ahead);
    }

    /// Makes sure that the lists of near leaves hold all that can be within the tolerance. Gives what the body has travelled.
    #[inline(always)]
    fn collect(&mut self, simd: impl Simd, pair: Pair<'_>) -> f64 {
        let surfaces = [pair.body.identity, pair.obstacle.identity];
        let Some(root) = pair.body.nodes.first() else {
            return 0.0;
        };
        let known = self.collected.filter(|known| known.surfaces == surfaces);
        let (mut step, mut travelled) = (0.0, 0.0);
        if let Some(known) = known {
            step = walk::displacement(root, &known.last, pair.motion);
            travelled = known.travelled + step;
            let moved = walk::displacement(root, &known.motion, pair.motion);
            if pair.tolerance + moved <= known.reach {
                self.collected = Some(Collected { last: *pair.motion, travelled, ..known });
                return travelled;
            }
        } else {
            self.body.reset(pair.body);
            self.obstacle.reset(pair.obstacle);
            self.ridges.reset(pair);
        }
        // Looking far ahead pays for a slow motion only, and not at all for a first query or a jump.
        let (steps, most) =
            self.ahead.map_or((STEPS_AHEAD, AHEAD * pair.tolerance), |most| (MORE_STEPS_AHEAD, most));
        let ahead = if known.is_some() && step < most { (steps * step).min(most) } else { 0.0 };
        let reach = pair.tolerance + ahead;
        walk::walk(simd, pair, ahead, &mut self.walk);
        let [body_apart, obstacle_apart] = self.deep.apart.each_mut();
        for (clear, neighbours) in [
            (&mut self.body.clear, &self.walk.near.body),
            (&mut self.obstacle.clear, &self.walk.near.obstacle),
            (&mut self.ridges.clear, &self.walk.near.body),
            (body_apart, &self.walk.touching.body),
            (obstacle_apart, &self.walk.touching.obstacle),
        ] {
            clear.clear();
            clear.resize(neighbours.of.len(), side::Clear::UNKNOWN);
        }
        let motion = *pair.motion;
        self.collected = Some(Collected { surfaces, motion, reach, last: motion, travelled });
        travelled
    }

    /// Finds all contacts and gives the least distance.
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, pair: &mut Pair<'_>, world_from_obstacle: Rigid) -> f64 {
        pair.travelled = self.collect(simd, *pair);
        let pair = *pair;
        let Self { walk, ridges, deep, body, obstacle, scratch, contacts, .. } = self;
        body.clear();
        obstacle.clear();
        let (near, touching) = (&walk.near, &walk.touching);
        // There rarely are more, and a first query need not copy what it has found again and again.
        contacts.reserve(4 * (near.body.of.len() + near.obstacle.of.len()));
        let mut sink = Sink { pair, world_from_obstacle, contacts, least: f64::INFINITY };
        vertices::of_body(simd, pair, &near.body, body, scratch, &mut sink);
        vertices::of_obstacle(simd, pair, &near.obstacle, obstacle, scratch, &mut sink);
        ridges::find(simd, pair, &near.body, [body, obstacle], ridges, &mut sink);
        deep::of_body(simd, pair, &touching.body, body, deep, &mut sink);
        deep::of_obstacle(simd, pair, &touching.obstacle, obstacle, deep, &mut sink);
        sink.least
    }
}

/// What a query found.
#[derive(Clone, Copy, Debug)]
pub struct QueryResult<'a> {
    /// Exact least distance of the surfaces, in metres, when it is within the tolerance; where they cross, the greatest
    /// depth with a negative sign; infinite when nothing is within the tolerance.
    pub min_distance: f64,
    /// All contacts, in an order that depends on nothing but the surfaces and their poses.
    pub contacts: &'a [Contact],
}

/// Finds where two surfaces are closer than `tolerance` (metres) or cross.
///
/// `world_from_body` and `world_from_obstacle` are the poses of the mesh frames in the world, and so are the contacts. A
/// pose or tolerance that is not finite, or a negative tolerance, finds nothing; a tolerance of zero finds what crosses. Not for the haptic thread: the time
/// depends on the contact.
pub fn query<'a>(
    body: &Surface,
    world_from_body: &Isometry3<f64>,
    obstacle: &Surface,
    world_from_obstacle: &Isometry3<f64>,
    tolerance: f64,
    workspace: &'a mut QueryWorkspace,
) -> QueryResult<'a> {
    workspace.contacts.clear();
    let relative = world_from_obstacle.inv_mul(world_from_body);
    let valid =
        tolerance >= 0.0 && tolerance.is_finite() && is_finite(&relative) && is_finite(world_from_obstacle);
    if !valid || body.nodes.is_empty() || obstacle.nodes.is_empty() {
        return QueryResult { min_distance: f64::INFINITY, contacts: &workspace.contacts };
    }
    let tolerance = tolerance.clamp(LEAST_TOLERANCE, GREATEST_TOLERANCE);
    let offset = relative.translation.vector.amax();
    if offset > tolerance + body.radius + obstacle.radius {
        return QueryResult { min_distance: f64::INFINITY, contacts: &workspace.contacts };
    }
    let motion = Rigid::from_isometry(&relative);
    let inverse = Rigid::from_isometry(&relative.inverse());
    let mut pair = Pair { body, obstacle, motion: &motion, inverse: &inverse, tolerance, travelled: 0.0 };
    let world_from_obstacle = Rigid::from_isometry(world_from_obstacle);
    let min_distance = dispatch!(Level::new(), simd => workspace.run(simd, &mut pair, world_from_obstacle));
    QueryResult { min_distance, contacts: &workspace.contacts }
}

fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|c| c.is_finite())
}
