//! The walk through both trees: which leaves of the two surfaces come close to each other.

use super::Pair;
use super::bounds::{self, Bounds, Corners, MovedChildren, Slab};
use crate::surface::{EMPTY, LANES, LEAF, Node, Surface};
use crate::vector::{Rigid, Vec3, norm};
use fearless_simd::Simd;

/// A leaf with the leaves of the other surface that come close to it, a range of a list.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbourhood {
    pub leaf: u32,
    pub begin: u32,
    pub end: u32,
}

/// Leaves of one surface with those of the other that are near, in a fixed order of the first.
#[derive(Clone, Debug, Default)]
pub(super) struct Neighbours {
    pub of: Vec<Neighbourhood>,
    pub near: Vec<u32>,
}

/// Pairs of leaves, from both sides.
#[derive(Clone, Debug, Default)]
pub(super) struct Pairs {
    pub body: Neighbours,
    pub obstacle: Neighbours,
}

impl Pairs {
    fn clear(&mut self) {
        self.body.of.clear();
        self.body.near.clear();
    }

    /// Ends the list of a leaf of the body that began at `begin`.
    #[inline(always)]
    fn end(&mut self, leaf: u32, begin: usize) {
        let (begin, end) = (begin as u32, self.body.near.len() as u32);
        if begin != end {
            self.body.of.push(Neighbourhood { leaf, begin, end });
        }
    }
}

/// Memory of the walk, and its result.
#[derive(Clone, Debug, Default)]
pub(super) struct Walk {
    stack: Vec<Frame>,
    candidates: Vec<u32>,
    /// By candidate of the frame at hand: which children of the body's node it is near, for all that is known.
    masks: Vec<u32>,
    pending: Vec<u32>,
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

/// A node of the body's tree with a range of `candidates` that it must be compared with.
#[derive(Clone, Copy, Debug)]
struct Frame {
    node: u32,
    begin: u32,
    end: u32,
}

/// Finds all pairs of leaves that may be closer than the tolerance after the body has travelled a distance of `ahead`.
#[inline(always)]
pub(super) fn walk<S: Simd>(simd: S, pair: Pair<'_>, ahead: f64, walk: &mut Walk) {
    walk.near.clear();
    walk.touching.clear();
    walk.candidates.clear();
    walk.stack.clear();
    if pair.body.nodes.is_empty() || pair.obstacle.nodes.is_empty() {
        return;
    }
    let touching = (ahead + pair.slack()) as f32;
    let margins = Margins { near: (pair.tolerance + ahead + pair.slack()) as f32, touching };
    walk.candidates.push(0);
    walk.stack.push(Frame { node: 0, begin: 0, end: 1 });
    while let Some(frame) = walk.stack.pop() {
        walk.candidates.truncate(frame.end as usize);
        let node = &pair.body.nodes[frame.node as usize];
        let children = MovedChildren::new(simd, node, pair.motion);
        walk.masks.clear();
        for &candidate in &walk.candidates[frame.begin as usize..] {
            walk.masks.push(match candidate & LEAF {
                0 => u32::MAX,
                _ => children.near(simd, &pair.obstacle.leaves[(candidate & !LEAF) as usize], margins.near),
            });
        }
        for lane in 0..LANES {
            let child = node.child[lane];
            if child == EMPTY {
                continue;
            }
            let begin = walk.candidates.len() as u32;
            let bounds = children.of(lane);
            refine(simd, pair.obstacle, walk, frame, lane, &bounds, margins.near, child & LEAF != 0);
            let end = walk.candidates.len() as u32;
            if begin == end {
                continue;
            }
            if child & LEAF == 0 {
                walk.stack.push(Frame { node: child, begin, end });
            } else {
                meet_leaf(simd, pair, walk, child & !LEAF, begin as usize, margins);
                walk.candidates.truncate(begin as usize);
            }
        }
    }
    let Walk { inversion, near, touching, .. } = walk;
    inversion.invert(near, pair.obstacle.leaves.len());
    // Nobody asks what of the obstacle lies in a body that has no inside.
    touching.obstacle.of.clear();
    if pair.body.closed {
        inversion.invert(touching, pair.obstacle.leaves.len());
    }
}

/// Appends to the candidates those of the frame that may be within the margin of `b`, opened down to about its size or, for a leaf, to leaves.
#[inline(always)]
fn refine<S: Simd>(
    simd: S,
    obstacle: &Surface,
    walk: &mut Walk,
    frame: Frame,
    lane: usize,
    b: &Bounds,
    margin: f32,
    to_leaves: bool,
) {
    let extent = b.extent(margin);
    for i in 0..(frame.end - frame.begin) as usize {
        if walk.masks[i] >> lane & 1 == 0 {
            continue;
        }
        let candidate = walk.candidates[frame.begin as usize + i];
        if candidate & LEAF != 0 {
            walk.candidates.push(candidate);
            continue;
        }
        // The node's own box was seen to be near the parent of `b`; look at its children.
        walk.pending.push(candidate);
        while let Some(open) = walk.pending.pop() {
            let node = &obstacle.nodes[open as usize];
            let mut mask = bounds::children_near(simd, node, b, margin);
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let child = node.child[lane];
                if child & LEAF == 0 && (to_leaves || child_extent(node, lane) > extent) {
                    walk.pending.push(child);
                } else {
                    walk.candidates.push(child);
                }
            }
        }
    }
}

