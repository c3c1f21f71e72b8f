//! Edges against edges: the close or crossing places that no vertex shows.

use super::Pair;
use super::feature::Feature;
use super::kernel::{self, Box32, LeafBounds, RidgeBlock};
use super::result::{Found, Sink};
use super::side::Side;
use super::vertices::Scratch;
use super::walk::{Neighbourhood, Neighbours};
use crate::surface::{Cone, Edge, EdgeKind, LANES, Leaf, Surface};
use crate::vector::{Rigid, Vec3, add, cross, dot, norm, scale, sub, unit_or};

/// Slack of the test whether a direction lies in an edge's normal cone (its cosine; the cones are in single precision).
const CONE_SLACK: f64 = Cone::SLACK as f64;
/// The middle of an edge shows more than its ends when it is closer to the other surface by this share of the tolerance.
const WORTH: f64 = 0.1;
/// Edges closer than this (metres) have no direction between them.
const TOUCHING: f64 = 1e-12;

/// Edges of the obstacle's leaves, gathered when a query first needs them.
#[derive(Clone, Debug, Default)]
pub(super) struct Ridges {
    blocks: Vec<RidgeBlock>,
    /// By leaf of the obstacle: its range of `blocks`, when gathered.
    range: Vec<Option<(u32, u32)>>,
    gathered: Vec<u32>,
    /// The leaves that a leaf of the body faces.
    facing: Vec<u32>,
}

/// An edge of the body in the obstacle's frame.
struct Ridge {
    start: Vec3,
    along: Vec3,
    outward: Vec3,
    within: f64,
    cone: Cone,
    index: u32,
}

impl Ridges {
    pub(super) fn clear(&mut self, obstacle: &Surface) {
        for &leaf in &self.gathered {
            self.range[leaf as usize] = None;
        }
        self.gathered.clear();
        self.blocks.clear();
        self.range.resize(obstacle.leaves.len(), None);
    }

    #[inline(always)]
    fn gather(&mut self, pair: Pair<'_>, side: &Side, leaf: u32, least: f64) -> (u32, u32) {
        if let Some(range) = self.range[leaf as usize] {
            return range;
        }
        let surface = pair.obstacle;
        let begin = self.blocks.len();
        let own = &surface.leaves[leaf as usize];
        let mut lane = LANES;
        for index in own.first_edge..own.first_edge + u32::from(own.ridges) {
            let edge = &surface.edges[index as usize];
            let within = reach(edge, side, pair, least);
            if within <= 0.0 {
                continue;
            }
            if lane == LANES {
                self.blocks.push(RidgeBlock::EMPTY);
                lane = 0;
            }
            let [a, b] = edge.vertices.map(|v| surface.vertices[v as usize]);
            if let Some(block) = self.blocks.last_mut() {
                for axis in 0..3 {
                    block.start[axis][lane] = a[axis];
                    block.along[axis][lane] = b[axis] - a[axis];
                }
                block.within_squared[lane] = within * within;
                let cone = Cone::wide(edge.normal, edge.cone);
                for axis in 0..3 {
                    block.normal[axis][lane] = cone.axis[axis];
                }
                (block.cos[lane], block.sin[lane]) = (cone.cos, cone.sin);
                block.edge[lane] = index;
            }
            lane += 1;
        }
        let range = (begin as u32, self.blocks.len() as u32);
        self.range[leaf as usize] = Some(range);
        self.gathered.push(leaf);
        range
    }
}

