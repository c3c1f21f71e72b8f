//! For every vertex near the other surface its foot there, its side and its contact.

use super::Pair;
use super::feature::{self, Feature, Foot};
use super::kernel::{self, LeafBounds};
use super::result::{Found, Sink};
use super::side::{NOWHERE, Side};
use super::walk::{Neighbourhood, Neighbours};
use crate::surface::{LANES, Surface, VertexNormal};
use crate::vector::{Rigid, Vec3, dot, scale};

/// Where the vertices of one surface look for their feet on the other.
struct Search<'a> {
    own: &'a Surface,
    other: &'a Surface,
    neighbours: &'a Neighbours,
    /// From the own frame to the other's.
    motion: &'a Rigid,
    tolerance: f64,
    /// Rounding of single-precision coordinates, metres.
    slack: f32,
}

/// Bounds of the leaves in a neighbourhood, eight at a time; kept to reuse its memory.
pub(super) type Scratch = Vec<LeafBounds>;

/// Gives every vertex of the body within the tolerance its signed distance, and makes its contact.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn of_body(
    pair: Pair<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    scratch: &mut Scratch,
    sink: &mut Sink<'_>,
) {
    let search = Search {
        own: pair.body,
        other: pair.obstacle,
        neighbours,
        motion: pair.motion,
        tolerance: pair.tolerance,
        slack: pair.slack() as f32,
    };
    run(&search, side, scratch, |vertex, point, foot| push_body_vertex(pair, vertex, point, foot, sink));
}

/// The same for the vertices of the obstacle.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn of_obstacle(
    pair: Pair<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    scratch: &mut Scratch,
    sink: &mut Sink<'_>,
) {
    let search = Search {
        own: pair.obstacle,
        other: pair.body,
        neighbours,
        motion: pair.inverse,
        tolerance: pair.tolerance,
        slack: pair.slack() as f32,
    };
    run(&search, side, scratch, |vertex, _, foot| push_obstacle_vertex(pair, vertex, foot, sink));
}

#[inline(always)]
fn run(search: &Search<'_>, side: &mut Side, scratch: &mut Scratch, mut push: impl FnMut(u32, Vec3, &Foot)) {
    for &Neighbourhood { leaf, begin, end } in &search.neighbours.of {
        let near = &search.neighbours.near[begin as usize..end as usize];
        scratch.clear();
        for eight in near.chunks(LANES) {
            scratch.push(LeafBounds::gather(search.other, eight));
        }
        let own = &search.own.leaves[leaf as usize];
        for vertex in own.first_vertex..own.first_vertex + u32::from(own.vertices) {
            let point = search.motion.point(search.own.vertices[vertex as usize]);
            let last = &mut side.last[vertex as usize];
            let triangle = nearest_triangle(search, point, near, scratch, last);
            if triangle == NOWHERE {
                continue;
            }
            let foot = feature::foot(point, triangle, search.other);
            side.signed[vertex as usize] = foot.signed_distance;
            side.found.push(vertex);
            push(vertex, point, &foot);
        }
    }
}

/// The closest triangle so far.
struct Nearest {
    squared: f64,
    triangle: u32,
    leaf: u32,
}

impl Nearest {
    #[inline(always)]
    fn look(&mut self, surface: &Surface, leaf: u32, point: Vec3) {
        let (squared, lane) = kernel::point_triangles(point, &surface.blocks[leaf as usize]);
        if squared < self.squared {
            let triangle = surface.leaves[leaf as usize].triangle(lane);
            *self = Self { squared, triangle, leaf };
        }
    }
}

/// The closest triangle within the tolerance among the leaves in `near`; `last` is the leaf to look in first, and becomes
/// the one where it was.
#[inline(always)]
fn nearest_triangle(
    search: &Search<'_>,
    point: Vec3,
    near: &[u32],
    bounds: &[LeafBounds],
    last: &mut u32,
) -> u32 {
    let mut nearest =
        Nearest { squared: search.tolerance * search.tolerance, triangle: NOWHERE, leaf: NOWHERE };
    let mut first = *last;
    if first != NOWHERE {
        nearest.look(search.other, first, point);
    }
    let point32 = point.map(|c| c as f32);
    for (eight, bounds) in near.chunks(LANES).zip(bounds) {
        let (lower, mut mask) = bounds.lower(point32, search.slack, nearest.squared as f32 * (1.0 + 1e-6));
        // Without a first guess begin with the closest box: its triangles usually rule out the others.
        let mut lane =
            if first == NOWHERE { kernel::first_least32(&lower) } else { mask.trailing_zeros() as usize };
        while mask != 0 {
            mask &= !(1 << lane);
            if f64::from(lower[lane]) < nearest.squared * (1.0 + 1e-6) && eight[lane] != first {
                nearest.look(search.other, eight[lane], point);
            }
            lane = mask.trailing_zeros() as usize;
        }
        first = if nearest.leaf != NOWHERE && first == NOWHERE { nearest.leaf } else { first };
    }
    *last = nearest.leaf;
    nearest.triangle
}

/// The contact of a vertex of the body with its foot on the obstacle, both in the obstacle's frame.
#[inline(always)]
pub(super) fn push_body_vertex(pair: Pair<'_>, vertex: u32, point: Vec3, foot: &Foot, sink: &mut Sink<'_>) {
    sink.least = sink.least.min(foot.signed_distance);
    let normal = scale(foot.normal, -1.0);
    let own = &pair.body.vertex_normals[vertex as usize];
    if !faces(own, pair.motion.direction(own.normal.map(f64::from)), normal, foot.signed_distance) {
        return;
    }
    sink.push(Found {
        point_body: point,
        point_obstacle: foot.point,
        normal,
        depth: -foot.signed_distance,
        features: [Feature::Vertex(vertex), foot.feature],
    });
}

/// The contact of a vertex of the obstacle with its foot on the body, which is in the body's frame.
#[inline(always)]
pub(super) fn push_obstacle_vertex(pair: Pair<'_>, vertex: u32, foot: &Foot, sink: &mut Sink<'_>) {
    sink.least = sink.least.min(foot.signed_distance);
    let normal = pair.motion.direction(foot.normal);
    let own = &pair.obstacle.vertex_normals[vertex as usize];
    if !faces(own, own.normal.map(f64::from), scale(normal, -1.0), foot.signed_distance) {
        return;
    }
    sink.push(Found {
        point_body: pair.motion.point(foot.point),
        point_obstacle: pair.obstacle.vertices[vertex as usize],
        normal,
        depth: -foot.signed_distance,
        features: [foot.feature, Feature::Vertex(vertex)],
    });
}

/// Whether a surface with this vertex can touch along `direction` (outward). Refused are the far sides of thin walls, and
/// flanks that lean away so much that a nearer contact stands beside them. A vertex inside must only not face backwards.
#[inline(always)]
fn faces(vertex: &VertexNormal, normal: Vec3, direction: Vec3, signed_distance: f64) -> bool {
    let cone = f64::from(vertex.cone);
    dot(normal, direction) >= if signed_distance <= 0.0 { cone.min(0.0) } else { cone }
}
