//! For every vertex near the other surface its foot there, its side and its contact.

use super::Pair;
use super::feature::{self, Feature, Foot};
use super::kernel::{self, LeafBounds};
use super::result::{Found, Sink};
use super::side::{Clear, Side};
use super::walk::{Neighbourhood, Neighbours};
use crate::surface::{ERROR, LANES, Surface, VertexNormal};
use crate::vector::{Rigid, Vec3, dot, scale};
use fearless_simd::{Simd, prelude::*};

/// Where the vertices of one surface look for their feet on the other.
struct Search<'a, S> {
    simd: S,
    own: &'a Surface,
    other: &'a Surface,
    neighbours: &'a Neighbours,
    /// From the own frame to the other's.
    motion: &'a Rigid,
    tolerance: f64,
    /// What the body has travelled, metres.
    travelled: f64,
    /// Rounding of single-precision coordinates, metres.
    slack: f32,
    /// Rounding of a distance within the tolerance, to which that of a block is added, metres.
    error: f32,
}

/// Memory of the search, kept to be reused.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    /// Bounds of the leaves in a neighbourhood, eight at a time.
    pub bounds: Vec<LeafBounds>,
    probes: Vec<Probe>,
    lowers: Vec<[f32; LANES]>,
    looks: Vec<Look>,
}

/// A vertex in search of its foot.
#[derive(Clone, Copy, Debug)]
struct Probe {
    vertex: u32,
    point: Vec3,
    /// The closest triangle is not farther than this.
    within: f32,
    /// The leaf to look in first.
    guess: u32,
    /// Its neighbourhood, a range of the near leaves.
    begin: u32,
    end: u32,
    /// Where its bounds of those begin.
    lowers: u32,
    best: Option<(u32, Foot)>,
}

/// A leaf in which a probe looks: the squared distances of its triangles, and how certain these are.
#[derive(Clone, Copy, Debug)]
struct Look {
    probe: u32,
    leaf: u32,
    error: f32,
    squared: [f32; LANES],
}

/// Gives every vertex of the body within the tolerance its signed distance, and makes its contact.
#[inline(always)]
pub(super) fn of_body<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    scratch: &mut Scratch,
    sink: &mut Sink<'_>,
) {
    let search = Search {
        simd,
        own: pair.body,
        other: pair.obstacle,
        neighbours,
        motion: pair.motion,
        tolerance: pair.tolerance,
        travelled: pair.travelled,
        slack: pair.slack() as f32,
        error: ERROR * pair.tolerance as f32,
    };
    simd.vectorize(
        #[inline(always)]
        || {
            run(&search, side, scratch, |vertex, point, foot| {
                push_body_vertex(pair, vertex, point, foot, sink)
            })
        },
    );
}

/// The same for the vertices of the obstacle.
#[inline(always)]
pub(super) fn of_obstacle<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    neighbours: &Neighbours,
    side: &mut Side,
    scratch: &mut Scratch,
    sink: &mut Sink<'_>,
) {
    let search = Search {
        simd,
        own: pair.obstacle,
        other: pair.body,
        neighbours,
        motion: pair.inverse,
        tolerance: pair.tolerance,
        travelled: pair.travelled,
        slack: pair.slack() as f32,
        error: ERROR * pair.tolerance as f32,
    };
    simd.vectorize(
        #[inline(always)]
        || run(&search, side, scratch, |vertex, _, foot| push_obstacle_vertex(pair, vertex, foot, sink)),
    );
}

/// Vertices are searched for in batches of about this many, stage by stage: the same inner loop many times over.
const BATCH: usize = 64;

#[inline(always)]
fn run<S: Simd>(
    search: &Search<'_, S>,
    side: &mut Side,
    scratch: &mut Scratch,
    mut push: impl FnMut(u32, Vec3, &Foot),
) {
    scratch.probes.clear();
    for (i, neighbourhood) in search.neighbours.of.iter().enumerate() {
        let clear = side.clear[i].holds(search.travelled, search.tolerance + f64::from(search.slack));
        if !clear {
            let lower = probes_of_leaf(search, side, scratch, neighbourhood);
            side.clear[i] = Clear::new(lower, search.travelled);
        }
        let last = i + 1 == search.neighbours.of.len();
        if scratch.probes.len() < BATCH && !last {
            continue;
        }
        look_in_guesses(search, scratch);
        look_elsewhere(search, scratch);
        settle(search, scratch);
        for probe in &scratch.probes {
            let Some((triangle, foot)) = probe.best else { continue };
            side.set(probe.vertex, foot.signed_distance, triangle / LANES as u32);
            push(probe.vertex, probe.point, &foot);
        }
        scratch.probes.clear();
        scratch.lowers.clear();
    }
}

