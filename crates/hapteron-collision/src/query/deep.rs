//! What lies deeper inside the other surface than the tolerance.
//!
//! The vertices within the tolerance do not show it, and a contact that ended at some depth would let a hard push through. So
//! edges with an end that is far are tried against the faces near them, and from every vertex that is inside, its edges are followed
//! to further ones, unless they have come out through a face: each vertex found gets its exact foot, whatever its depth. Only a
//! closed and oriented surface has an inside; behind an open one nothing is followed.

use super::Pair;
use super::feature::{Feature, Foot};
use super::kernel::{self, Box32};
use super::nearest::Nearest;
use super::result::{Found, Sink};
use super::ridges::pierces;
use super::side::{Clear, Side};
use super::vertices::{push_body_vertex, push_obstacle_vertex};
use super::walk::{Neighbourhood, Neighbours, Slab};
use crate::surface::{LANES, Surface};
use crate::vector::{Rigid, Vec3, add, dot, norm, scale, sub};

/// Lists to be reused.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    /// Vertices inside whose edges are to be followed.
    open: Vec<u32>,
    /// Edges that run through an odd number of faces: one end is inside, the other outside.
    crossed: Vec<u32>,
    /// Edges of a leaf that may run through something no vertex shows.
    long: Vec<u32>,
    /// Leaves of the other surface that one leaf may cross.
    touching: Vec<u32>,
    /// Where one edge runs through faces, as shares of it.
    crossings: Vec<f64>,
    nearest: Nearest,
    /// By neighbourhood of the last walk, for the body and the obstacle: until when no leaf can touch it.
    pub apart: [Vec<Clear>; 2],
}

/// A point of one surface inside the other, in the frame of that one.
#[derive(Clone, Copy, Debug)]
enum Inside {
    Vertex(u32, Vec3),
    Edge(u32, Vec3),
}

/// One surface in the other one.
struct Dive<'a> {
    own: &'a Surface,
    other: &'a Surface,
    /// From the own frame to the other's.
    motion: &'a Rigid,
    tolerance: f64,
    travelled: f64,
    slack: f32,
    /// Which of the lists by neighbourhood is the own one.
    which: usize,
}

/// Finds the vertices of the body that lie deeper in the obstacle than the tolerance, and makes their contacts.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn of_body(
    pair: Pair<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    memory: &mut Memory,
    sink: &mut Sink<'_>,
) {
    let Pair { body: own, obstacle: other, motion, tolerance, travelled, .. } = pair;
    let dive = Dive { own, other, motion, tolerance, travelled, slack: pair.slack() as f32, which: 0 };
    let first = sink.contacts.len();
    run(&dive, neighbours, side, memory, |inside, foot| match inside {
        Inside::Vertex(vertex, point) => push_body_vertex(pair, vertex, point, foot, sink),
        Inside::Edge(edge, point) => sink.push(Found {
            point_body: point,
            point_obstacle: foot.point,
            normal: scale(foot.normal, -1.0),
            depth: -foot.signed_distance,
            features: [Feature::Edge(edge), foot.feature],
        }),
    });
    sink.sort_from(first);
}

/// The same for the vertices of the obstacle in the body.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn of_obstacle(
    pair: Pair<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    memory: &mut Memory,
    sink: &mut Sink<'_>,
) {
    let Pair { body: other, obstacle: own, inverse: motion, tolerance, travelled, .. } = pair;
    let dive = Dive { own, other, motion, tolerance, travelled, slack: pair.slack() as f32, which: 1 };
    let first = sink.contacts.len();
    run(&dive, neighbours, side, memory, |inside, foot| match inside {
        Inside::Vertex(vertex, _) => push_obstacle_vertex(pair, vertex, foot, sink),
        Inside::Edge(edge, point) => sink.push(Found {
            point_body: pair.motion.point(foot.point),
            point_obstacle: pair.motion.point(point),
            normal: pair.motion.direction(foot.normal),
            depth: -foot.signed_distance,
            features: [foot.feature, Feature::Edge(edge)],
        }),
    });
    sink.sort_from(first);
}

