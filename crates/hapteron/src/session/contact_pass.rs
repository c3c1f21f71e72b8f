//! The contact pass: from the state of the body to the planes that hold it back.

use super::Flags;
use super::command::ContactLaw;
use super::thinning::{Candidate, Thinning};
use crate::scene::{ContactModel, Scene, handle_at};
use hapteron_collision::clod::{LodWorkspace, query_levels};
use hapteron_collision::cluster::{ClusterParameters, Clusterer};
use hapteron_collision::{Contact, QueryWorkspace, query};
use hapteron_device::DeviceSample;
use hapteron_dynamics::{ContactPlane, Handle, LinearizedContact, RigidBody, State};
use nalgebra::{Isometry3, Vector3};

/// Most planes that a snapshot holds; of more contacts the deepest of each neighbourhood are kept and a flag says so.
pub const MAX_PLANES: usize = 1024;
/// Anticipation margin with `anticipation = "auto"`: this many times speed * (period + latency) ...
const ANTICIPATED_TIMES: f64 = 1.5;
/// ... but no more than this share of the body's radius, beyond which queries cost more than they tell.
const GREATEST_MARGIN: f64 = 0.1;

/// What a pass found, at one state of the body.
///
/// Its lists have their full capacity from the start, those of its clones as well: filling one anew does not allocate.
#[derive(Debug)]
pub struct ContactSnapshot {
    pub(super) time: f64,
    planes: Vec<ContactPlane>,
    linearized: LinearizedContact,
    is_linearized: bool,
    contacts: u32,
    clusters: u32,
    min_distance: f64,
    flags: Flags,
}

impl Clone for ContactSnapshot {
    fn clone(&self) -> Self {
        let mut planes = Vec::with_capacity(MAX_PLANES);
        planes.extend_from_slice(&self.planes);
        Self { planes, ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        let mut planes = std::mem::take(&mut self.planes);
        planes.clear();
        planes.extend_from_slice(&source.planes);
        *self = Self { planes, ..*source };
    }
}

impl ContactSnapshot {
    /// Knows of no contacts.
    #[must_use]
    pub fn empty(body: &RigidBody, state: &State) -> Self {
        Self {
            time: 0.0,
            planes: Vec::with_capacity(MAX_PLANES),
            linearized: LinearizedContact::from_planes(&[], body, state),
            is_linearized: true,
            contacts: 0,
            clusters: 0,
            min_distance: f64::INFINITY,
            flags: Flags::NO_CONTACTS_YET,
        }
    }

    /// Contacts that were found by other means than a [`ContactPass`], at a state of `time`; no more than [`MAX_PLANES`] are taken.
    #[must_use]
    pub fn of_planes(planes: &[ContactPlane], body: &RigidBody, state: &State, time: f64) -> Self {
        let mut snapshot = Self::empty(body, state);
        let (planes, thinned) = (&planes[..planes.len().min(MAX_PLANES)], planes.len() > MAX_PLANES);
        snapshot.planes.extend_from_slice(planes);
        snapshot.linearized = LinearizedContact::from_planes(planes, body, state);
        snapshot.contacts = planes.len() as u32;
        snapshot.clusters = planes.len() as u32;
        snapshot.flags = if thinned { Flags::CONTACTS_THINNED } else { Flags::default() };
        snapshot.time = time;
        snapshot
    }

    /// The planes, those of the anticipation margin included.
    #[must_use]
    pub fn planes(&self) -> &[ContactPlane] {
        &self.planes
    }

    /// Wrench and Jacobian at the snapshot's state. Eq. 30.
    #[must_use]
    pub fn linearized(&self) -> &LinearizedContact {
        &self.linearized
    }

    /// Whether [`ContactSnapshot::linearized`] belongs to the planes.
    #[must_use]
    pub fn is_linearized(&self) -> bool {
        self.is_linearized
    }

    /// When the body was in the state that was looked at, seconds.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// How many contacts the query found.
    #[must_use]
    pub fn contacts(&self) -> u32 {
        self.contacts
    }

    /// How many planes came of them.
    #[must_use]
    pub fn clusters(&self) -> u32 {
        self.clusters
    }

    /// Of the surfaces at the snapshot's state, negative where they cross, metres; infinite when nothing was within the query's tolerance.
    #[must_use]
    pub fn min_distance(&self) -> f64 {
        self.min_distance
    }

    /// Bits that every tick with this snapshot carries.
    #[must_use]
    pub fn flags(&self) -> Flags {
        self.flags
    }

