//! Edges against edges: the close or crossing places that no vertex shows.

use super::Pair;
use super::feature::Feature;
use super::result::{Found, Sink};
use super::ridge_kernel::{RidgeBlock, SegmentBlock};
use super::side::{Clear, Side};
use super::walk::{Neighbourhood, Neighbours};
use crate::surface::{Cone, Edge, EdgeKind, LANES, Leaf, Surface};
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
    /// Edges of the obstacle's leaves, gathered when a query first needs them.
    blocks: Vec<RidgeBlock>,
    /// By leaf of the obstacle: where its blocks begin, plus one (zero: not gathered), and end.
    range: Vec<[u32; 2]>,
    gathered: Vec<u32>,
    /// The edges of a leaf of the body, and eight at a time.
    own: Vec<Ridge>,
    segments: Vec<SegmentBlock>,
    /// By neighbourhood of the body in the last walk.
    pub clear: Vec<Clear>,
}

/// An edge of the body in the obstacle's frame.
#[derive(Clone, Copy, Debug)]
struct Ridge {
    start: Vec3,
    along: Vec3,
    outward: Vec3,
    within: f64,
    cone: Cone,
    index: u32,
}

impl Ridges {
    pub(super) fn forget(&mut self, obstacle: &Surface) {
        for &leaf in &self.gathered {
            self.range[leaf as usize] = [0; 2];
        }
        self.gathered.clear();
        self.blocks.clear();
        self.range.resize(obstacle.leaves.len(), [0; 2]);
    }

    /// The edges of a leaf of the body that may show more than their ends do.
    #[inline(always)]
    fn gather_own(&mut self, pair: Pair<'_>, side: &Side, leaf: &Leaf, least: f64) {
        self.own.clear();
        self.segments.clear();
        for index in leaf.first_edge..leaf.first_edge + u32::from(leaf.ridges) {
            let edge = &pair.body.edges[index as usize];
            let within = reach(edge, side, pair, least);
            if within <= 0.0 {
                continue;
            }
            let [a, b] = edge.vertices;
            let a = pair.motion.point(pair.body.vertices[a as usize]);
            let b = pair.motion.point(pair.body.vertices[b as usize]);
            let outward = pair.motion.direction(edge.normal.map(f64::from));
            let cone = Cone::wide(outward.map(|c| c as f32), edge.cone);
            let lane = self.own.len() % LANES;
            if lane == 0 {
                self.segments.push(SegmentBlock::EMPTY);
            }
            if let Some(block) = self.segments.last_mut() {
                block.set(lane, [a, b].map(|p| p.map(|c| c as f32)), (within as f32).next_up());
                block.set_cone(lane, &cone);
            }
            self.own.push(Ridge { start: a, along: sub(b, a), outward, within, cone, index });
        }
    }

    /// The blocks of the edges of a leaf of the obstacle that may show more than their ends do.
    #[inline(always)]
    fn gather(&mut self, pair: Pair<'_>, side: &Side, leaf: u32, least: f64) -> (usize, usize) {
        let [begin, end] = self.range[leaf as usize];
        if begin > 0 {
            return (begin as usize - 1, end as usize);
        }
        let surface = pair.obstacle;
        let begin = self.blocks.len();
        let own = &surface.leaves[leaf as usize];
        let origin = surface.blocks[leaf as usize].origin;
        let mut lane = LANES;
        for index in own.first_edge..own.first_edge + u32::from(own.ridges) {
            let edge = &surface.edges[index as usize];
            let within = reach(edge, side, pair, least);
            if within <= 0.0 {
                continue;
            }
            if lane == LANES {
                self.blocks.push(RidgeBlock::empty(origin));
                lane = 0;
            }
            let ends = edge.vertices.map(|v| local(surface.vertices[v as usize], origin));
            if let Some(block) = self.blocks.last_mut() {
                let cone = Cone::wide(edge.normal, edge.cone);
                block.set(lane, index, ends, cone, (within as f32).next_up());
            }
            lane += 1;
        }
        self.range[leaf as usize] = [begin as u32 + 1, self.blocks.len() as u32];
        self.gathered.push(leaf);
        (begin, self.blocks.len())
    }
}

