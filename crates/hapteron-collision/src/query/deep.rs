//! What lies deeper inside the other surface than the tolerance.
//!
//! The vertices within the tolerance do not show it, and a contact that ended at some depth would let a hard push through. So
//! edges with an end that is far are tried against the faces near them, and from every vertex that is inside, its edges are followed
//! to further ones, unless they have come out through a face: each vertex found gets its exact foot, whatever its depth. Only a
//! closed and oriented surface has an inside; behind an open one nothing is followed.

mod edges;
mod pierce;
mod segments;
#[cfg(test)]
mod tests;

use super::Pair;
use super::feature::{Feature, Foot};
use super::nearest::Nearest;
use super::result::{Found, Sink};
use super::ridges::pierces;
use super::side::{Clear, Side};
use super::vertices::{push_body_vertex, push_obstacle_vertex};
use super::walk::Neighbours;
use crate::surface::{LANES, Surface};
use crate::vector::{Rigid, Vec3, add, norm, scale, sub};
use edges::Edges;
use fearless_simd::Simd;
use pierce::Batch;
use segments::{Frame, Rows};
use std::ops::Range;

/// Lists to be reused.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    /// Of the body and the obstacle.
    edges: [Edges; 2],
    batch: Batch,
    search: Search,
    /// By neighbourhood of the last walk, for the body and the obstacle: until when no leaf can touch it.
    pub apart: [Vec<Clear>; 2],
}

/// What serves to look where single vertices lie.
#[derive(Clone, Debug, Default)]
struct Search {
    /// Vertices inside whose edges are to be followed.
    open: Vec<u32>,
    /// Where edges run through faces that may have both ends outside.
    crossings: Vec<Crossing>,
    nearest: Nearest,
}

/// Where an edge of a leaf runs through a face, as a share of the edge.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    leaf: u32,
    edge: u32,
    share: f64,
    /// Both ends of the edge were looked at before.
    known: bool,
}

/// A point of one surface inside the other, in the frame of that one.
#[derive(Clone, Copy, Debug)]
enum Inside {
    Vertex(u32, Vec3),
    Edge(u32, Vec3),
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
    fn frame(&self) -> Frame<'_, S>
    where
        S: Simd,
    {
        Frame {
            simd: self.simd,
            own: self.own,
            other: self.other,
            motion: self.motion,
            rotation: self.motion.rotation.map(|row| row.map(|c| c as f32)),
            exact_tolerance: self.tolerance,
            tolerance: (self.tolerance * edges::ROUNDED_DOWN) as f32,
            slack: self.slack,
            wide: segments::WIDE * self.slack,
        }
    }

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
    if !dive.other.closed || (neighbours.of.is_empty() && side.found().is_empty()) {
        return;
    }
    let Memory { edges, batch, search, apart } = memory;
    let (edges, apart) = (&mut edges[dive.which], &mut apart[dive.which]);
    let frame = dive.frame();
    edges.expect(dive.own, neighbours.of.len());
    edges.take(side, dive.tolerance, &mut search.open);
    let mut rows = Rows::EMPTY;
    batch.clear();
    for (of, apart) in neighbours.of.iter().zip(apart) {
        if apart.holds(dive.travelled, 0.0) {
            continue;
        }
        let first = batch.segments().len();
        let spare = batch.take(&frame, edges, side, of.leaf, &mut rows);
        let near = &neighbours.near[of.begin as usize..of.end as usize];
        let clear = spare.min(0.5 * batch.meet(&frame, first, near));
        // As the body travels, what is known of an edge's ends shrinks as well.
        *apart = Clear::new(f64::from(clear), dive.travelled);
        if batch.is_full() {
            batch.pierce(&frame);
            settle(dive, side, batch, edges, search, &mut push);
            batch.clear();
        }
    }
    batch.pierce(&frame);
    settle(dive, side, batch, edges, search, &mut push);
    while let Some(vertex) = search.open.pop() {
        for &edge in dive.own.edges_at(vertex) {
            if edges.is_settled(edge) {
                continue;
            }
            let [a, b] = dive.own.edges[edge as usize].vertices;
            let other = if a == vertex { b } else { a };
            if side.signed_distance(other).is_infinite() {
                let within = side.signed_distance(vertex).abs() + length(dive.own, edge);
                look(dive, other, within, side, edges, search, &mut push);
            }
        }
    }
    edges.forget(side.found(), neighbours.of.iter().map(|of| of.leaf), dive.own);
}

/// Looks at what has been pierced, in the order of the leaves.
#[inline(always)]
fn settle<S: Simd>(
    dive: &Dive<'_, S>,
    side: &mut Side,
    batch: &mut Batch,
    edges: &mut Edges,
    search: &mut Search,
    push: &mut impl FnMut(Inside, &Foot),
) {
    search.crossings.clear();
    for index in 0..batch.hits() {
        let hit = batch.hit(index);
        let segments = &batch.segments()[hit.block];
        let (leaf, edge) = (segments.leaf, segments.edges[hit.lane]);
        if segments.begins_inside(hit.lane) {
            // It matters no more than whether the other end is outside.
            let mut odd = hit.surely.count_ones() & 1;
            if hit.maybe != hit.surely {
                exactly(dive, edge, hit.leaf, hit.maybe & !hit.surely, |_| odd ^= 1);
            }
            edges.toggle(edge, odd);
        } else {
            exactly(dive, edge, hit.leaf, hit.maybe, |share| {
                search.crossings.push(Crossing { leaf, edge, share, known: false });
            });
        }
    }
    if !search.crossings.is_empty() {
        // Rarely needed, so a function of its own.
        dive.simd.vectorize(
            #[inline(always)]
            || follow_all(dive, side, edges, search, push),
        );
    }
}

