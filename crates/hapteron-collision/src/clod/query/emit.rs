//! Contacts of samples with their feet.

use super::Pair;
use super::least::Least;
use super::plan::Planned;
use crate::contact::Contact;
use crate::query::feature::{Feature, Foot};
use crate::surface::VertexNormal;
use crate::vector::{Rigid, Vec3, dot, scale};
use nalgebra::Vector3;

/// Where the samples of one side go.
pub(super) struct Emit<'a> {
    pub pair: &'a Pair<'a>,
    /// Of the obstacle's frame in the world.
    pub world: &'a Rigid,
    /// 0 for samples of the body.
    pub side: usize,
    pub contacts: &'a mut Vec<Contact>,
    pub least: &'a mut Least,
}

impl Emit<'_> {
    /// A sample, which is at `point` in the other surface's frame, with its foot there.
    #[inline(always)]
    pub(super) fn sample(&mut self, sample: &Planned, point: Vec3, foot: &Foot) {
        self.least.offer(self.side, sample.vertex, foot.signed_distance);
        if self.side == 0 { self.of_body(sample, point, foot) } else { self.of_obstacle(sample, foot) }
    }

    #[inline(always)]
    fn of_body(&mut self, sample: &Planned, point: Vec3, foot: &Foot) {
        let Pair { body, obstacle, motion, .. } = self.pair;
        let (normal, own) = (scale(foot.normal, -1.0), &sample.normal);
        if faces(own, motion.direction(own.normal.map(f64::from)), normal, foot.signed_distance) {
            let features =
                [Feature::Vertex(sample.vertex).number(body.surface), foot.feature.number(obstacle.surface)];
            self.push([point, foot.point], normal, foot, sample.weight, features);
        }
    }

    #[inline(always)]
    fn of_obstacle(&mut self, sample: &Planned, foot: &Foot) {
        let Pair { body, obstacle, motion, .. } = self.pair;
        let (normal, own) = (motion.direction(foot.normal), &sample.normal);
        if faces(own, own.normal.map(f64::from), scale(normal, -1.0), foot.signed_distance) {
            let features =
                [foot.feature.number(body.surface), Feature::Vertex(sample.vertex).number(obstacle.surface)];
            self.push([motion.point(foot.point), sample.own], normal, foot, sample.weight, features);
        }
    }

    /// `points` on body and obstacle and `normal` are in the obstacle's frame.
    #[inline(always)]
    fn push(
        &mut self,
        points: [Vec3; 2],
        normal: Vec3,
        foot: &Foot,
        weight: f32,
        [body_feature, obstacle_feature]: [u32; 2],
    ) {
        self.contacts.push(Contact {
            point_body: Vector3::from(self.world.point(points[0])),
            point_obstacle: Vector3::from(self.world.point(points[1])),
            normal: Vector3::from(self.world.direction(normal)),
            depth: -foot.signed_distance,
            weight: f64::from(weight),
            body_feature,
            obstacle_feature,
        });
    }
}

/// Whether a surface with this vertex can touch along `direction` (outward); the rule of the exact query.
#[inline(always)]
fn faces(vertex: &VertexNormal, normal: Vec3, direction: Vec3, signed_distance: f64) -> bool {
    let cone = f64::from(vertex.cone);
    dot(normal, direction) >= if signed_distance <= 0.0 { cone.min(0.0) } else { cone }
}
