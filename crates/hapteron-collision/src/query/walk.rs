//! The walk through both trees: which leaves of the two surfaces come close to each other.

use super::Pair;
use super::kernel::{self, Box32};
use crate::surface::{EMPTY, LANES, LEAF, Leaf, Node, Surface};
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

/// Memory of the walk, and its result.
#[derive(Clone, Debug, Default)]
pub(super) struct Walk {
    stack: Vec<Frame>,
    candidates: Vec<u32>,
    pending: Vec<u32>,
    counts: Vec<u32>,
    pub body: Neighbours,
    pub obstacle: Neighbours,
}

/// A node of the body's tree with a range of `candidates` that it must be compared with.
#[derive(Clone, Copy, Debug)]
struct Frame {
    node: u32,
    begin: u32,
    end: u32,
}

/// Finds all pairs of leaves that may be closer than `reach`.
#[inline(always)]
pub(super) fn walk<S: Simd>(simd: S, pair: Pair<'_>, reach: f64, walk: &mut Walk) {
    walk.body.of.clear();
    walk.body.near.clear();
    walk.candidates.clear();
    walk.stack.clear();
    if pair.body.nodes.is_empty() || pair.obstacle.nodes.is_empty() {
        return;
    }
    let margin = (reach + pair.slack()) as f32;
    walk.candidates.push(0);
    walk.stack.push(Frame { node: 0, begin: 0, end: 1 });
    while let Some(frame) = walk.stack.pop() {
        walk.candidates.truncate(frame.end as usize);
        let node = &pair.body.nodes[frame.node as usize];
        let boxes = kernel::moved_children(node, pair.motion, margin);
        for lane in 0..LANES {
            let child = node.child[lane];
            if child == EMPTY {
                continue;
            }
            let begin = walk.candidates.len() as u32;
            refine(simd, pair.obstacle, walk, frame, &boxes[lane], child & LEAF != 0);
            let end = walk.candidates.len() as u32;
            if begin == end {
                continue;
            }
            if child & LEAF == 0 {
                walk.stack.push(Frame { node: child, begin, end });
            } else {
                meet_leaf(simd, pair, walk, child & !LEAF, begin as usize, margin);
                walk.candidates.truncate(begin as usize);
            }
        }
    }
    invert(walk, pair.obstacle.leaves.len());
}

/// Appends to the candidates those of the frame that overlap `b`, opened down to about its size or, for a leaf, to leaves.
#[inline(always)]
fn refine<S: Simd>(simd: S, obstacle: &Surface, walk: &mut Walk, frame: Frame, b: &Box32, to_leaves: bool) {
    let extent = b.extent();
    for i in frame.begin..frame.end {
        let candidate = walk.candidates[i as usize];
        if candidate & LEAF != 0 {
            let leaf = &obstacle.leaves[(candidate & !LEAF) as usize];
            if b.overlaps(&leaf.min, &leaf.max) {
                walk.candidates.push(candidate);
            }
            continue;
        }
        // The node's own box was seen to overlap the parent of `b`; look at its children.
        walk.pending.push(candidate);
        while let Some(open) = walk.pending.pop() {
            let node = &obstacle.nodes[open as usize];
            let mut mask = kernel::overlapping_children(simd, node, b);
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
fn meet_leaf<S: Simd>(simd: S, pair: Pair<'_>, walk: &mut Walk, index: u32, begin: usize, margin: f32) {
    let leaf = &pair.body.leaves[index as usize];
    let grown = kernel::moved_block_box(simd, &pair.body.blocks[index as usize], pair.motion, margin);
    let slab = Slab::of(leaf, pair.motion);
    let first = walk.body.near.len() as u32;
    for i in begin..walk.candidates.len() {
        let candidate = walk.candidates[i] & !LEAF;
        let other = &pair.obstacle.leaves[candidate as usize];
        if grown.overlaps(&other.min, &other.max)
            && !slab.misses(&other.min, &other.max, margin)
            && !Slab::of_own(other).misses(&grown.min, &grown.max, 0.0)
        {
            walk.body.near.push(candidate);
        }
    }
    let end = walk.body.near.len() as u32;
    if first != end {
        walk.body.of.push(Neighbourhood { leaf: index, begin: first, end });
    }
}

/// The same pairs by leaf of the obstacle, in the order of its leaves.
#[inline(always)]
fn invert(walk: &mut Walk, leaves: usize) {
    let Walk { counts, body, obstacle, .. } = walk;
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

/// The space between two parallel planes.
struct Slab {
    normal: [f32; 3],
    low: f32,
    high: f32,
}

impl Slab {
    #[inline(always)]
    fn of_own(leaf: &Leaf) -> Self {
        Self { normal: leaf.normal, low: leaf.low, high: leaf.high }
    }

    #[inline(always)]
    fn of(leaf: &Leaf, motion: &Rigid) -> Self {
        let normal = motion.direction(leaf.normal.map(f64::from));
        let shift = crate::vector::dot(normal, motion.translation) as f32;
        Self { normal: normal.map(|c| c as f32), low: leaf.low + shift, high: leaf.high + shift }
    }

    /// True when the box is farther than `margin` from the slab.
    #[inline(always)]
    fn misses(&self, min: &[f32; 3], max: &[f32; 3], margin: f32) -> bool {
        let mut center = 0.0;
        let mut half = margin;
        for k in 0..3 {
            center += self.normal[k] * (0.5 * (min[k] + max[k]));
            half += self.normal[k].abs() * (0.5 * (max[k] - min[k]));
        }
        center - half > self.high || center + half < self.low
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