/// Gives the places where an edge runs through triangles of a leaf, one bit each.
#[inline(always)]
fn exactly<S>(dive: &Dive<'_, S>, edge: u32, leaf: u32, mut triangles: u32, mut found: impl FnMut(f64)) {
    let [a, b] = dive.own.edges[edge as usize].vertices.map(|v| dive.own.vertices[v as usize]);
    let (start, along) = (dive.motion.point(a), dive.motion.direction(sub(b, a)));
    let first = dive.other.leaves[leaf as usize].first_triangle;
    while triangles != 0 {
        let triangle = first + triangles.trailing_zeros();
        triangles &= triangles - 1;
        let corners = dive.other.triangles[triangle as usize].map(|v| dive.other.vertices[v as usize]);
        if let Some(share) = pierces(start, along, corners) {
            found(share);
        }
    }
}

/// Follows the edges that run through faces, leaf by leaf.
#[inline(always)]
fn follow_all<S: Simd>(
    dive: &Dive<'_, S>,
    side: &mut Side,
    edges: &mut Edges,
    search: &mut Search,
    push: &mut impl FnMut(Inside, &Foot),
) {
    // They come leaf by leaf.
    let mut begin = 0;
    while begin < search.crossings.len() {
        let leaf = search.crossings[begin].leaf;
        let mut rest = begin + search.crossings[begin..].iter().take_while(|c| c.leaf == leaf).count();
        let of_leaf = &mut search.crossings[begin..rest];
        of_leaf.sort_unstable_by(|a, b| a.edge.cmp(&b.edge).then(a.share.total_cmp(&b.share)));
        // One whose ends have been looked at since shows nothing.
        for crossing in of_leaf {
            let ends = dive.own.edges[crossing.edge as usize].vertices;
            crossing.known = ends.iter().all(|&v| side.signed_distance(v).is_finite());
        }
        let end = rest;
        while rest > begin {
            let Crossing { edge, known, .. } = search.crossings[rest - 1];
            let first = begin + search.crossings[begin..rest].partition_point(|c| c.edge < edge);
            if !known {
                follow(dive, edge, first..rest, side, edges, search, push);
            }
            rest = first;
        }
        begin = end;
    }
}

fn length(surface: &Surface, edge: u32) -> f64 {
    let [a, b] = surface.edges[edge as usize].vertices.map(|v| surface.vertices[v as usize]);
    norm(sub(b, a))
}

/// Looks where the ends of an edge lie that runs through faces, as far as that is not known from the number of faces.
#[inline(always)]
fn follow<S: Simd>(
    dive: &Dive<'_, S>,
    edge: u32,
    crossings: Range<usize>,
    side: &mut Side,
    edges: &mut Edges,
    search: &mut Search,
    push: &mut impl FnMut(Inside, &Foot),
) {
    let odd = crossings.len() % 2 == 1;
    if odd {
        edges.settle(edge, 1);
    }
    let length = length(dive.own, edge);
    let mut ends = dive.own.edges[edge as usize].vertices;
    if side.signed_distance(ends[1]).is_finite() {
        ends.swap(0, 1);
    }
    // Where the number of faces is even, both ends lie on the same side.
    if look(dive, ends[0], length, side, edges, search, push) {
        return;
    }
    if odd {
        look(dive, ends[1], length, side, edges, search, push);
    } else if !(side.signed_distance(ends[1]) < 0.0) {
        between_crossings(dive, edge, crossings, search, push);
    }
}

/// Looks where a vertex lies, unless that is known, and tells whether it is inside; `within` is no less than its distance.
#[inline(always)]
fn look<S: Simd>(
    dive: &Dive<'_, S>,
    vertex: u32,
    within: f64,
    side: &mut Side,
    edges: &mut Edges,
    search: &mut Search,
    push: &mut impl FnMut(Inside, &Foot),
) -> bool {
    let known = side.signed_distance(vertex);
    if known.is_finite() {
        return known < 0.0;
    }
    let point = dive.motion.point(dive.own.vertices[vertex as usize]);
    let Some((triangle, foot)) = search.nearest.foot(dive.simd, dive.other, point, within, dive.slack) else {
        return false;
    };
    // Outside is remembered as well, so that no vertex is looked at twice.
    side.set(vertex, foot.signed_distance, triangle / LANES as u32);
    edges.set(vertex, foot.signed_distance, dive.tolerance);
    if foot.signed_distance < 0.0 {
        search.open.push(vertex);
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
    search: &mut Search,
    push: &mut impl FnMut(Inside, &Foot),
) {
    let [a, b] = dive.own.edges[edge as usize].vertices.map(|v| dive.own.vertices[v as usize]);
    let length = length(dive.own, edge);
    for pair in search.crossings[crossings].windows(2) {
        let (from, to) = (pair[0].share, pair[1].share);
        let point = dive.motion.point(add(a, scale(sub(b, a), 0.5 * (from + to))));
        let within = (to - from) * length;
        if let Some((_, foot)) = search.nearest.foot(dive.simd, dive.other, point, within, dive.slack)
            && foot.signed_distance < 0.0
        {
            push(Inside::Edge(edge, point), &foot);
        }
    }
}