#[inline(always)]
fn child_extent(node: &Node, lane: usize) -> f32 {
    (0..3).map(|k| (node.max[k][lane] - node.min[k][lane]) * (node.max[k][lane] - node.min[k][lane])).sum()
}

/// Keeps the candidates that may come within the margin of a leaf of the body.
#[inline(always)]
fn meet_leaf<S: Simd>(simd: S, pair: Pair<'_>, walk: &mut Walk, index: u32, begin: usize, margins: Margins) {
    let leaf = &pair.body.leaves[index as usize];
    let corners = Corners::moved(simd, &pair.body.blocks[index as usize], pair.motion);
    let own = corners.bounds();
    let (grown, touching) = (own.grown(margins.near), own.grown(margins.touching));
    let slab = Slab::of(leaf, pair.motion);
    let first = [walk.near.body.near.len(), walk.touching.body.near.len()];
    for i in begin..walk.candidates.len() {
        let candidate = walk.candidates[i] & !LEAF;
        let other = &pair.obstacle.leaves[candidate as usize];
        if !grown.overlaps(&other.min, &other.max) || slab.misses(&other.min, &other.max, margins.near) {
            continue;
        }
        let apart = Slab::of_own(other).apart(corners.heights(other.normal));
        if apart > margins.near {
            continue;
        }
        walk.near.body.near.push(candidate);
        if apart <= margins.touching
            && touching.overlaps(&other.min, &other.max)
            && !slab.misses(&other.min, &other.max, margins.touching)
        {
            walk.touching.body.near.push(candidate);
        }
    }
    walk.near.end(index, first[0]);
    walk.touching.end(index, first[1]);
}

/// Memory for listing pairs by leaf of the obstacle; all zero between two uses, so that only what is near costs time.
#[derive(Clone, Debug, Default)]
struct Inversion {
    /// By leaf: how often it occurs, then where its next pair goes.
    counts: Vec<u32>,
    /// One bit a leaf: whether it occurs.
    occurs: Vec<u64>,
}

impl Inversion {
    /// The same pairs by leaf of the obstacle, in the order of its leaves.
    #[inline(always)]
    fn invert(&mut self, pairs: &mut Pairs, leaves: usize) {
        let Pairs { body, obstacle } = pairs;
        self.counts.resize(leaves, 0);
        self.occurs.resize(leaves.div_ceil(64), 0);
        for &other in &body.near {
            self.counts[other as usize] += 1;
            self.occurs[other as usize / 64] |= 1 << (other % 64);
        }
        obstacle.of.clear();
        let mut begin = 0;
        for (word, occurs) in self.occurs.iter_mut().enumerate() {
            let mut bits = std::mem::take(occurs);
            while bits != 0 {
                let leaf = 64 * word as u32 + bits.trailing_zeros();
                bits &= bits - 1;
                let end = begin + std::mem::replace(&mut self.counts[leaf as usize], begin);
                obstacle.of.push(Neighbourhood { leaf, begin, end });
                begin = end;
            }
        }
        obstacle.near.clear();
        obstacle.near.resize(body.near.len(), 0);
        for &Neighbourhood { leaf, begin, end } in &body.of {
            for &other in &body.near[begin as usize..end as usize] {
                let place = &mut self.counts[other as usize];
                obstacle.near[*place as usize] = leaf;
                *place += 1;
            }
        }
        for of in &obstacle.of {
            self.counts[of.leaf as usize] = 0;
        }
    }
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
    /// order, or do not hold the pairs of this walk and no others.
    #[test]
    fn lists_hold_every_close_pair_from_both_sides() {
        let mut seed = 5u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let surfaces = [scattered(&mut number, 200, 1.0), scattered(&mut number, 300, 1.5)];
        let [body, obstacle] = &surfaces;
        let mut memory = Walk::default();
        let (mut found, mut all) = (0, 0);
        for round in 0..20 {
            let pose = Isometry3::new(
                Vector3::from([0; 3].map(|_| 2.0 * number())),
                Vector3::from([0; 3].map(|_| 3.0 * number())),
            );
            let [motion, inverse] = [pose, pose.inverse()].map(|pose| Rigid::from_isometry(&pose));
            let (tolerance, ahead) = (0.05, 0.05 * f64::from(round % 3));
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
            }
            all += body.leaves.len() * obstacle.leaves.len();
        }
        assert!(found > 500 && found < all / 10, "{found} of {all}");
    }
}
