//! Edges against edges: the close or crossing places that no vertex shows.

use super::Pair;
use super::feature::Feature;
use super::result::{Found, Sink};
use super::ridge_kernel::Margins;
use super::ridge_pairs::{Batch, Candidate};
use super::ridge_store::{About, RidgeStore};
use super::side::{Clear, Side};
use super::walk::Neighbours;
use crate::surface::{Cone, Edge, EdgeKind, LANES, Surface};
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub, unit_or};
use fearless_simd::Simd;

/// Slack of the test whether a direction lies in an edge's normal cone (its cosine; the cones are in single precision).
const CONE_SLACK: f64 = Cone::SLACK as f64;
/// The middle of an edge shows more than its ends when it is closer to the other surface by this share of the tolerance.
const WORTH: f64 = 0.1;
/// Edges closer than this (metres) have no direction between them.
const TOUCHING: f64 = 1e-12;

/// Memory of the search.
#[derive(Clone, Debug, Default)]
pub(super) struct Ridges {
    stores: [RidgeStore; 2],
    batch: Batch,
    /// By neighbourhood of the body in the last walk.
    pub clear: Vec<Clear>,
}

impl Ridges {
    /// Forgets everything and makes room for two surfaces.
    pub(super) fn reset(&mut self, pair: Pair<'_>) {
        self.stores[0].reset(pair.body);
        self.stores[1].reset(pair.obstacle);
    }
}

/// An edge of the body in the obstacle's frame.
#[derive(Clone, Copy, Debug)]
struct Ridge {
    start: Vec3,
    along: Vec3,
    outward: Vec3,
    index: u32,
}

impl Ridge {
    fn new(pair: Pair<'_>, index: u32) -> Self {
        let edge = &pair.body.edges[index as usize];
        let [a, b] = edge.vertices.map(|v| pair.motion.point(pair.body.vertices[v as usize]));
        let outward = pair.motion.direction(edge.normal.map(f64::from));
        Self { start: a, along: sub(b, a), outward, index }
    }
}

/// How close the middle of an edge must come to another edge to show more than its ends do; zero when an end lies inside.
#[inline(always)]
fn reach(edge: &Edge, side: &Side, tolerance: f64, least: f64) -> f64 {
    let [a, b] = edge.vertices;
    let (a, b) = (side.signed_distance(a), side.signed_distance(b));
    let ends = if a < b { a } else { b };
    let more = ends - WORTH * tolerance;
    let more = if more > least { more } else { least };
    let more = if more > f64::MIN_POSITIVE { more } else { f64::MIN_POSITIVE };
    let known = if ends < f64::INFINITY { more } else { tolerance };
    if ends <= 0.0 { 0.0 } else { known }
}

/// Finds the places where the middles of two edges are closer to each other than their ends are to anything, and those
/// where two edges have passed each other.
#[inline(always)]
pub(super) fn find<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    neighbours: &Neighbours,
    sides: [&Side; 2],
    ridges: &mut Ridges,
    sink: &mut Sink<'_>,
) {
    // Edges may only show more than the vertices did, so the vertices' least distance is what they must beat.
    let least = sink.least.min(pair.tolerance);
    let Ridges { stores, batch, clear } = ridges;
    batch.clear();
    let (slack, tolerance) = (pair.slack() as f32, wide(pair.tolerance));
    let far = pair.body.radius + pair.obstacle.radius + norm(pair.motion.translation);
    let margins = Margins::new(wide(far), tolerance);
    let rotation = pair.rotation32();
    let [store, others] = stores;
    store.expect(neighbours.of.len());
    others.expect(neighbours.of.len());
    for (clear, neighbourhood) in clear.iter_mut().zip(&neighbours.of) {
        let leaf = &pair.body.leaves[neighbourhood.leaf as usize];
        if leaf.ridges == 0 || clear.holds(pair.travelled, pair.tolerance) {
            continue;
        }
        let near = &neighbours.near[neighbourhood.begin as usize..neighbourhood.end as usize];
        let origin = pair.motion.point(pair.body.blocks[neighbourhood.leaf as usize].origin.map(f64::from));
        let origin = [origin[0] as f32, origin[1] as f32, origin[2] as f32];
        let mut lower = f32::INFINITY;
        let end = leaf.first_edge + u32::from(leaf.ridges);
        for block in store.of(simd, pair.body, neighbourhood.leaf, About::Leaf) {
            if batch.full() {
                batch.meet(simd, &others.blocks, &margins);
            }
            let moved = batch.own().set(simd, block, &rotation, origin);
            let apart = batch.measure(simd, &moved, pair.obstacle, near) - slack;
            lower = lower.min(apart);
            if apart < tolerance {
                // No distance is less than that of an edge that is not there.
                let mut within = [f32::NEG_INFINITY; LANES];
                let edges = &pair.body.edges[block.first as usize..end as usize];
                for (edge, within) in edges.iter().zip(&mut within) {
                    let reach = reach(edge, sides[0], pair.tolerance, least);
                    *within = if reach > 0.0 { wide(reach) } else { f32::NEG_INFINITY };
                }
                batch.own().within = within;
                batch.add(simd, slack, pair.obstacle, near, others);
            }
        }
        *clear = Clear::new(f64::from(lower), pair.travelled);
    }
    batch.meet(simd, &others.blocks, &margins);
    let first = sink.contacts.len();
    for &Candidate { edges: [a, b], overlap } in &batch.found {
        let (mine, theirs) = (&pair.body.edges[a as usize], &pair.obstacle.edges[b as usize]);
        let within =
            reach(mine, sides[0], pair.tolerance, least).min(reach(theirs, sides[1], pair.tolerance, least));
        let crossing = if overlap { pair.tolerance } else { 0.0 };
        if within > 0.0
            && let Some(found) = judge(pair, &Ridge::new(pair, a), b, within, crossing)
        {
            sink.push(found);
        }
    }
    sink.sort_from(first);
}

