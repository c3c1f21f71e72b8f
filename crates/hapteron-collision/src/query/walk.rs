//! The walk through both trees: which leaves of the two surfaces come close to each other.

mod corners;
mod gathered;
mod inversion;
mod lists;

use super::Pair;
use super::bounds::{self, Bounds, Boxes, MovedChildren, Slab};
use super::kernel::{LaneMask, LaneNumbers, bits};
use crate::surface::{EMPTY, LANES, LEAF, Node, Surface};
use crate::vector::{Rigid, Vec3, norm};
use corners::{Columns, Corners};
use fearless_simd::{Simd, prelude::*};
use gathered::{Close, Gathered};
use inversion::Inversion;
use lists::Pairs;

pub(super) use lists::{Neighbourhood, Neighbours};

/// Memory of the walk, and its result.
#[derive(Clone, Debug, Default)]
pub(super) struct Walk {
    stack: Vec<Frame>,
    candidates: Vec<Candidate>,
    /// Nodes of the obstacle to be opened, and free places behind them.
    pending: Vec<u32>,
    gathered: Gathered,
    close: Close,
    corners: Corners,
    inversion: Inversion,
    /// Leaves that may be closer than what was asked for.
    pub near: Pairs,
    /// Those of them that may meet before the near ones must be looked for again.
    pub touching: Pairs,
}

/// How far apart near and touching leaves may be, single precision allowed for.
#[derive(Clone, Copy)]
struct Margins {
    near: f32,
    touching: f32,
}

/// A node of the body's tree, and a range of the candidates, which are near it.
#[derive(Clone, Copy, Debug)]
struct Frame {
    node: u32,
    begin: u32,
    end: u32,
    bounds: Bounds,
}

/// Some children of a node of the obstacle.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    node: u32,
    /// One bit a child.
    children: u32,
}

/// Finds all pairs of leaves that may be closer than the tolerance after the body has travelled a distance of `ahead`.
#[inline(always)]
pub(super) fn walk<S: Simd>(simd: S, pair: Pair<'_>, ahead: f64, walk: &mut Walk) {
    walk.near.body.of.clear();
    walk.touching.body.of.clear();
    walk.candidates.clear();
    walk.stack.clear();
    if !(pair.body.nodes.is_empty() || pair.obstacle.nodes.is_empty()) {
        let touching = (ahead + pair.slack()) as f32;
        let margins = Margins { near: (pair.tolerance + ahead + pair.slack()) as f32, touching };
        descend(simd, pair, walk, margins);
    }
    let Walk { inversion, near, touching, .. } = walk;
    near.body.finish();
    touching.body.finish();
    inversion.invert(simd, near, pair.obstacle.leaves.len());
    // Nobody asks what of the obstacle lies in a body that has no inside.
    touching.obstacle.of.clear();
    if pair.body.closed {
        inversion.invert(simd, touching, pair.obstacle.leaves.len());
    }
}

#[inline(always)]
fn descend<S: Simd>(simd: S, pair: Pair<'_>, walk: &mut Walk, margins: Margins) {
    let columns = Columns::new(simd, pair.motion);
    let root = &pair.body.nodes[0];
    let bounds =
        MovedChildren::new(simd, root, pair.motion).around(simd, children(root).0 | children(root).1);
    let near = Boxes::of(&pair.obstacle.nodes[0]).near(simd, &bounds, margins.near);
    walk.candidates.push(Candidate { node: 0, children: bits(near) });
    walk.stack.push(Frame { node: 0, begin: 0, end: 1, bounds });
    while let Some(frame) = walk.stack.pop() {
        walk.candidates.truncate(frame.end as usize);
        let node = &pair.body.nodes[frame.node as usize];
        let moved = MovedChildren::new(simd, node, pair.motion);
        let (mut leaves, mut nodes) = children(node);
        if leaves != 0 {
            // The box around the leaves after the motion is smaller than the one around all that was moved.
            let around = moved.around(simd, leaves);
            let bounds = Bounds { center: around.center, half: around.half, ..frame.bounds };
            gather(simd, pair.obstacle, walk, &frame, &bounds, margins.near);
            let most = walk.gathered.count() * leaves.count_ones() as usize;
            leaves = if most == 0 { 0 } else { leaves };
            walk.near.body.reserve(most);
            walk.touching.body.reserve(most);
            while leaves != 0 {
                let lane = leaves.trailing_zeros() as usize % LANES;
                leaves &= leaves - 1;
                if !walk.gathered.far(simd, &moved.of(lane), margins.near) {
                    meet_leaf(simd, pair, walk, node.child[lane] & !LEAF, &columns, margins);
                }
            }
        }
        let extents = moved.extents(simd, margins.near);
        while nodes != 0 {
            let lane = nodes.trailing_zeros() as usize % LANES;
            nodes &= nodes - 1;
            let begin = walk.candidates.len() as u32;
            let bounds = moved.of(lane);
            refine(simd, pair.obstacle, walk, &frame, &bounds, extents[lane], margins.near);
            let end = walk.candidates.len() as u32;
            if begin != end {
                walk.stack.push(Frame { node: node.child[lane], begin, end, bounds });
            }
        }
    }
}

