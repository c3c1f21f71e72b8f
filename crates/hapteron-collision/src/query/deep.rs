//! What lies deeper inside the other surface than the tolerance.
//!
//! The vertices within the tolerance do not show it, and a contact that ended at some depth would let a hard push through. So
//! edges with an end that is far are tried against the faces near them, and from every vertex that is inside, its edges are followed
//! to further ones, unless they have come out through a face: each vertex found gets its exact foot, whatever its depth. Only a
//! closed and oriented surface has an inside; behind an open one nothing is followed.

use super::Pair;
use super::feature::{Feature, Foot};
use super::kernel;
use super::kernel::Lanes;
use super::nearest::Nearest;
use super::result::{Found, Sink};
use super::ridge_kernel::SegmentBlock;
use super::ridges::pierces;
use super::side::{Clear, Side};
use super::vertices::{push_body_vertex, push_obstacle_vertex};
use super::walk::{Neighbourhood, Neighbours};
use crate::surface::{LANES, Surface};
use crate::vector::{Rigid, Vec3, add, dot, norm, scale, sub};
use fearless_simd::{Simd, prelude::*};
use std::ops::Range;

/// Lists to be reused.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    /// Vertices inside whose edges are to be followed.
    open: Vec<u32>,
    /// Edges that run through an odd number of faces: one end is inside, the other outside.
    crossed: Vec<u32>,
    /// Edges of a leaf that may run through something no vertex shows, and eight at a time.
    probes: Vec<Probe>,
    segments: Vec<SegmentBlock>,
    /// Which of them run through faces, and where, as a share of the edge.
    crossings: Vec<(u32, f64)>,
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

/// An edge, and where it is in the other surface's frame.
#[derive(Clone, Copy, Debug)]
struct Probe {
    edge: u32,
    start: Vec3,
    along: Vec3,
    /// The part of it, as shares, beyond what its ends know to be empty.
    part: [f64; 2],
}

/// One surface in the other one.
struct Dive<'a, S> {
    simd: S,
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

impl<S> Dive<'_, S> {
    /// The weight of a contact in the middle of an edge: it begins where the edge comes through the surface, where any other contact already
    /// presses, and must not begin with a blow.
    fn share(&self, foot: &Foot) -> f64 {
        (-foot.signed_distance / self.tolerance).clamp(0.0, 1.0)
    }
}

/// Finds the vertices of the body that lie deeper in the obstacle than the tolerance, and makes their contacts.
#[inline(always)]
pub(super) fn of_body<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    memory: &mut Memory,
    sink: &mut Sink<'_>,
) {
    let Pair { body: own, obstacle: other, motion, tolerance, travelled, .. } = pair;
    let dive = Dive { simd, own, other, motion, tolerance, travelled, slack: pair.slack() as f32, which: 0 };
    let first = sink.contacts.len();
    run(&dive, neighbours, side, memory, |inside, foot| match inside {
        Inside::Vertex(vertex, point) => push_body_vertex(pair, vertex, point, foot, sink),
        Inside::Edge(edge, point) => {
            let found = Found {
                point_body: point,
                point_obstacle: foot.point,
                normal: scale(foot.normal, -1.0),
                depth: -foot.signed_distance,
                features: [Feature::Edge(edge), foot.feature],
            };
            sink.push_in_part(found, dive.share(foot));
        }
    });
    sink.sort_from(first);
}

/// The same for the vertices of the obstacle in the body.
#[inline(always)]
pub(super) fn of_obstacle<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    memory: &mut Memory,
    sink: &mut Sink<'_>,
) {
    let Pair { body: other, obstacle: own, inverse: motion, tolerance, travelled, .. } = pair;
    let dive = Dive { simd, own, other, motion, tolerance, travelled, slack: pair.slack() as f32, which: 1 };
    let first = sink.contacts.len();
    run(&dive, neighbours, side, memory, |inside, foot| match inside {
        Inside::Vertex(vertex, _) => push_obstacle_vertex(pair, vertex, foot, sink),
        Inside::Edge(edge, point) => {
            let found = Found {
                point_body: pair.motion.point(foot.point),
                point_obstacle: pair.motion.point(point),
                normal: pair.motion.direction(foot.normal),
                depth: -foot.signed_distance,
                features: [foot.feature, Feature::Edge(edge)],
            };
            sink.push_in_part(found, dive.share(foot));
        }
    });
    sink.sort_from(first);
}

