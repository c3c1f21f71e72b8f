//! Edges against edges: the close or crossing places that no vertex shows.

use super::Pair;
use super::feature::Feature;
use super::kernel;
use super::kernel::Lanes;
use super::result::{Found, Sink};
use super::ridge_kernel::{MovedRidges, meeting};
use super::ridge_store::{RidgeBlock, RidgeStore};
use super::side::{Clear, Side};
use super::walk::Neighbours;
use crate::surface::{Cone, Edge, EdgeKind, LANES, Leaf, Surface};
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub, unit_or};
use fearless_simd::{Simd, prelude::*};

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
    own: Vec<Own>,
    /// By neighbourhood of the body in the last walk.
    pub clear: Vec<Clear>,
}

/// Edges of a leaf of the body.
#[derive(Clone, Debug)]
struct Own {
    moved: MovedRidges,
    /// How close each must come to show more than its ends do, when that has been asked for.
    within: Option<[f32; LANES]>,
}

impl Ridges {
    /// Forgets everything and makes room for two surfaces.
    pub(super) fn reset(&mut self, pair: Pair<'_>) {
        self.stores[0].reset(pair.body);
        self.stores[1].reset(pair.obstacle);
    }
}

impl Own {
    #[inline(always)]
    fn within(&mut self, leaf: &Leaf, eight: usize, reach: impl Fn(u32) -> f64) -> [f32; LANES] {
        if let Some(within) = self.within {
            return within;
        }
        // No distance is less than that.
        let mut within = [f32::NEG_INFINITY; LANES];
        let first = leaf.first_edge + (eight * LANES) as u32;
        for (edge, within) in (first..leaf.first_edge + u32::from(leaf.ridges)).zip(&mut within) {
            let reach = reach(edge);
            if reach > 0.0 {
                *within = (reach as f32).next_up();
            }
        }
        self.within = Some(within);
        within
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
fn reach(surface: &Surface, edge: u32, side: &Side, pair: Pair<'_>, least: f64) -> f64 {
    let [a, b] = surface.edges[edge as usize].vertices;
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
    sides: [&Side; 2],
    ridges: &mut Ridges,
    sink: &mut Sink<'_>,
) {
    // Edges may only show more than the vertices did, so the vertices' least distance is what they must beat.
    let least = sink.least.min(pair.tolerance);
    let first = sink.contacts.len();
    let Ridges { stores, own, clear } = ridges;
    stores.iter_mut().for_each(|store| store.expect(neighbours.of.len()));
    for (clear, neighbourhood) in clear.iter_mut().zip(&neighbours.of) {
        let leaf = &pair.body.leaves[neighbourhood.leaf as usize];
        if leaf.ridges == 0 || clear.holds(pair.travelled, pair.tolerance) {
            continue;
        }
        let near = &neighbours.near[neighbourhood.begin as usize..neighbourhood.end as usize];
        let own_reach = |edge| reach(pair.body, edge, sides[0], pair, least);
        let lower =
            of_leaf(simd, pair, neighbourhood.leaf, near, stores, own, own_reach, |a, b, crossing| {
                let within = own_reach(a).min(reach(pair.obstacle, b, sides[1], pair, least));
                if within > 0.0
                    && let Some(found) = judge(pair, &Ridge::new(pair, a), b, within, crossing)
                {
                    sink.push(found);
                }
            });
        *clear = Clear::new(f64::from(lower), pair.travelled);
    }
    sink.sort_from(first);
}

/// Hands on all pairs of edges that may touch, one of a leaf of the body and one of the leaves near it, and up to which distance they may have
/// passed each other. Gives a lower bound of the distance of any edge from any of the leaves.
#[inline(always)]
fn of_leaf<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    index: u32,
    near: &[u32],
    [store, other_store]: &mut [RidgeStore; 2],
    own: &mut Vec<Own>,
    reach: impl Fn(u32) -> f64,
    mut hand_on: impl FnMut(u32, u32, f64),
) -> f32 {
    let (slack, tolerance) = (pair.slack() as f32, (pair.tolerance as f32).next_up());
    let leaf = &pair.body.leaves[index as usize];
    let block = &pair.body.blocks[index as usize];
    let (radius, origin) = (block.radius(), pair.motion.point(block.origin.map(f64::from)));
    let origin32 = [origin[0] as f32, origin[1] as f32, origin[2] as f32];
    let own = move_ridges(simd, store.of(pair.body, index), &pair.rotation32(), origin32, own);
    let axis = pair.motion.direction(leaf.ridge_cone.axis.map(f64::from));
    let cone = Cone { axis: [axis[0] as f32, axis[1] as f32, axis[2] as f32], ..leaf.ridge_cone };
    let mut lower = Lanes::splat(simd, f32::INFINITY);
    for &other in near {
        let theirs = &pair.obstacle.leaves[other as usize];
        let facing = theirs.ridges > 0 && cone.faces_cone(&theirs.ridge_cone);
        for (eight, block) in own.iter_mut().enumerate() {
            let apart = block.moved.segments.apart(simd, theirs, slack);
            lower = lower.min(apart);
            if !facing {
                continue;
            }
            let mut mask = kernel::bits(apart.simd_lt(tolerance));
            if mask != 0 {
                mask &= block.moved.facing(simd, &theirs.ridge_cone) & RidgeBlock::filled(leaf, eight);
            }
            if mask == 0 {
                continue;
            }
            let within = block.within(leaf, eight, &reach);
            mask &= kernel::bits(apart.simd_lt(kernel::lanes(simd, &within)));
            let touching = kernel::bits(apart.simd_le(0.0));
            let block32 = &pair.obstacle.blocks[other as usize];
            let from = local(origin, block32.origin);
            let far = from[0].abs() + from[1].abs() + from[2].abs() + 3.0 * (radius + block32.radius());
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                // Edges that have passed each other lie in leaves that overlap.
                let (crossing, within) =
                    if touching >> lane & 1 == 1 { (pair.tolerance, tolerance) } else { (0.0, within[lane]) };
                let ridge = block.moved.edge(lane, from);
                let number = leaf.first_edge + (eight * LANES + lane) as u32;
                for (group, blocks) in other_store.of(pair.obstacle, other).iter().enumerate() {
                    let mask = meeting(simd, &ridge, blocks, within, far) & RidgeBlock::filled(theirs, group);
                    let first = theirs.first_edge + (group * LANES) as u32;
                    set_bits(mask, |lane| hand_on(number, first + lane, crossing));
                }
            }
        }
    }
    lower.reduce_min()
}