    /// Fills the snapshot with planes at a state.
    ///
    /// Frames: world, the points of the body relative to its centre of mass in body axes.
    fn fill(
        &mut self,
        planes: &[Candidate],
        thinned: bool,
        body: &RigidBody,
        state: &State,
        model: ContactModel,
    ) {
        self.flags = if thinned { Flags::CONTACTS_THINNED } else { Flags::default() };
        self.planes.clear();
        self.planes.extend(planes.iter().map(|c| c.1));
        self.clusters = self.planes.len() as u32;
        self.is_linearized = model != ContactModel::Planes;
        if self.is_linearized {
            self.linearized = LinearizedContact::from_planes(&self.planes, body, state);
        }
    }
}

/// What a pass looks at.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The body's state.
    pub state: State,
    /// The body, whose mass may have been changed.
    pub body: RigidBody,
    /// Of the point of the body that the handle would move fastest, m/s.
    pub handle_speed: f64,
    /// When the body was in the state, seconds.
    pub time: f64,
    /// How long it takes from this state until the next pass's contacts take over, seconds.
    pub ahead: f64,
    /// Of the planes to be made.
    pub law: ContactLaw,
    /// What the tick will make of them.
    pub model: ContactModel,
}

/// Memory of the queries against one obstacle.
#[derive(Debug, Default)]
struct Workspace {
    exact: QueryWorkspace,
    levels: LodWorkspace,
}

/// Which nodes of the contact levels a query made its contacts with, by obstacle: those of the body, those of the obstacle. For pictures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelsInUse {
    /// Empty where a scene is exact.
    pub fronts: Vec<[Vec<u32>; 2]>,
}

/// Runs passes; holds what one pass leaves for the next. Not for the haptic thread: it allocates as contacts grow.
#[derive(Debug)]
pub struct ContactPass {
    workspaces: Vec<Workspace>,
    measuring: Vec<QueryWorkspace>,
    clusterer: Option<Clusterer>,
    contacts: Vec<Contact>,
    candidates: Vec<Candidate>,
    thinning: Thinning,
}

