//! For every vertex near the other surface its foot there, its side and its contact.

mod lists;

use super::Pair;
use super::feature::{self, Feature, Foot};
use super::kernel::{self, LaneNumbers, Lanes};
use super::result::{Found, Sink};
use super::side::{Clear, Side};
use super::walk::{Neighbourhood, Neighbours};
use crate::surface::{ERROR, LANES, Surface, VertexNormal};
use crate::vector::{Rigid, Vec3, dot, scale};
use fearless_simd::{Simd, prelude::*};
use lists::{Group, Looks};

pub(super) use lists::Scratch;

/// No foot.
const NONE: u32 = u32::MAX;

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

/// Vertices are searched for in batches of so many groups, stage by stage: the same inner loop many times over.
const BATCH: usize = 12;

#[inline(always)]
fn run<S: Simd>(
    search: &Search<'_, S>,
    side: &mut Side,
    scratch: &mut Scratch,
    mut push: impl FnMut(u32, Vec3, &Foot),
) {
    scratch.forget();
    for (i, neighbourhood) in search.neighbours.of.iter().enumerate() {
        let clear = side.clear[i].holds(search.travelled, search.tolerance + f64::from(search.slack));
        if !clear {
            let lower = groups_of_leaf(search, side, scratch, neighbourhood);
            side.clear[i] = Clear::new(lower, search.travelled);
        }
        let last = i + 1 == search.neighbours.of.len();
        if scratch.groups.len() < BATCH && !last {
            continue;
        }
        look(search, scratch, 0);
        let first = scratch.looks.count;
        elsewhere(search, scratch);
        look(search, scratch, first);
        candidates(search, scratch);
        settle(search, scratch);
        for (group, at) in scratch.groups.iter().enumerate() {
            let best = LaneNumbers::load_array_ref(search.simd, &scratch.best[group]);
            let mut mask = best.simd_lt(NONE).to_bitmask();
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize % LANES;
                mask &= mask - 1;
                let vertex = at.first_vertex + lane as u32;
                let best = scratch.best[group][lane] as usize;
                let foot = &scratch.feet[best];
                side.set(vertex, foot.signed_distance, scratch.candidates.triangle[best] / LANES as u32);
                push(vertex, scratch.points[group][lane], foot);
            }
        }
        scratch.forget();
    }
}

/// Makes groups of the vertices of a leaf, those of them that have one within the tolerance of a near leaf, and looks for these in the likeliest leaf.
/// Gives a lower bound of the distances.
#[inline(always)]
fn groups_of_leaf<S: Simd>(
    search: &Search<'_, S>,
    side: &Side,
    scratch: &mut Scratch,
    of: &Neighbourhood,
) -> f64 {
    let simd = search.simd;
    let &Neighbourhood { leaf, begin, end } = of;
    let near = &search.neighbours.near[begin as usize..end as usize];
    let within = (search.tolerance as f32).next_up();
    let limit = within * within * ROUNDING;
    let own = &search.own.leaves[leaf as usize];
    let mut closest = Lanes::splat(simd, f32::INFINITY);
    let numbers = LaneNumbers::load_array_ref(simd, &kernel::NUMBERS);
    let all = &search.own.vertices[own.first_vertex as usize..][..usize::from(own.vertices)];
    for (group, vertices) in all.chunks(LANES).enumerate() {
        let first_vertex = own.first_vertex + (group * LANES) as u32;
        let mut points = [[0.0; 3]; LANES];
        let mut at = [[0.0; LANES]; 3];
        for (lane, &vertex) in vertices.iter().enumerate().take(LANES) {
            let point = search.motion.point(vertex);
            points[lane] = point;
            for k in 0..3 {
                at[k][lane] = point[k] as f32;
            }
        }
        let at = kernel::lanes_of(simd, &at);
        let first = scratch.lowers.len();
        let mut least = Lanes::splat(simd, f32::INFINITY);
        let mut guess = LaneNumbers::splat(simd, 0);
        for &other in near {
            let lower = kernel::leaf_squared(simd, &at, &search.other.leaves[other as usize], search.slack);
            guess = lower.simd_lt(least).select(LaneNumbers::splat(simd, other), guess);
            least = least.min(lower);
            scratch.lowers.push(lower.to_array());
        }
        let filled = numbers.simd_lt(vertices.len() as u32);
        let least = filled.select(least, Lanes::splat(simd, f32::INFINITY));
        closest = closest.min(least);
        let probes = least.simd_lt(limit);
        if probes.all_false() {
            scratch.lowers.truncate(first);
            continue;
        }
        // Without memory begin with the closest box: its triangles usually rule out the others.
        let last = side.last_leaves(first_vertex, vertices.len());
        let last = LaneNumbers::load_array_ref(simd, &last);
        let guess = last.simd_gt(0).select(last - 1, guess);
        let slots = numbers + (scratch.groups.len() * LANES) as u32;
        let looks = &mut scratch.looks;
        looks.expect(LANES);
        kernel::append(&mut looks.slot, looks.count, slots, probes);
        looks.count = kernel::append(&mut looks.leaf, looks.count, guess, probes);
        scratch.groups.push(Group { first_vertex, begin, end });
        scratch.points.push(points);
        scratch.within.push(probes.select(Lanes::splat(simd, within), Lanes::splat(simd, 0.0)).to_array());
        scratch.guesses.push(guess.to_array());
        scratch.best.push([NONE; LANES]);
        scratch.distances.push([f64::INFINITY; LANES]);
    }
    f64::from(closest.reduce_min().sqrt() / ROUNDING)
}