/// Which of a node's children are leaves, and which nodes; one bit each.
#[inline(always)]
fn children(node: &Node) -> (u32, u32) {
    let (mut leaves, mut nodes) = (0, 0);
    for (lane, &child) in node.child.iter().enumerate() {
        leaves |= u32::from(child & LEAF != 0 && child != EMPTY) << lane;
        nodes |= u32::from(child & LEAF == 0) << lane;
    }
    (leaves, nodes)
}

/// Puts a node's children that the mask says onto the pile of those to be opened, of which there are `count`.
#[inline(always)]
fn open<S: Simd>(simd: S, pending: &mut Vec<u32>, count: &mut usize, node: &Node, mask: LaneMask<S>) {
    if pending.len() < *count + LANES {
        pending.resize(2 * (*count + LANES), 0);
    }
    let children = LaneNumbers::load_array_ref(simd, &node.child);
    children.compress(mask).store_slice(&mut pending[*count..*count + LANES]);
    *count += bits(mask).count_ones() as usize;
}

/// Appends to the candidates those children of the frame's that may be within the margin of `b`, opened until the squared diagonals of their
/// boxes are not longer than `extent`.
#[inline(always)]
fn refine<S: Simd>(
    simd: S,
    obstacle: &Surface,
    walk: &mut Walk,
    frame: &Frame,
    b: &Bounds,
    extent: f32,
    margin: f32,
) {
    let Walk { candidates, pending, .. } = walk;
    let mut count = 0;
    for i in frame.begin as usize..frame.end as usize {
        let Candidate { node: index, children } = candidates[i];
        let node = &obstacle.nodes[index as usize];
        let near = Boxes::of(node).near(simd, b, margin) & LaneMask::from_bitmask(simd, u64::from(children));
        let coarse = near & bounds::coarse_nodes(simd, node, extent);
        open(simd, pending, &mut count, node, coarse);
        let children = bits(near & !coarse);
        if children != 0 {
            candidates.push(Candidate { node: index, children });
        }
    }
    while count > 0 {
        count -= 1;
        let index = pending[count];
        let node = &obstacle.nodes[index as usize];
        let near = Boxes::of(node).near(simd, b, margin);
        let coarse = near & bounds::coarse_nodes(simd, node, extent);
        open(simd, pending, &mut count, node, coarse);
        let children = bits(near & !coarse);
        if children != 0 {
            candidates.push(Candidate { node: index, children });
        }
    }
}

/// Gathers the leaves below the frame's candidates that may be within the margin of `b`.
#[inline(always)]
fn gather<S: Simd>(simd: S, obstacle: &Surface, walk: &mut Walk, frame: &Frame, b: &Bounds, margin: f32) {
    let Walk { candidates, pending, gathered, .. } = walk;
    gathered.clear();
    let mut count = 0;
    for &Candidate { node, children } in &candidates[frame.begin as usize..frame.end as usize] {
        let node = &obstacle.nodes[node as usize];
        let near = LaneMask::from_bitmask(simd, u64::from(children)) & Boxes::of(node).touch(simd, b, margin);
        let nodes = bounds::nodes(simd, node);
        open(simd, pending, &mut count, node, near & nodes);
        gathered.append(simd, node, near & !nodes);
    }
    while count > 0 {
        count -= 1;
        let node = &obstacle.nodes[pending[count] as usize];
        let near = Boxes::of(node).near(simd, b, margin);
        let nodes = bounds::nodes(simd, node);
        open(simd, pending, &mut count, node, near & nodes);
        gathered.append(simd, node, near & !nodes);
    }
    gathered.finish(simd);
}

/// Lists the gathered leaves that may be within the margins of a leaf of the body.
#[inline(always)]
fn meet_leaf<S: Simd>(
    simd: S,
    pair: Pair<'_>,
    walk: &mut Walk,
    index: u32,
    columns: &Columns<S>,
    margins: Margins,
) {
    let Walk { gathered, close, corners, near, touching, .. } = walk;
    let leaf = &pair.body.leaves[index as usize];
    corners.take(simd, pair.body, leaf, columns);
    let slab = Slab::of(leaf, pair.motion);
    let mut lists = [near.body.list(), touching.body.list()];
    gathered.meet(simd, corners, &slab, margins, close, &mut lists);
    let [near_end, touching_end] = [lists[0].len, lists[1].len];
    near.body.end(index, near_end);
    touching.body.end(index, touching_end);
}