#[inline(always)]
fn run(
    dive: &Dive<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    memory: &mut Memory,
    mut push: impl FnMut(Inside, &Foot),
) {
    if !dive.other.closed {
        return;
    }
    memory.open.clear();
    memory.open.extend(side.found().iter().copied().filter(|&v| side.signed_distance(v) < 0.0));
    memory.crossed.clear();
    for (i, &Neighbourhood { leaf, begin, end }) in neighbours.of.iter().enumerate() {
        if memory.apart[dive.which][i].holds(dive.travelled, 0.0) {
            continue;
        }
        long_edges(dive, leaf, side, &mut memory.long);
        if memory.long.is_empty() {
            continue;
        }
        let near = &neighbours.near[begin as usize..end as usize];
        let apart = touching(dive, leaf, near, &mut memory.touching);
        if memory.touching.is_empty() {
            memory.apart[dive.which][i] = Clear::new(f64::from(apart), dive.travelled);
            continue;
        }
        for k in 0..memory.long.len() {
            let edge = memory.long[k];
            if crossings(dive, edge, &memory.touching, &mut memory.crossings) {
                follow(dive, edge, side, memory, &mut push);
            }
        }
    }
    memory.crossed.sort_unstable();
    while let Some(vertex) = memory.open.pop() {
        for &edge in dive.own.edges_at(vertex) {
            let [a, b] = dive.own.edges[edge as usize].vertices;
            let other = if a == vertex { b } else { a };
            if side.signed_distance(other).is_infinite() && memory.crossed.binary_search(&edge).is_err() {
                let within = side.signed_distance(vertex).abs() + length(dive.own, edge);
                look(dive, other, within, side, memory, &mut push);
            }
        }
    }
}

fn length(surface: &Surface, edge: u32) -> f64 {
    let [a, b] = surface.edges[edge as usize].vertices.map(|v| surface.vertices[v as usize]);
    norm(sub(b, a))
}

/// The edges of a leaf with an end that is farther from the other surface than the tolerance. If such an edge runs through a face, that
/// end is farther from there than the tolerance, so shorter edges can be left out.
#[inline(always)]
fn long_edges(dive: &Dive<'_>, leaf: u32, side: &Side, found: &mut Vec<u32>) {
    let surface = dive.own;
    let next = surface.leaves.get(leaf as usize + 1);
    let end = next.map_or(surface.edges.len() as u32, |next| next.first_edge);
    found.clear();
    found.extend((surface.leaves[leaf as usize].first_edge..end).filter(|&edge| {
        let ends = surface.edges[edge as usize].vertices;
        let [a, b] = ends.map(|v| surface.vertices[v as usize]);
        let along = sub(b, a);
        dot(along, along) > dive.tolerance * dive.tolerance
            && ends.iter().any(|&v| side.signed_distance(v).is_infinite())
    }));
}

/// Looks where the ends of an edge lie that runs through faces, as far as that is not known from the number of faces.
#[inline(always)]
fn follow(
    dive: &Dive<'_>,
    edge: u32,
    side: &mut Side,
    memory: &mut Memory,
    push: &mut impl FnMut(Inside, &Foot),
) {
    let odd = memory.crossings.len() % 2 == 1;
    if odd {
        memory.crossed.push(edge);
    }
    let length = length(dive.own, edge);
    let mut outside = false;
    for end in dive.own.edges[edge as usize].vertices {
        let known = side.signed_distance(end).is_finite();
        if !known && outside && !odd {
            break;
        }
        if look(dive, end, length, side, memory, push) {
            return;
        }
        outside = true;
    }
    if !odd {
        between_crossings(dive, edge, memory, push);
    }
}