/// Lists the other leaves that are not farther than the closest triangle so far.
#[inline(always)]
fn elsewhere<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch) {
    let simd = search.simd;
    let looks = &mut scratch.looks;
    let mut lowers = scratch.lowers.iter();
    let mut slots = LaneNumbers::load_array_ref(simd, &kernel::NUMBERS);
    for (group, (within, guess)) in scratch.groups.iter().zip(scratch.within.iter().zip(&scratch.guesses)) {
        let within = kernel::lanes(simd, within);
        let limit = within * within * ROUNDING;
        let guess = LaneNumbers::load_array_ref(simd, guess);
        let near = &search.neighbours.near[group.begin as usize..group.end as usize];
        looks.expect(LANES * (near.len() + 1));
        for (&leaf, lower) in near.iter().zip(lowers.by_ref()) {
            let set = kernel::lanes(simd, lower).simd_lt(limit) & guess.simd_ne(leaf);
            kernel::append(&mut looks.slot, looks.count, slots, set);
            let all = LaneNumbers::splat(simd, leaf);
            if let Some(room) = looks.leaf[looks.count..].first_chunk_mut() {
                *room = all.to_array();
            }
            looks.count += set.to_bitmask().count_ones() as usize;
        }
        slots += LANES as u32;
    }
}

/// Covers the rounding of squares in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;

/// Distances of vertices to the triangles of leaves, from look number `first` on; lowers the bounds of their least distances.
#[inline(always)]
fn look<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch, first: usize) {
    let Looks { count, slot, leaf, squared, error } = &mut scratch.looks;
    let range = first..*count;
    let lists = slot[range.clone()].iter().zip(&leaf[range.clone()]);
    for ((&slot, &leaf), (result, error)) in
        lists.zip(squared[range.clone()].iter_mut().zip(&mut error[range]))
    {
        let (group, lane) = (slot as usize / LANES, slot as usize % LANES);
        let point = &scratch.points[group][lane];
        let block = &search.other.blocks[leaf as usize];
        let local = [0, 1, 2].map(|k| (point[k] - f64::from(block.origin[k])) as f32);
        let squared = kernel::squared_distances(search.simd, local, block);
        *error = block.error + search.error;
        let nearest = squared.reduce_min().sqrt() + *error;
        let within = &mut scratch.within[group][lane];
        *within = if nearest < *within { nearest } else { *within };
        *result = squared.to_array();
    }
}

/// Lists the triangles that may be the closest (usually one, or those that share a side).
#[inline(always)]
fn candidates<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch) {
    let simd = search.simd;
    let Scratch { looks, candidates, within, .. } = scratch;
    let count = search.other.triangles.len() as u32;
    let numbers = LaneNumbers::load_array_ref(simd, &kernel::NUMBERS);
    for look in 0..looks.count {
        let (slot, leaf) = (looks.slot[look], looks.leaf[look]);
        let reach = within[slot as usize / LANES][slot as usize % LANES] + looks.error[look];
        candidates.expect(LANES);
        // All leaves but the last are full.
        let triangles = numbers + leaf * LANES as u32;
        let near = kernel::lanes(simd, &looks.squared[look]).simd_le(reach * reach * ROUNDING)
            & triangles.simd_lt(count);
        if let Some(room) = candidates.slot[candidates.count..].first_chunk_mut() {
            *room = [slot; LANES];
        }
        candidates.count = kernel::append(&mut candidates.triangle, candidates.count, triangles, near);
    }
}

/// Gives every vertex the exact foot on the closest of its candidates, the first of equals: so the result does not depend on where it looked first.
#[inline(always)]
fn settle<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch) {
    let Scratch { candidates, points, best, distances, feet, .. } = scratch;
    let slots = &candidates.slot[..candidates.count];
    for (index, (&slot, &triangle)) in slots.iter().zip(&candidates.triangle).enumerate() {
        let (group, lane) = (slot as usize / LANES, slot as usize % LANES);
        let foot = feature::foot(points[group][lane], triangle, search.other);
        let distance = foot.signed_distance.abs();
        feet.push(foot);
        let (best, held) = (&mut best[group][lane], &mut distances[group][lane]);
        let first = |other: Option<&u32>| other.is_none_or(|&other| triangle < other);
        let closer =
            distance < *held || (distance == *held && first(candidates.triangle.get(*best as usize)));
        if closer && distance < search.tolerance {
            (*best, *held) = (index as u32, distance);
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
