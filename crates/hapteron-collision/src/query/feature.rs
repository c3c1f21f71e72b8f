//! The closest feature of a triangle to a point, and on which side of the surface the point lies.

use crate::surface::{EdgeKind, Surface, VertexNormal};
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub, unit_or};

/// Distances below this (metres) have no direction of their own: the feature's normal is taken.
const TOUCHING: f64 = 1e-12;

/// A feature of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    Vertex(u32),
    Edge(u32),
    Face(u32),
}

impl Feature {
    /// One number for all features of a surface: vertices first, then edges, then faces.
    pub(crate) fn number(self, surface: &Surface) -> u32 {
        match self {
            Self::Vertex(i) => i,
            Self::Edge(i) => surface.vertices.len() as u32 + i,
            Self::Face(i) => (surface.vertices.len() + surface.edges.len()) as u32 + i,
        }
    }
}

/// The foot of a point on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    pub point: Vec3,
    pub feature: Feature,
    /// Distance with its sign: negative inside.
    pub signed_distance: f64,
    /// Unit, outward from the surface: along the perpendicular, or the feature's normal where that has no length.
    pub normal: Vec3,
}

/// The point of a triangle closest to `p`, by region (Ericson 5.1.5).
#[inline(always)]
pub(super) fn closest_on_triangle(
    p: Vec3,
    corners: [Vec3; 3],
    triangle: u32,
    surface: &Surface,
) -> (Vec3, Feature) {
    let [a, b, c] = corners;
    let vertex = |k: usize| Feature::Vertex(surface.triangles[triangle as usize][k]);
    let edge = |k: usize| Feature::Edge(surface.triangle_edges[triangle as usize][k]);
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, vertex(0));
    }
    let (aa, bc, cc) = (dot(ab, ab), dot(ab, ac), dot(ac, ac));
    let (d3, d4) = (d1 - aa, d2 - bc);
    if d3 >= 0.0 && d4 <= d3 {
        return (b, vertex(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (add(a, scale(ab, d1 / aa)), edge(0));
    }
    let (d5, d6) = (d1 - bc, d2 - cc);
    if d6 >= 0.0 && d5 <= d6 {
        return (c, vertex(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (add(a, scale(ac, d2 / cc)), edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    let (toward_c, toward_b) = (d4 - d3, d5 - d6);
    if va <= 0.0 && toward_c >= 0.0 && toward_b >= 0.0 {
        return (add(b, scale(sub(c, b), toward_c / (toward_c + toward_b))), edge(1));
    }
    let whole = va + vb + vc;
    if whole <= 0.0 {
        return (a, vertex(0));
    }
    (add(a, add(scale(ab, vb / whole), scale(ac, vc / whole))), Feature::Face(triangle))
}

/// Foot of `p` on one triangle of the surface, with the side taken from the closest feature's normal.
#[inline(always)]
pub(crate) fn foot(p: Vec3, triangle: u32, surface: &Surface) -> Foot {
    foot_between(p, corners(triangle, surface), triangle, surface)
}

/// The corners of a triangle.
#[inline(always)]
pub(crate) fn corners(triangle: u32, surface: &Surface) -> [Vec3; 3] {
    surface.triangles[triangle as usize].map(|v| surface.vertices[v as usize])
}

/// [`foot`] for a caller that has the triangle's corners.
#[inline(always)]
pub(crate) fn foot_between(p: Vec3, corners: [Vec3; 3], triangle: u32, surface: &Surface) -> Foot {
    let (point, feature) = closest_on_triangle(p, corners, triangle, surface);
    let from = sub(p, point);
    let distance = norm(from);
    let face = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
    let (outward, sided) = match feature {
        Feature::Face(_) => (face, true),
        Feature::Edge(e) => {
            let edge = &surface.edges[e as usize];
            (edge.normal.map(f64::from), matches!(edge.kind, EdgeKind::Convex | EdgeKind::Hollow))
        }
        Feature::Vertex(v) => {
            let n = &surface.vertex_normals[v as usize];
            (n.normal.map(f64::from), n.cone != VertexNormal::OPEN)
        }
    };
    if distance < TOUCHING {
        return Foot { point, feature, signed_distance: 0.0, normal: unit_or(outward, face) };
    }
    let inside = sided && dot(from, outward) < 0.0;
    let sign = if inside { -1.0 } else { 1.0 };
    Foot { point, feature, signed_distance: sign * distance, normal: scale(from, sign / distance) }
}