/// A point about an origin, in single precision.
#[inline(always)]
fn local(p: Vec3, origin: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| (p[k] - f64::from(origin[k])) as f32)
}

/// How close the middle of an edge must come to another edge to show more than its ends do; zero when an end lies inside.
#[inline(always)]
fn reach(edge: &Edge, side: &Side, pair: Pair<'_>, least: f64) -> f64 {
    let [a, b] = edge.vertices;
    let (a, b) = (side.signed_distance(a), side.signed_distance(b));
    let ends = a.min(b);
    if ends <= 0.0 {
        0.0
    } else if ends.is_finite() {
        (ends - WORTH * pair.tolerance).max(least).max(f64::MIN_POSITIVE)
    } else {
        pair.tolerance
    }
}

/// Finds the places where the middles of two edges are closer to each other than their ends are to anything, and those
/// where two edges have passed each other.
#[inline(always)]
pub(super) fn find<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    neighbours: &Neighbours,
    [body, obstacle]: [&Side; 2],
    ridges: &mut Ridges,
    sink: &mut Sink<'_>,
) {
    let slack = pair.slack() as f32;
    // Edges may only show more than the vertices did, so the vertices' least distance is what they must beat.
    let least = sink.least.min(pair.tolerance);
    let first = sink.contacts.len();
    for (i, &Neighbourhood { leaf, begin, end }) in neighbours.of.iter().enumerate() {
        if ridges.clear[i].holds(pair.travelled, pair.tolerance) {
            continue;
        }
        let own = &pair.body.leaves[leaf as usize];
        ridges.gather_own(pair, body, own, least);
        if ridges.own.is_empty() {
            continue;
        }
        let axis = pair.motion.direction(own.ridge_cone.axis.map(f64::from)).map(|c| c as f32);
        let cone = Cone { axis, ..own.ridge_cone };
        // Directions change as the body turns, distances by no more than it travels.
        let all = ridges.own.len() == usize::from(own.ridges);
        let mut lower = f32::INFINITY;
        for &other in &neighbours.near[begin as usize..end as usize] {
            let theirs = &pair.obstacle.leaves[other as usize];
            let facing = theirs.ridges > 0 && cone.faces_cone(&theirs.ridge_cone);
            if !facing && !all {
                continue;
            }
            for eight in 0..ridges.segments.len() {
                let (mut mask, meeting, apart) = ridges.segments[eight].near(simd, theirs, slack);
                lower = if apart < lower { apart } else { lower };
                mask = if facing && mask != 0 {
                    mask & ridges.segments[eight].facing(simd, &theirs.ridge_cone)
                } else {
                    0
                };
                while mask != 0 {
                    let lane = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    // Edges that have passed each other lie in leaves that overlap.
                    let crossing = if meeting >> lane & 1 == 1 { pair.tolerance } else { 0.0 };
                    let range = ridges.gather(pair, obstacle, other, least);
                    let ridge = ridges.own[eight * LANES + lane];
                    for block in &ridges.blocks[range.0..range.1] {
                        meet(
                            simd,
                            pair,
                            &ridge,
                            block,
                            crossing,
                            |edge| reach(edge, obstacle, pair, least),
                            sink,
                        );
                    }
                }
            }
        }
        if all {
            ridges.clear[i] = Clear::new(f64::from(lower), pair.travelled);
        }
    }
    sink.sort_from(first);
}

#[inline(always)]
fn meet<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    ridge: &Ridge,
    block: &RidgeBlock,
    crossing: f64,
    reach: impl Fn(&Edge) -> f64,
    sink: &mut Sink<'_>,
) {
    let start = local(ridge.start, block.origin);
    let along = ridge.along.map(|c| c as f32);
    let (within, crossing32) = ((ridge.within as f32).next_up(), (crossing as f32).next_up());
    let mut mask = block.meeting(simd, start, along, &ridge.cone, within, crossing32);
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        let other = &pair.obstacle.edges[block.edge[lane] as usize];
        let within = ridge.within.min(reach(other));
        if let Some(found) = judge(pair, ridge, block.edge[lane], within, crossing) {
            sink.push(found);
        }
    }
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