/// How close the middle of an edge must come to another edge to show more than its ends do; zero when an end lies inside.
#[inline(always)]
fn reach(edge: &Edge, side: &Side, pair: Pair<'_>, least: f64) -> f64 {
    let [a, b] = edge.vertices.map(|v| side.signed_distance(v));
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
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(super) fn find(
    pair: Pair<'_>,
    neighbours: &Neighbours,
    [body, obstacle]: [&Side; 2],
    ridges: &mut Ridges,
    scratch: &mut Scratch,
    sink: &mut Sink<'_>,
) {
    let slack = pair.slack() as f32;
    // Edges may only show more than the vertices did, so the vertices' least distance is what they must beat.
    let least = sink.least.min(pair.tolerance);
    for &Neighbourhood { leaf, begin, end } in &neighbours.of {
        let own = &pair.body.leaves[leaf as usize];
        let near = &neighbours.near[begin as usize..end as usize];
        let mut facing = core::mem::take(&mut ridges.facing);
        facing_leaves(pair, own, near, &mut facing);
        scratch.bounds.clear();
        for eight in facing.chunks(LANES) {
            scratch.bounds.push(LeafBounds::gather(pair.obstacle, eight));
        }
        let edges = if facing.is_empty() { 0 } else { u32::from(own.ridges) };
        for index in own.first_edge..own.first_edge + edges {
            let edge = &pair.body.edges[index as usize];
            let within = reach(edge, body, pair, least);
            if within <= 0.0 {
                continue;
            }
            let ridge = moved(pair.body, edge, index, within, pair.motion);
            let bounds = bounds(&ridge);
            let ends = [ridge.start, add(ridge.start, ridge.along)].map(|p| p.map(|c| c as f32));
            for (eight, leaf_bounds) in facing.chunks(LANES).zip(scratch.bounds.iter()) {
                let lower = leaf_bounds.segment_lower(&bounds, ends, slack);
                for (&other, &lower) in eight.iter().zip(&lower) {
                    if f64::from(lower) >= within && lower > 0.0 {
                        continue;
                    }
                    // Edges that have passed each other lie in leaves that overlap.
                    let crossing = if lower <= 0.0 { pair.tolerance } else { 0.0 };
                    let (first, last) = ridges.gather(pair, obstacle, other, least);
                    for block in &ridges.blocks[first as usize..last as usize] {
                        if block.facing(&ridge.cone) != 0 {
                            meet(pair, &ridge, block, crossing * crossing, sink);
                        }
                    }
                }
            }
        }
        ridges.facing = facing;
    }
}

/// Those of the near leaves whose ridges can touch some ridge of a leaf of the body: surfaces touch where their normals are opposite.
#[inline(always)]
fn facing_leaves(pair: Pair<'_>, own: &Leaf, near: &[u32], facing: &mut Vec<u32>) {
    facing.clear();
    if own.ridges == 0 {
        return;
    }
    let axis = pair.motion.direction(own.ridge_cone.axis.map(f64::from)).map(|c| c as f32);
    facing.extend(near.iter().copied().filter(|&other| {
        let other = &pair.obstacle.leaves[other as usize];
        let Cone { axis: theirs, cos, sin } = other.ridge_cone;
        let aligned = axis[0] * theirs[0] + axis[1] * theirs[1] + axis[2] * theirs[2];
        other.ridges > 0 && own.ridge_cone.faces(cos, sin, aligned)
    }));
}

#[inline(always)]
fn moved(surface: &Surface, edge: &Edge, index: u32, within: f64, motion: &Rigid) -> Ridge {
    let [a, b] = edge.vertices.map(|v| motion.point(surface.vertices[v as usize]));
    let outward = motion.direction(edge.normal.map(f64::from));
    let cone = Cone::wide(outward.map(|c| c as f32), edge.cone);
    Ridge { start: a, along: sub(b, a), outward, within, cone, index }
}

#[inline(always)]
fn bounds(ridge: &Ridge) -> Box32 {
    let mut result = Box32 { min: [0.0; 3], max: [0.0; 3] };
    for axis in 0..3 {
        let (a, b) = (ridge.start[axis], ridge.start[axis] + ridge.along[axis]);
        let slack = 2e-7 * a.abs().max(b.abs()) as f32;
        result.min[axis] = a.min(b) as f32 - slack;
        result.max[axis] = a.max(b) as f32 + slack;
    }
    result
}

#[inline(always)]
fn meet(pair: Pair<'_>, ridge: &Ridge, block: &RidgeBlock, crossing_squared: f64, sink: &mut Sink<'_>) {
    let mut mask = kernel::ridge_ridges(
        ridge.start,
        ridge.along,
        ridge.outward,
        ridge.within * ridge.within,
        crossing_squared,
        block,
    );
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        let axis3 = |a: &[[f64; LANES]; 3]| [a[0][lane], a[1][lane], a[2][lane]];
        if let Some(found) = judge(pair, ridge, block.edge[lane], axis3(&block.start), axis3(&block.along)) {
            sink.push(found);
        }
    }
}

/// The contact of two edges, when their common perpendicular is one that surfaces with these edges can touch along.
fn judge(pair: Pair<'_>, ridge: &Ridge, other: u32, start: Vec3, along: Vec3) -> Option<Found> {
    let (d, e, r) = (ridge.along, along, sub(ridge.start, start));
    let (a, ee, b) = (dot(d, d), dot(e, e), dot(d, e));
    let (c, f) = (dot(d, r), dot(e, r));
    let whole = a * ee - b * b;
    let p = add(ridge.start, scale(d, (b * f - c * ee) / whole));
    let q = add(start, scale(e, (a * f - b * c) / whole));
    let mine = &pair.body.edges[ridge.index as usize];
    let theirs = &pair.obstacle.edges[other as usize];
    let their_outward = theirs.normal.map(f64::from);
    let between = sub(q, p);
    let distance = norm(between);
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
    theirs.triangles.iter().any(|&t| pierces(ridge.start, ridge.along, corners(pair.obstacle, t)))
        || mine
            .triangles
            .iter()
            .any(|&t| pierces(start, along, corners(pair.body, t).map(|v| pair.motion.point(v))))
}

/// True when the segment from `p` along `d` meets the triangle.
pub(super) fn pierces(p: Vec3, d: Vec3, [a, b, c]: [Vec3; 3]) -> bool {
    let (e1, e2, from) = (sub(b, a), sub(c, a), sub(p, a));
    let normal = cross(e1, e2);
    let slope = -dot(d, normal);
    if slope == 0.0 {
        return false;
    }
    let t = dot(from, normal) / slope;
    let moment = cross(d, from);
    // Signs by Cramer's rule; t is exact enough even at a grazing angle since both its parts are.
    let v = -dot(e2, moment) / slope;
    let w = dot(e1, moment) / slope;
    (0.0..=1.0).contains(&t) && v >= 0.0 && w >= 0.0 && v + w <= 1.0
}
