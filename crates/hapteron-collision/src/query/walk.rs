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
    pending: Vec<u32>,
    counts: Vec<u32>,
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
        for lane in 0..LANES {
            let child = node.child[lane];
            if child == EMPTY {
                continue;
            }
            let begin = walk.candidates.len() as u32;
            let bounds = children.of(lane);
            refine(simd, pair.obstacle, walk, frame, &bounds, margins.near, child & LEAF != 0);
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
    let Walk { counts, near, touching, .. } = walk;
    for pairs in [near, touching] {
        invert(counts, pairs, pair.obstacle.leaves.len());
    }
}

/// Appends to the candidates those of the frame that may be within the margin of `b`, opened down to about its size or, for a leaf, to leaves.
#[inline(always)]
fn refine<S: Simd>(
    simd: S,
    obstacle: &Surface,
    walk: &mut Walk,
    frame: Frame,
    b: &Bounds,
    margin: f32,
    to_leaves: bool,
) {
    let extent = b.extent(margin);
    for i in frame.begin..frame.end {
        let candidate = walk.candidates[i as usize];
        if candidate & LEAF != 0 {
            let leaf = &obstacle.leaves[(candidate & !LEAF) as usize];
            if !b.misses(leaf, margin) {
                walk.candidates.push(candidate);
            }
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

/// The same pairs by leaf of the obstacle, in the order of its leaves.
#[inline(always)]
fn invert(counts: &mut Vec<u32>, pairs: &mut Pairs, leaves: usize) {
    let Pairs { body, obstacle } = pairs;
    counts.clear();
    counts.resize(leaves + 1, 0);
    for &other in &body.near {
        counts[other as usize + 1] += 1;
    }
    obstacle.of.clear();
    for leaf in 0..leaves {
        let (begin, count) = (counts[leaf], counts[leaf + 1]);
        counts[leaf + 1] += begin;
        if count > 0 {
            obstacle.of.push(Neighbourhood { leaf: leaf as u32, begin, end: begin + count });
        }
    }
    obstacle.near.clear();
    obstacle.near.resize(body.near.len(), 0);
    for &Neighbourhood { leaf, begin, end } in &body.of {
        for &other in &body.near[begin as usize..end as usize] {
            let place = &mut counts[other as usize];
            obstacle.near[*place as usize] = leaf;
            *place += 1;
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
