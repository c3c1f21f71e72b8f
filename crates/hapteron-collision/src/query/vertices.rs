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
use std::ops::Range;

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
    /// Bounds of the leaves in a neighbourhood, by groups.
    bounds: Vec<LeafBounds>,
    probes: Vec<Probe>,
    /// By probe and group of its neighbourhood: lower bounds of the squared distances, infinite for the leaf looked in first.
    lowers: Vec<[f32; LANES]>,
    /// Which probes look in which leaves: first each one where it may be closest, then wherever else it must. Longer than what is in use, as the lists that follow.
    looks: Vec<Look>,
    squared: Vec<[f32; LANES]>,
    /// Which triangles may be the closest, by probe, and the feet on them.
    candidates: Vec<(u32, u32)>,
    feet: Vec<Foot>,
}

/// A vertex in search of its foot.
#[derive(Clone, Copy, Debug)]
struct Probe {
    point: Vec3,
    vertex: u32,
    /// The closest triangle is not farther than this.
    within: f32,
    /// Where its neighbourhood begins in the near leaves, and of how many groups it is.
    begin: u32,
    groups: u32,
    /// The closest foot so far, and its distance.
    best: u32,
    distance: f64,
}

impl Probe {
    const NONE: u32 = u32::MAX;
}

/// A leaf in which a probe looks, and how certain the distances of its triangles are.
#[derive(Clone, Copy, Debug, Default)]
struct Look {
    probe: u32,
    leaf: u32,
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

/// Vertices are searched for in batches of about this many, stage by stage: the same inner loop many times over.
const BATCH: usize = 64;

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
            let lower = probes_of_leaf(search, side, scratch, neighbourhood);
            side.clear[i] = Clear::new(lower, search.travelled);
        }
        let last = i + 1 == search.neighbours.of.len();
        if scratch.probes.len() < BATCH && !last {
            continue;
        }
        let first = scratch.probes.len();
        look(search, scratch, 0..first);
        let count = elsewhere(search, scratch);
        look(search, scratch, first..count);
        let count = candidates(search, scratch, count);
        settle(search, scratch, count);
        for probe in &scratch.probes {
            if probe.best == Probe::NONE {
                continue;
            }
            let (triangle, foot) =
                (scratch.candidates[probe.best as usize].1, &scratch.feet[probe.best as usize]);
            side.set(probe.vertex, foot.signed_distance, triangle / LANES as u32);
            push(probe.vertex, probe.point, foot);
        }
        scratch.forget();
    }
}