/// A length in single precision, and a little more.
#[inline(always)]
fn wide(length: f64) -> f32 {
    (length * (1.0 + 1e-5)) as f32
}

/// The contact of two edges, when their common perpendicular is short enough and one that surfaces with these edges can touch along.
fn judge(pair: Pair<'_>, ridge: &Ridge, other: u32, within: f64, crossing: f64) -> Option<Found> {
    let theirs = &pair.obstacle.edges[other as usize];
    let [start, end] = theirs.vertices.map(|v| pair.obstacle.vertices[v as usize]);
    let along = sub(end, start);
    let (d, e, r) = (ridge.along, along, sub(ridge.start, start));
    let (a, ee, b) = (dot(d, d), dot(e, e), dot(d, e));
    let (c, f) = (dot(d, r), dot(e, r));
    let whole = a * ee - b * b;
    let (s, t) = ((b * f - c * ee) / whole, (a * f - b * c) / whole);
    // Comparisons with a NaN (parallel edges) are false.
    if !(s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0) {
        return None;
    }
    let (p, q) = (add(ridge.start, scale(d, s)), add(start, scale(e, t)));
    let mine = &pair.body.edges[ridge.index as usize];
    let their_outward = theirs.normal.map(f64::from);
    let between = sub(q, p);
    let distance = norm(between);
    let limit = if dot(between, ridge.outward) < 0.0 { crossing } else { within };
    if !(distance < limit) {
        return None;
    }
    let features = [Feature::Edge(ridge.index), Feature::Edge(other)];
    if distance < TOUCHING {
        let [mine, theirs] = [(ridge.outward, mine), (their_outward, theirs)]
            .map(|(axis, edge)| Cone::wide(axis.map(|c| c as f32), edge.cone));
        if !mine.faces_cone(&theirs) {
            return None;
        }
        let normal = unit_or(sub(ridge.outward, their_outward), cross(d, e));
        return Some(Found {
            point_body: p,
            point_obstacle: q,
            normal,
            depth: -dot(between, normal),
            features,
        });
    }
    let u = scale(between, 1.0 / distance);
    let (mine_cos, theirs_cos) = (dot(u, ridge.outward), -dot(u, their_outward));
    let (mine_cone, theirs_cone) = (f64::from(mine.cone) - CONE_SLACK, f64::from(theirs.cone) - CONE_SLACK);
    if mine_cos >= mine_cone && theirs_cos >= theirs_cone {
        return Some(Found { point_body: p, point_obstacle: q, normal: u, depth: -distance, features });
    }
    let passed = mine.kind == EdgeKind::Convex
        && theirs.kind == EdgeKind::Convex
        && -mine_cos >= mine_cone
        && -theirs_cos >= theirs_cone
        && faces_cross(pair, ridge, mine, theirs, start, along);
    passed.then(|| Found {
        point_body: p,
        point_obstacle: q,
        normal: scale(u, -1.0),
        depth: distance,
        features,
    })
}

/// True when one of the edges runs through a face beside the other: two edges of thin parts may look as if they had passed
/// each other when they lie on the far sides.
fn faces_cross(pair: Pair<'_>, ridge: &Ridge, mine: &Edge, theirs: &Edge, start: Vec3, along: Vec3) -> bool {
    let corners =
        |surface: &Surface, t: u32| surface.triangles[t as usize].map(|v| surface.vertices[v as usize]);
    theirs.triangles.iter().any(|&t| pierces(ridge.start, ridge.along, corners(pair.obstacle, t)).is_some())
        || mine
            .triangles
            .iter()
            .any(|&t| pierces(start, along, corners(pair.body, t).map(|v| pair.motion.point(v))).is_some())
}

/// Where the segment from `p` along `d` meets the triangle, as a share of `d`.
#[inline(always)]
pub(super) fn pierces(p: Vec3, d: Vec3, [a, b, c]: [Vec3; 3]) -> Option<f64> {
    let (e1, e2, from) = (sub(b, a), sub(c, a), sub(p, a));
    let normal = cross(e1, e2);
    let (height, slope) = (dot(from, normal), -dot(d, normal));
    // Both ends on one side of the plane: most are refused here, without a division.
    let apart = if slope > 0.0 { height < 0.0 || height > slope } else { height > 0.0 || height < slope };
    if apart || slope == 0.0 {
        return None;
    }
    let moment = cross(d, from);
    // Signs by Cramer's rule; the share is exact enough even at a grazing angle since both its parts are.
    let v = -dot(e2, moment) / slope;
    let w = dot(e1, moment) / slope;
    (v >= 0.0 && w >= 0.0 && v + w <= 1.0).then_some(height / slope)
}