impl ContactPass {
    /// For a scene.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let settings = &scene.contact;
        let parameters =
            ClusterParameters { max_clusters: settings.max_clusters, radius: settings.cluster_radius };
        Self {
            workspaces: scene.obstacles.iter().map(|_| Workspace::default()).collect(),
            measuring: scene.obstacles.iter().map(|_| QueryWorkspace::new()).collect(),
            clusterer: (settings.max_clusters > 0).then(|| Clusterer::new(parameters)),
            contacts: Vec::new(),
            candidates: Vec::new(),
            thinning: Thinning::default(),
        }
    }

    /// Finds the contacts at a state of `time` and fills a snapshot with their planes. `handle_speed` (m/s, that of the point of the
    /// body that the handle would move fastest) tells how far to look ahead.
    pub fn run(
        &mut self,
        scene: &Scene,
        state: &State,
        handle_speed: f64,
        time: f64,
        snapshot: &mut ContactSnapshot,
    ) {
        let contact = &scene.contact;
        let view = View {
            state: *state,
            body: scene.body,
            handle_speed,
            time,
            ahead: contact.period + contact.latency,
            law: ContactLaw { stiffness: contact.stiffness, damping: contact.damping },
            model: contact.model,
        };
        self.look(scene, &view, snapshot);
    }

    /// As [`ContactPass::run`], with what a running session can change. Answers how many of the contacts that it found are beyond d.
    pub fn look(&mut self, scene: &Scene, view: &View, snapshot: &mut ContactSnapshot) -> u32 {
        let settings = &scene.contact;
        let View { state, time, law, .. } = view;
        let reach = settings.tolerance + self.margin(scene, view);
        let world_from_mesh = scene.world_from_mesh(state);
        self.contacts.clear();
        let mut min_distance = f64::INFINITY;
        for (obstacle, workspace) in scene.obstacles.iter().zip(&mut self.workspaces) {
            let found = match (scene.model.lod(), obstacle.model.lod()) {
                (Some(body), Some(other)) => query_levels(
                    body,
                    &world_from_mesh,
                    other,
                    &obstacle.world_from_mesh,
                    reach,
                    &settings.detail,
                    &mut workspace.levels,
                ),
                _ => query(
                    &scene.model.surface,
                    &world_from_mesh,
                    &obstacle.model.surface,
                    &obstacle.world_from_mesh,
                    reach,
                    &mut workspace.exact,
                ),
            };
            min_distance = min_distance.min(found.min_distance);
            self.contacts.extend_from_slice(found.contacts);
        }
        snapshot.time = *time;
        snapshot.min_distance = min_distance;
        snapshot.contacts = self.contacts.len() as u32;
        self.candidates.clear();
        let rotation = state.unit_quaternion();
        let mut add = |point: &Vector3<f64>,
                       on_obstacle: &Vector3<f64>,
                       normal: Vector3<f64>,
                       depth: f64,
                       weight: f64| {
            let point_b = rotation.inverse_transform_vector(&(point - state.position));
            let plane = ContactPlane::new(
                point_b,
                on_obstacle,
                normal,
                weight * law.stiffness,
                weight * law.damping,
                settings.tolerance,
            );
            self.candidates.push((depth, plane));
        };
        let d = settings.tolerance;
        if let Some(clusterer) = &mut self.clusterer {
            // What is beyond d has no weight in a cluster; it stays a plane of its own, or a far one would hold a near one off.
            for c in clusterer.update(&self.contacts, d, &world_from_mesh) {
                add(&c.point_body, &c.point_obstacle, c.normal, c.depth, 1.0);
            }
        }
        let alone = |c: &&Contact| settings.max_clusters == 0 || c.depth <= -d;
        for c in self.contacts.iter().filter(alone) {
            add(&c.point_body, &c.point_obstacle, c.normal, c.depth, c.weight);
        }
        let radius = scene.model.surface.radius();
        let thinned = self.thinning.thin(&mut self.candidates, radius, MAX_PLANES);
        snapshot.fill(&self.candidates, thinned, &view.body, state, view.model);
        self.contacts.iter().filter(|c| c.depth <= -d).count() as u32
    }

    /// Whether the next looks note which contact levels they use.
    pub fn watch_levels(&mut self, on: bool) {
        self.workspaces.iter_mut().for_each(|w| w.levels.watch(on));
    }

    /// The contact levels that the last look used; empty unless it was watched.
    pub fn levels_in_use(&self, into: &mut LevelsInUse) {
        into.fronts.resize(self.workspaces.len(), Default::default());
        for (to, from) in into.fronts.iter_mut().zip(&self.workspaces) {
            for (to, from) in to.iter_mut().zip(from.levels.front()) {
                to.clear();
                to.extend_from_slice(from);
            }
        }
    }

    /// The signed distance of the surfaces at a state, metres; infinite when it is more than the tolerance d.
    pub fn measure(&mut self, scene: &Scene, state: &State) -> f64 {
        self.measure_at(scene, &scene.world_from_mesh(state))
    }

    /// As [`ContactPass::measure`], at a pose of the body's mesh frame.
    pub fn measure_at(&mut self, scene: &Scene, world_from_mesh: &Isometry3<f64>) -> f64 {
        let mut min_distance = f64::INFINITY;
        for (obstacle, workspace) in scene.obstacles.iter().zip(&mut self.measuring) {
            let found = query(
                &scene.model.surface,
                world_from_mesh,
                &obstacle.model.surface,
                &obstacle.world_from_mesh,
                scene.contact.tolerance,
                workspace,
            );
            min_distance = min_distance.min(found.min_distance);
        }
        min_distance
    }

    /// How far beyond d contacts are looked for, metres: as far as a point of the body can come until the pass after this one takes over.
    ///
    /// Only planes, which never pull, make use of what is beyond d; the other models are given the same query, for equal depths.
    fn margin(&self, scene: &Scene, view: &View) -> f64 {
        let settings = &scene.contact;
        if let Some(metres) = settings.anticipation {
            return metres;
        }
        let radius = scene.model.surface.radius();
        let norm = |v: Vector3<f64>| libm::sqrt(v.norm_squared());
        let (state, body) = (&view.state, &view.body);
        let speed = norm(state.linear_velocity(body)) + norm(state.angular_velocity(body)) * radius;
        let ahead = ANTICIPATED_TIMES * speed.max(view.handle_speed) * view.ahead;
        ahead.max(settings.tolerance).min(GREATEST_MARGIN * radius)
    }
}

/// Speed of the fastest point that would move with the handle, m/s.
#[must_use]
pub fn handle_speed(scene: &Scene, handle: &Handle) -> f64 {
    let norm = |v: Vector3<f64>| libm::sqrt(v.norm_squared());
    norm(handle.linear_velocity) + norm(handle.angular_velocity) * scene.model.surface.radius()
}

/// The same of a device's sample.
pub(super) fn sample_speed(scene: &Scene, sample: &DeviceSample) -> f64 {
    handle_speed(scene, &handle_at(&scene.scaling.to_world(sample)))
}