impl Scratch {
    /// Makes room for the next batch.
    #[inline(always)]
    fn forget(&mut self) {
        self.probes.clear();
        self.lowers.clear();
        self.feet.clear();
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
    for (bounds, some) in scratch.bounds.iter_mut().zip(near.chunks(LANES)) {
        bounds.gather(search.other, some);
    }
    let within = (search.tolerance as f32).next_up();
    let limit = within * within * ROUNDING;
    let own = &search.own.leaves[leaf as usize];
    let mut closest = f32::INFINITY;
    let first = own.first_vertex;
    let points = &search.own.vertices[first as usize..first as usize + usize::from(own.vertices)];
    for (vertex, &point) in (first..).zip(points) {
        let point = search.motion.point(point);
        let point32 = point.map(|c| c as f32);
        let lowers = scratch.lowers.len();
        let mut least = (f32::INFINITY, 0);
        for (group, bounds) in scratch.bounds[..groups].iter().enumerate() {
            let lower = bounds.lower(search.simd, point32, search.slack);
            let own = lower.reduce_min();
            if own < least.0 {
                let lane = lower.simd_le(own).to_bitmask().trailing_zeros() as usize;
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
        for (lower, bounds) in scratch.lowers[lowers..].iter_mut().zip(&scratch.bounds) {
            *lower = bounds.without(kernel::lanes(search.simd, lower), guess).to_array();
        }
        let index = scratch.probes.len();
        if scratch.looks.len() <= index {
            scratch.looks.resize(index + BATCH, Look::default());
        }
        scratch.looks[index] = Look { probe: index as u32, leaf: guess, error: 0.0 };
        let groups = groups as u32;
        scratch.probes.push(Probe { point, vertex, within, begin, groups, best: Probe::NONE, distance: 0.0 });
    }
    f64::from(closest.sqrt() / ROUNDING)
}

/// Lists the leaves that are not farther than the closest triangle so far, behind those already looked in. Gives how many looks there are then.
#[inline(always)]
fn elsewhere<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch) -> usize {
    let Scratch { probes, lowers, looks, .. } = scratch;
    let mut count = probes.len();
    let most = count + LANES * lowers.len();
    if looks.len() <= most {
        looks.resize(most + 1, Look::default());
    }
    let mut lowers = lowers.iter();
    for (index, probe) in probes.iter().enumerate() {
        let limit = probe.within * probe.within * ROUNDING;
        let mut near = probe.begin;
        for lower in lowers.by_ref().take(probe.groups as usize) {
            let mut mask = kernel::lanes(search.simd, lower).simd_lt(limit).to_bitmask();
            // Mostly none or one: written always, kept if there.
            loop {
                let leaf = near + mask.trailing_zeros() % LANES as u32;
                looks[count] = Look { probe: index as u32, leaf, error: 0.0 };
                count += usize::from(mask != 0);
                mask &= mask.wrapping_sub(1);
                if mask == 0 {
                    break;
                }
            }
            near += LANES as u32;
        }
    }
    for look in &mut looks[probes.len()..count] {
        look.leaf = search.neighbours.near[look.leaf as usize];
    }
    count
}

/// Covers the rounding of squares in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;

/// Distances of probes to the triangles of leaves; lowers the bounds of their least distances.
#[inline(always)]
fn look<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch, range: Range<usize>) {
    let Scratch { probes, looks, squared, .. } = scratch;
    if squared.len() < range.end {
        squared.resize(range.end, [0.0; LANES]);
    }
    for (look, result) in looks[range.clone()].iter_mut().zip(&mut squared[range]) {
        let probe = &mut probes[look.probe as usize];
        let block = &search.other.blocks[look.leaf as usize];
        let local = [0, 1, 2].map(|k| (probe.point[k] - f64::from(block.origin[k])) as f32);
        let squared = kernel::squared_distances(search.simd, local, block);
        look.error = block.error + search.error;
        let nearest = squared.reduce_min().sqrt() + look.error;
        probe.within = if nearest < probe.within { nearest } else { probe.within };
        *result = squared.to_array();
    }
}

/// Lists the triangles that may be the closest to their probes (usually one, or those that share a side), of the given number of looks. Gives how many.
#[inline(always)]
fn candidates<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch, looks: usize) -> usize {
    let mut count = 0;
    for (look, squared) in scratch.looks[..looks].iter().zip(&scratch.squared) {
        if scratch.candidates.len() <= count + LANES {
            scratch.candidates.resize(2 * count + BATCH, (0, 0));
        }
        let reach = scratch.probes[look.probe as usize].within + look.error;
        let block = &search.other.blocks[look.leaf as usize];
        let near = kernel::lanes(search.simd, squared).simd_le(reach * reach * ROUNDING);
        let mut mask = kernel::bits(near) & block.filled;
        loop {
            let triangle = block.first_triangle + mask.trailing_zeros() % LANES as u32;
            scratch.candidates[count] = (look.probe, triangle);
            count += usize::from(mask != 0);
            mask &= mask.wrapping_sub(1);
            if mask == 0 {
                break;
            }
        }
    }
    count
}

/// Gives every probe the exact foot on the closest of its candidates, the first of equals: so the result does not depend on where it looked first.
#[inline(always)]
fn settle<S: Simd>(search: &Search<'_, S>, scratch: &mut Scratch, candidates: usize) {
    let Scratch { probes, candidates: all, feet, .. } = scratch;
    for (index, &(probe, triangle)) in all[..candidates].iter().enumerate() {
        let probe = &mut probes[probe as usize];
        let foot = feature::foot(probe.point, triangle, search.other);
        let distance = foot.signed_distance.abs();
        feet.push(foot);
        let first = probe.best == Probe::NONE;
        let closer = first
            || distance < probe.distance
            || (distance == probe.distance && triangle < all[probe.best as usize].1);
        if closer && distance < search.tolerance {
            (probe.best, probe.distance) = (index as u32, distance);
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