/// Turns the ridges of a leaf of the body into the obstacle's frame, where the leaf's origin is at `origin`.
#[inline(always)]
fn move_ridges<'a, S: Simd>(
    simd: S,
    blocks: &[RidgeBlock],
    rotation: &[[f32; 3]; 3],
    origin: [f32; 3],
    own: &'a mut Vec<Own>,
) -> &'a mut [Own] {
    if own.len() < blocks.len() {
        own.resize(blocks.len(), Own { moved: MovedRidges::EMPTY, within: None });
    }
    for (own, block) in own.iter_mut().zip(blocks) {
        own.moved.set(simd, block, rotation, origin);
        own.within = None;
    }
    &mut own[..blocks.len()]
}

/// Calls a function with the number of each bit that is set, from the lowest.
#[inline(always)]
fn set_bits(mut mask: u32, mut call: impl FnMut(u32)) {
    while mask != 0 {
        call(mask.trailing_zeros());
        mask &= mask - 1;
    }
}

/// A point in single precision, as seen from another one.
#[inline(always)]
fn local(from: Vec3, p: [f32; 3]) -> [f32; 3] {
    [
        (f64::from(p[0]) - from[0]) as f32,
        (f64::from(p[1]) - from[1]) as f32,
        (f64::from(p[2]) - from[2]) as f32,
    ]
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