#[inline(always)]
fn run<S: Simd>(
    dive: &Dive<'_, S>,
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
        let spare = long_edges(dive, leaf, side, memory);
        let apart = cross_leaves(dive, &neighbours.near[begin as usize..end as usize], memory);
        // As the body travels, what is known of an edge's ends shrinks as well.
        memory.apart[dive.which][i] = Clear::new(0.5 * spare.min(f64::from(apart)), dive.travelled);
        let mut rest = memory.crossings.len();
        while rest > 0 {
            let edge = memory.crossings[rest - 1].0;
            let first = memory.crossings[..rest].partition_point(|c| c.0 < edge);
            follow(dive, edge, first..rest, side, memory, &mut push);
            rest = first;
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

/// Collects the edges of a leaf with an end that is far, if they may run through a face. A known end is as far from there as it is from the
/// surface, any other one farther than the tolerance: only what is left between is looked at. Gives how much the others lack.
#[inline(always)]
fn long_edges<S>(dive: &Dive<'_, S>, leaf: u32, side: &Side, memory: &mut Memory) -> f64 {
    let surface = dive.own;
    let next = surface.leaves.get(leaf as usize + 1);
    let end = next.map_or(surface.edges.len() as u32, |next| next.first_edge);
    memory.probes.clear();
    memory.segments.clear();
    let mut spare = f64::INFINITY;
    for edge in surface.leaves[leaf as usize].first_edge..end {
        let vertices = surface.edges[edge as usize].vertices;
        let known = [side.signed_distance(vertices[0]), side.signed_distance(vertices[1])];
        if known.iter().all(|s| s.is_finite()) {
            spare = spare.min(dive.tolerance - known[0].max(known[1]));
            continue;
        }
        let empty = known.map(|s| s.abs().min(dive.tolerance));
        let [a, b] = vertices.map(|v| surface.vertices[v as usize]);
        let along = sub(b, a);
        let (squared, sum) = (dot(along, along), empty[0] + empty[1]);
        if squared <= sum * sum {
            spare = spare.min(sum - squared.sqrt());
            continue;
        }
        let inverse = 1.0 / squared.sqrt();
        let (start, along) = (dive.motion.point(a), dive.motion.direction(along));
        let lane = memory.probes.len() % LANES;
        if lane == 0 {
            memory.segments.push(SegmentBlock::EMPTY);
        }
        let part = [empty[0] * inverse, 1.0 - empty[1] * inverse];
        if let Some(block) = memory.segments.last_mut() {
            block.set(lane, ends(start, along, part));
        }
        memory.probes.push(Probe { edge, start, along, part });
    }
    spare
}

/// Finds where the collected edges run through triangles of the near leaves, in the order of the edges. Gives how far away at least any of
/// them is from any leaf.
#[inline(always)]
fn cross_leaves<S: Simd>(dive: &Dive<'_, S>, near: &[u32], memory: &mut Memory) -> f32 {
    memory.crossings.clear();
    if memory.probes.is_empty() {
        return f32::INFINITY;
    }
    let mut apart = Lanes::splat(dive.simd, f32::INFINITY);
    for &index in near {
        let leaf = &dive.other.leaves[index as usize];
        for (eight, block) in memory.segments.iter().enumerate() {
            let own = block.apart(dive.simd, leaf, dive.slack);
            apart = apart.min(own);
            let mut mask = kernel::bits(own.simd_le(0.0));
            while mask != 0 {
                let probe = &memory.probes[eight * LANES + mask.trailing_zeros() as usize];
                mask &= mask - 1;
                cross_leaf(dive, probe, index, &mut memory.crossings);
            }
        }
    }
    memory.crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    apart.reduce_min()
}

/// The ends of a part of an edge, in single precision.
#[inline(always)]
fn ends(start: Vec3, along: Vec3, part: [f64; 2]) -> [[f32; 3]; 2] {
    let mut result = [[0.0; 3]; 2];
    for (end, share) in result.iter_mut().zip(part) {
        for k in 0..3 {
            end[k] = (start[k] + along[k] * share) as f32;
        }
    }
    result
}

#[inline(always)]
fn cross_leaf<S: Simd>(dive: &Dive<'_, S>, probe: &Probe, index: u32, found: &mut Vec<(u32, f64)>) {
    let (leaf, block) = (&dive.other.leaves[index as usize], &dive.other.blocks[index as usize]);
    let from = sub(probe.start, block.origin.map(f64::from));
    let ends = ends(from, probe.along, probe.part);
    let mut mask = kernel::pierced_triangles(dive.simd, ends, block) & ((1 << leaf.triangles) - 1);
    while mask != 0 {
        let triangle = leaf.first_triangle + mask.trailing_zeros();
        mask &= mask - 1;
        let corners = dive.other.triangles[triangle as usize].map(|v| dive.other.vertices[v as usize]);
        found.extend(pierces(probe.start, probe.along, corners).map(|share| (probe.edge, share)));
    }
}

/// Looks where the ends of an edge lie that runs through faces, as far as that is not known from the number of faces.
#[inline(always)]
fn follow<S: Simd>(
    dive: &Dive<'_, S>,
    edge: u32,
    crossings: Range<usize>,
    side: &mut Side,
    memory: &mut Memory,
    push: &mut impl FnMut(Inside, &Foot),
) {
    let odd = crossings.len() % 2 == 1;
    if odd {
        memory.crossed.push(edge);
    }
    let length = length(dive.own, edge);
    let mut ends = dive.own.edges[edge as usize].vertices;
    if side.signed_distance(ends[1]).is_finite() {
        ends.swap(0, 1);
    }
    // Where the number of faces is even, both ends lie on the same side.
    if look(dive, ends[0], length, side, memory, push) {
        return;
    }
    if odd {
        look(dive, ends[1], length, side, memory, push);
    } else if !(side.signed_distance(ends[1]) < 0.0) {
        between_crossings(dive, edge, crossings, memory, push);
    }
}

/// Looks where a vertex lies, unless that is known, and tells whether it is inside; `within` is no less than its distance.
#[inline(always)]
fn look<S: Simd>(
    dive: &Dive<'_, S>,
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
    let Some((triangle, foot)) = memory.nearest.foot(dive.simd, dive.other, point, within, dive.slack) else {
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
fn between_crossings<S: Simd>(
    dive: &Dive<'_, S>,
    edge: u32,
    crossings: Range<usize>,
    memory: &mut Memory,
    push: &mut impl FnMut(Inside, &Foot),
) {
    let [a, b] = dive.own.edges[edge as usize].vertices.map(|v| dive.own.vertices[v as usize]);
    let length = length(dive.own, edge);
    for pair in memory.crossings[crossings].windows(2) {
        let (from, to) = (pair[0].1, pair[1].1);
        let point = dive.motion.point(add(a, scale(sub(b, a), 0.5 * (from + to))));
        let within = (to - from) * length;
        if let Some((_, foot)) = memory.nearest.foot(dive.simd, dive.other, point, within, dive.slack)
            && foot.signed_distance < 0.0
        {
            push(Inside::Edge(edge, point), &foot);
        }
    }
}
