//! Contact clusters: a few representatives for many contacts, by weighted K-means (section 6.1 and reference 20).
//!
//! A contact weighs `weight * (tolerance + depth)`, so it is born and dies without weight and a representative moves
//! continuously while contacts come and go. Clusters keep their number between queries: each starts from where the last
//! representative is, carried along with the body. Contacts are sorted by feature first, so their order does not matter.

mod means;

use crate::contact::Contact;
use means::Sample;
use nalgebra::{Isometry3, Point3, Vector3};

/// How contacts are clustered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClusterParameters {
    /// Most clusters, at least 1.
    pub max_clusters: usize,
    /// A contact farther than this from every cluster founds one of its own, metres; clusters closer than half of it with alike normals join.
    pub radius: f64,
}

/// The representative of a cluster: a contact whose position, normal and depth are weighted means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster {
    /// Stays with a cluster from query to query.
    pub id: u64,
    /// **p**, world, metres.
    pub point_body: Vector3<f64>,
    /// **p0** = p - depth n, world, metres.
    pub point_obstacle: Vector3<f64>,
    /// **n**, unit, outward from the body, world.
    pub normal: Vector3<f64>,
    /// delta, metres, positive inside.
    pub depth: f64,
    /// Sum of the contacts' weights, metres.
    pub weight: f64,
    /// How many contacts it stands for.
    pub contacts: usize,
}

/// A representative of the last query, in the body's mesh frame.
#[derive(Clone, Copy, Debug)]
struct Seed {
    id: u64,
    point: Point3<f64>,
    normal: Vector3<f64>,
}

/// Clusters contacts, query after query.
#[derive(Clone, Debug)]
pub struct Clusterer {
    parameters: ClusterParameters,
    next_id: u64,
    seeds: Vec<Seed>,
    samples: Vec<Sample>,
    centers: Vec<means::Center>,
    clusters: Vec<Cluster>,
    ignored: u64,
}

impl Clusterer {
    /// A clusterer without clusters; no maximum and a radius that is not positive count as 1 and infinite.
    #[must_use]
    pub fn new(parameters: ClusterParameters) -> Self {
        let radius = if parameters.radius > 0.0 { parameters.radius } else { f64::INFINITY };
        let max_clusters = parameters.max_clusters.max(1);
        Self {
            parameters: ClusterParameters { max_clusters, radius },
            next_id: 0,
            seeds: Vec::new(),
            samples: Vec::new(),
            centers: Vec::new(),
            clusters: Vec::new(),
            ignored: 0,
        }
    }

    /// How many contacts were left out so far because a number of theirs was not finite.
    #[must_use]
    pub fn ignored(&self) -> u64 {
        self.ignored
    }

    /// Clusters the contacts of a query with this tolerance (metres), made with the body at this pose of its mesh frame.
    pub fn update(
        &mut self,
        contacts: &[Contact],
        tolerance: f64,
        world_from_body: &Isometry3<f64>,
    ) -> &[Cluster] {
        self.collect(contacts, tolerance);
        self.centers.clear();
        let reach = 2.0 * self.parameters.radius;
        for seed in &self.seeds {
            let point = (world_from_body * seed.point).coords;
            if self.samples.iter().any(|s| (s.point - point).norm_squared() < reach * reach) {
                let normal = world_from_body * seed.normal;
                self.centers.push(means::Center::new(Some(seed.id), point, normal));
            }
        }
        means::cluster(&self.parameters, &self.samples, &mut self.centers);
        self.clusters.clear();
        for center in &self.centers {
            let id = center.id.unwrap_or_else(|| {
                self.next_id += 1;
                self.next_id - 1
            });
            self.clusters.push(Cluster {
                id,
                point_body: center.point,
                point_obstacle: center.point - center.normal * center.depth,
                normal: center.normal,
                depth: center.depth,
                weight: center.weight,
                contacts: center.contacts,
            });
        }
        self.seeds.clear();
        self.seeds.extend(self.clusters.iter().map(|c| Seed {
            id: c.id,
            point: world_from_body.inverse_transform_point(&Point3::from(c.point_body)),
            normal: world_from_body.inverse_transform_vector(&c.normal),
        }));
        &self.clusters
    }

    fn collect(&mut self, contacts: &[Contact], tolerance: f64) {
        self.samples.clear();
        for contact in contacts {
            let weight = contact.weight * (tolerance + contact.depth).max(0.0);
            let finite = contact.point_body.iter().chain(contact.normal.iter()).all(|c| c.is_finite());
            if !(finite && weight.is_finite() && contact.depth.is_finite()) {
                self.ignored += 1;
                continue;
            }
            self.samples.push(Sample {
                order: (contact.body_feature, contact.obstacle_feature),
                point: contact.point_body,
                normal: contact.normal,
                depth: contact.depth,
                weight,
                center: 0,
            });
        }
        // The position decides between contacts of the same features, for a total order.
        let key = |s: &Sample| (s.order, s.point.x, s.point.y, s.point.z, s.depth);
        self.samples.sort_unstable_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.0.cmp(&b.0)
                .then(a.1.total_cmp(&b.1))
                .then(a.2.total_cmp(&b.2))
                .then(a.3.total_cmp(&b.3))
                .then(a.4.total_cmp(&b.4))
        });
    }
}