/// Makes a probe of every vertex of a leaf that may be within the tolerance of a near leaf. Gives a lower bound of the distances.
#[inline(always)]
fn probes_of_leaf<S: Simd>(
    search: &Search<'_, S>,
    side: &Side,
    scratch: &mut Scratch,
    of: &Neighbourhood,
) -> f64 {
    let &Neighbourhood { leaf, begin, end } = of;
    let near = &search.neighbours.near[begin as usize..end as usize];
    let groups = near.len().div_ceil(LANES);
    if scratch.bounds.len() < groups {
        scratch.bounds.resize(groups, LeafBounds::EMPTY);
    }
    for (bounds, eight) in scratch.bounds.iter_mut().zip(near.chunks(LANES)) {
        bounds.gather(search.other, eight);
    }
    let within = (search.tolerance as f32).next_up();
    let limit = within * within * ROUNDING;
    let own = &search.own.leaves[leaf as usize];
    let mut closest = f32::INFINITY;
    for vertex in own.first_vertex..own.first_vertex + u32::from(own.vertices) {
        let point = search.motion.point(search.own.vertices[vertex as usize]);
        let point32 = point.map(|c| c as f32);
        let lowers = scratch.lowers.len();
        let mut least = (f32::INFINITY, 0);
        for (group, bounds) in scratch.bounds[..groups].iter().enumerate() {
            let lower = bounds.lower(search.simd, point32, search.slack);
            let own = lower.reduce_min();
            if own < least.0 {
                let lane = kernel::bits(lower.simd_le(own)).trailing_zeros() as usize;
                least = (own, group * LANES + lane);
            }
            scratch.lowers.push(lower.to_array());
        }
        closest = if least.0 < closest { least.0 } else { closest };
        if !(least.0 < limit) {
            scratch.lowers.truncate(lowers);
            continue;
        }
        // Without memory begin with the closest box: its triangles usually rule out the others.
        let guess = side.last_leaf(vertex).unwrap_or(near[least.1]);
        let lowers = lowers as u32;
        scratch.probes.push(Probe { vertex, point, within, guess, begin, end, lowers, best: None });
    }
    f64::from(closest.sqrt() / ROUNDING)
}

#[inline(always)]
fn look_in_guesses<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch) {
    let Scratch { probes, looks, .. } = scratch;
    looks.clear();
    for (index, probe) in probes.iter_mut().enumerate() {
        looks.push(look(search, probe, index as u32, probe.guess));
    }
}

/// Looks in all leaves that are not farther than the closest triangle so far.
#[inline(always)]
fn look_elsewhere<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch) {
    let Scratch { probes, lowers, looks, .. } = scratch;
    for (index, probe) in probes.iter_mut().enumerate() {
        let near = &search.neighbours.near[probe.begin as usize..probe.end as usize];
        for (eight, lower) in near.chunks(LANES).zip(&lowers[probe.lowers as usize..]) {
            let mut mask = kernel::bits(
                kernel::lanes(search.simd, lower).simd_lt(probe.within * probe.within * ROUNDING),
            );
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                if eight[lane] != probe.guess {
                    looks.push(look(search, probe, index as u32, eight[lane]));
                }
            }
        }
    }
}

/// Covers the rounding of squares in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;

/// Distances of a probe to the triangles of a leaf; lowers the bound of its least distance.
#[inline(always)]
fn look<S: Simd>(search: &Search<'_, S>, probe: &mut Probe, index: u32, leaf: u32) -> Look {
    let block = &search.other.blocks[leaf as usize];
    let local = [0, 1, 2].map(|k| (probe.point[k] - f64::from(block.origin[k])) as f32);
    let squared = kernel::squared_distances(search.simd, local, block);
    let error = block.error + search.error;
    let nearest = squared.reduce_min().sqrt() + error;
    probe.within = if nearest < probe.within { nearest } else { probe.within };
    Look { probe: index, leaf, error, squared: squared.to_array() }
}

/// Gives every probe the exact foot on the closest of the triangles that may be the closest (usually one), the first of equals:
/// so the result does not depend on where it looked first.
#[inline(always)]
fn settle<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch) {
    for look in &scratch.looks {
        let probe = &mut scratch.probes[look.probe as usize];
        let reach = probe.within + look.error;
        let own = &search.other.leaves[look.leaf as usize];
        let mut mask =
            kernel::bits(kernel::lanes(search.simd, &look.squared).simd_le(reach * reach * ROUNDING))
                & ((1 << own.triangles) - 1);
        while mask != 0 {
            let triangle = own.first_triangle + mask.trailing_zeros();
            mask &= mask - 1;
            let foot = feature::foot(probe.point, triangle, search.other);
            let distance = foot.signed_distance.abs();
            let closer = probe.best.is_none_or(|(other, held)| {
                let held = held.signed_distance.abs();
                distance < held || (distance == held && triangle < other)
            });
            if closer && distance < search.tolerance {
                probe.best = Some((triangle, foot));
            }
        }
    }
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