/// Greatest distance between the places of any point of a body under two motions; `root` is the first node of its tree.
pub(super) fn displacement(root: &Node, from: &Rigid, to: &Rigid) -> f64 {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for lane in (0..LANES).filter(|&l| root.child[l] != EMPTY) {
        for axis in 0..3 {
            low[axis] = low[axis].min(f64::from(root.min[axis][lane]));
            high[axis] = high[axis].max(f64::from(root.max[axis][lane]));
        }
    }
    // The distance is convex in the point, so it is greatest at a corner of the box.
    (0..8)
        .map(|corner| {
            let at = |axis: usize| {
                if corner >> axis & 1 == 0 { low[axis] } else { high[axis] }
            };
            let p: Vec3 = [at(0), at(1), at(2)];
            norm(crate::vector::sub(to.point(p), from.point(p)))
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::mesh::TriMesh;
    use crate::query::feature;
    use fearless_simd::{Level, dispatch};
    use nalgebra::{Isometry3, Vector3};
    use std::collections::BTreeSet;

    /// A closed surface of many small tetrahedra at random places in a cube of the given size.
    fn scattered(number: &mut impl FnMut() -> f64, count: u32, size: f64) -> Surface {
        let mut vertices: Vec<Vec3> = Vec::new();
        for _ in 0..count {
            let at = [0; 3].map(|_| size * number());
            vertices.extend((0..4).map(|_| [0, 1, 2].map(|k| at[k] + 0.1 * number())));
        }
        let faces = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        let triangles = (0..4 * count).map(|t| faces[t as usize % 4].map(|v| t / 4 * 4 + v)).collect();
        Surface::build(&TriMesh::new(vertices, triangles).unwrap())
    }

    /// Pairs of leaves of which a corner of one is closer to a triangle of the other than a distance.
    fn close(body: &Surface, obstacle: &Surface, motion: &Rigid, within: f64) -> BTreeSet<(u32, u32)> {
        let mut result = BTreeSet::new();
        for (i, own) in body.leaves.iter().enumerate() {
            let triangles = |leaf: &crate::surface::Leaf| {
                leaf.first_triangle..leaf.first_triangle + u32::from(leaf.triangles)
            };
            let corners: Vec<Vec3> =
                triangles(own).flat_map(|t| feature::corners(t, body)).map(|v| motion.point(v)).collect();
            for (j, other) in obstacle.leaves.iter().enumerate() {
                let far = |p: &Vec3| {
                    triangles(other).all(|t| feature::foot(*p, t, obstacle).signed_distance.abs() >= within)
                };
                if !corners.iter().all(far) {
                    result.insert((i as u32, j as u32));
                }
            }
        }
        result
    }

    fn listed(neighbours: &Neighbours) -> Vec<(u32, u32)> {
        let near = |of: &Neighbourhood| &neighbours.near[of.begin as usize..of.end as usize];
        neighbours.of.iter().flat_map(|of| near(of).iter().map(|&other| (of.leaf, other))).collect()
    }

    /// Would catch a pair of close leaves that the walk passes over, one that is listed twice, and lists by leaf of the obstacle that are out of
    /// order, or do not hold the pairs of this walk and no others; and a walk that lists much that is far.
    #[test]
    fn lists_hold_every_close_pair_from_both_sides() {
        let mut seed = 5u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let surfaces = [scattered(&mut number, 200, 1.0), scattered(&mut number, 300, 1.5)];
        let mut memory = Walk::default();
        let (mut found, mut kept, mut all) = (0, 0, 0);
        for round in 0..20 {
            let pose = Isometry3::new(
                Vector3::from([0; 3].map(|_| 2.0 * number())),
                Vector3::from([0; 3].map(|_| 3.0 * number())),
            );
            let [motion, inverse] = [pose, pose.inverse()].map(|pose| Rigid::from_isometry(&pose));
            // One time everything is near, which is more than is held against a leaf in one piece; and the memory changes hands.
            let (tolerance, ahead) = (if round == 7 { 9.0 } else { 0.05 }, 0.05 * f64::from(round % 3));
            let [body, obstacle] = [&surfaces[round as usize % 2], &surfaces[1 - round as usize % 2]];
            let pair = Pair { body, obstacle, motion: &motion, inverse: &inverse, tolerance, travelled: 0.0 };
            dispatch!(Level::new(), simd => walk(simd, pair, ahead, &mut memory));
            for (pairs, within) in [(&memory.near, tolerance + ahead), (&memory.touching, ahead)] {
                let by_body = listed(&pairs.body);
                let set: BTreeSet<_> = by_body.iter().copied().collect();
                assert_eq!(set.len(), by_body.len(), "{round}: a pair is listed twice");
                let close = close(body, obstacle, &motion, within);
                assert!(close.is_subset(&set), "{round}: {:?}", close.difference(&set).next());
                let by_obstacle = listed(&pairs.obstacle);
                assert!(by_obstacle.is_sorted_by_key(|&(other, _)| other), "{round}");
                assert_eq!(by_obstacle.len(), by_body.len(), "{round}");
                assert!(by_obstacle.iter().all(|&(other, own)| set.contains(&(own, other))), "{round}");
                found += close.len();
                kept += set.len();
            }
            all += body.leaves.len() * obstacle.leaves.len();
        }
        assert!(found > 500 && found < all / 10 && kept < 2 * found, "{found} and {kept} of {all}");
    }
}
