//! The result of a query: one close or crossing place of two surfaces.

use nalgebra::Vector3;

/// One place where the surface of the grasped body and that of an obstacle are closer than the tolerance, or cross.
///
/// World frame, metres. It is the contact of section 6.1 of Otaduy and Lin 2005: `point_body` is the paper's **p**,
/// `point_obstacle` its **p0**, `normal` its **n** and `depth` its delta, and `depth == (point_body - point_obstacle).dot(normal)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// **p**: the point on the surface of the grasped body.
    pub point_body: Vector3<f64>,
    /// **p0**: the point on the surface of the obstacle.
    pub point_obstacle: Vector3<f64>,
    /// **n**: unit normal, outward from the grasped body, that is, from the body towards the obstacle.
    pub normal: Vector3<f64>,
    /// delta: positive when `point_body` lies inside the obstacle, negative when it lies outside but closer than the tolerance.
    pub depth: f64,
    /// Share of the surface that this contact stands for, relative to the others; 1 unless a caller weights contacts.
    pub weight: f64,
    /// Where on the body's surface: a number that stays with the same piece of surface for the life of the surface.
    pub body_feature: u32,
    /// Where on the obstacle's surface, likewise.
    pub obstacle_feature: u32,
}
