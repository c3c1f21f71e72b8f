//! Collecting what a query finds.

use super::Pair;
use super::feature::Feature;
use crate::contact::Contact;
use crate::vector::{Rigid, Vec3};
use nalgebra::Vector3;

/// A contact in the obstacle's mesh frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub point_body: Vec3,
    pub point_obstacle: Vec3,
    /// Unit, outward from the body.
    pub normal: Vec3,
    pub depth: f64,
    /// On the body and on the obstacle.
    pub features: [Feature; 2],
}

/// Where contacts go: it turns them into the world frame and keeps the least distance.
pub(super) struct Sink<'a> {
    pub pair: Pair<'a>,
    pub world_from_obstacle: Rigid,
    pub contacts: &'a mut Vec<Contact>,
    /// Signed; infinite until something is found.
    pub least: f64,
}

impl Sink<'_> {
    /// Puts the contacts from number `first` on in the order of their features: what finds them goes by near leaves, and the order of
    /// those depends on how far ahead the walk looked.
    pub(super) fn sort_from(&mut self, first: usize) {
        self.contacts[first..].sort_unstable_by_key(|c| (c.body_feature, c.obstacle_feature));
    }

    #[inline(always)]
    pub(super) fn push(&mut self, found: Found) {
        self.push_in_part(found, 1.0);
    }

    /// The same for a contact that counts for less than one.
    #[inline(always)]
    pub(super) fn push_in_part(&mut self, found: Found, weight: f64) {
        self.least = self.least.min(-found.depth);
        let point_body = self.world_from_obstacle.point(found.point_body);
        let point_obstacle = self.world_from_obstacle.point(found.point_obstacle);
        let normal = self.world_from_obstacle.direction(found.normal);
        self.contacts.push(Contact {
            point_body: Vector3::from(point_body),
            point_obstacle: Vector3::from(point_obstacle),
            normal: Vector3::from(normal),
            depth: found.depth,
            weight,
            body_feature: found.features[0].number(self.pair.body),
            obstacle_feature: found.features[1].number(self.pair.obstacle),
        });
    }
}