/// Looks where a vertex lies, unless that is known, and tells whether it is inside; `within` is no less than its distance.
#[inline(always)]
fn look(
    dive: &Dive<'_>,
    vertex: u32,
    within: f64,
    side: &mut Side,
    memory: &mut Memory,
    push: &mut impl FnMut(Inside, &Foot),
) -> bool {
    let known = side.signed_distance(vertex);
    if known.is_finite() {
        return known < 0.0;
    }
    let point = dive.motion.point(dive.own.vertices[vertex as usize]);
    let Some((triangle, foot)) = memory.nearest.foot(dive.other, point, within, dive.slack) else {
        return false;
    };
    // Outside is remembered as well, so that no vertex is looked at twice.
    side.set(vertex, foot.signed_distance, triangle / LANES as u32);
    if foot.signed_distance < 0.0 {
        memory.open.push(vertex);
        push(Inside::Vertex(vertex, point), &foot);
        return true;
    }
    false
}

/// An edge that goes in and comes out again has its middle inside and no end that shows it.
#[inline(always)]
fn between_crossings(dive: &Dive<'_>, edge: u32, memory: &mut Memory, push: &mut impl FnMut(Inside, &Foot)) {
    let [a, b] = dive.own.edges[edge as usize].vertices.map(|v| dive.own.vertices[v as usize]);
    let length = length(dive.own, edge);
    memory.crossings.sort_unstable_by(f64::total_cmp);
    for i in 1..memory.crossings.len() {
        let middle = 0.5 * (memory.crossings[i - 1] + memory.crossings[i]);
        let point = dive.motion.point(add(a, scale(sub(b, a), middle)));
        let within = (memory.crossings[i] - memory.crossings[i - 1]) * length;
        if let Some((_, foot)) = memory.nearest.foot(dive.other, point, within, dive.slack)
            && foot.signed_distance < 0.0
        {
            push(Inside::Edge(edge, point), &foot);
        }
    }
}

/// Those of the near leaves that a leaf may cross; and how far away the closest of the others is at least.
#[inline(always)]
fn touching(dive: &Dive<'_>, leaf: u32, near: &[u32], found: &mut Vec<u32>) -> f32 {
    let bounds = kernel::moved_block_box(&dive.own.blocks[leaf as usize], dive.motion, dive.slack);
    let slab = Slab::of(&dive.own.leaves[leaf as usize], dive.motion);
    found.clear();
    let mut closest = f32::INFINITY;
    for &index in near {
        let other = &dive.other.leaves[index as usize];
        let apart = bounds
            .apart(&other.min, &other.max)
            .max(slab.apart(&other.min, &other.max) - dive.slack)
            .max(Slab::of_own(other).apart(&bounds.min, &bounds.max));
        if apart <= 0.0 {
            found.push(index);
        } else {
            closest = closest.min(apart);
        }
    }
    closest
}

/// Where an edge runs through faces of the near leaves; tells whether it does.
#[inline(always)]
fn crossings(dive: &Dive<'_>, edge: u32, near: &[u32], found: &mut Vec<f64>) -> bool {
    found.clear();
    let [a, b] = dive.own.edges[edge as usize].vertices.map(|v| dive.own.vertices[v as usize]);
    let start = dive.motion.point(a);
    let along = dive.motion.direction(sub(b, a));
    let ends = [start, add(start, along)];
    let bounds = Box32::around(ends[0], ends[1], dive.slack);
    let ends = ends.map(|p| p.map(|c| c as f32));
    for &leaf in near {
        let leaf = &dive.other.leaves[leaf as usize];
        if bounds.overlaps(&leaf.min, &leaf.max) && !Slab::of_own(leaf).misses_segment(ends, dive.slack) {
            for t in leaf.first_triangle..leaf.first_triangle + u32::from(leaf.triangles) {
                let corners = dive.other.triangles[t as usize].map(|v| dive.other.vertices[v as usize]);
                found.extend(pierces(start, along, corners));
            }
        }
    }
    !found.is_empty()
}
