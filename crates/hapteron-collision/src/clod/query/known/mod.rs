//! The foot of a vertex on the other surface, and what is remembered of it from one query to the next.
//!
//! A search through the tree notes the few closest leaves, each with its distance, and a bound for all the others. No distance
//! changes by more than the surfaces have moved, so for many steps only one or two of these leaves need be looked at. They
//! are refused in single precision and decided in double, so the foot does not depend on what was remembered.

use super::side::Search;
use crate::clod::nearest::{NOWHERE, Nearest, box_distances, misses_slab};
use crate::query::feature::{self, Foot};
use crate::query::kernel::{at_most, least, point_triangles};
use crate::surface::{EMPTY, ERROR, LANES, LEAF, Surface};
use crate::vector::Vec3;

/// Leaves that are remembered.
const KEPT: usize = 6;
/// Triangles that are remembered.
const CLOSEST: usize = 3;
/// They are worth remembering when all others are farther than the closest by this factor.
const WORTH: f32 = 1.01;
/// Covers the rounding of squares in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;

/// What is known of a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// The closest leaves of the other surface when it was last searched for, the surfaces having moved `searched` in all.
    leaves: [u32; KEPT],
    /// Lower bounds of their distances when they were last looked at, plus what the surfaces had moved since the search.
    lower: [f32; KEPT],
    /// Lower bound of the distances of all other leaves at the search.
    rest: f32,
    /// The closest triangles of these leaves when the leaves were last looked at.
    triangles: [u32; CLOSEST],
    /// Lower bounds of their distances, and of those of all other triangles, each plus what the surfaces had moved since the search.
    apart: [f32; CLOSEST],
    others: f32,
    /// The triangle that the last foot was on.
    triangle: u32,
    /// Whether `distance` is exact and not only a lower bound.
    pub exact: bool,
    pub searched: f64,
    /// Its distance to the other surface, or a lower bound ...
    pub distance: f64,
    /// ... when the surfaces had moved this far in all.
    pub at: f64,
}

/// What is known of the vertices of a surface, in pages: only those near the other surface are ever looked at, and near vertices have
/// close numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    /// By page of vertices: where it is, plus one; zero as long as none of its vertices was looked at.
    pages: Vec<u32>,
    known: Vec<Known>,
}

/// Vertices in a page.
const PAGE: usize = 32;

impl Memory {
    /// Forgets everything and makes room for a surface.
    pub(super) fn new(surface: &Surface) -> Self {
        Self { pages: vec![0; surface.vertices.len().div_ceil(PAGE)], known: Vec::new() }
    }

    /// Where a vertex has its place.
    #[inline(always)]
    pub(super) fn place(&mut self, vertex: u32) -> usize {
        let page = vertex as usize / PAGE;
        if self.pages[page] == 0 {
            self.known.resize(self.known.len() + PAGE, Known::UNKNOWN);
            self.pages[page] = (self.known.len() / PAGE) as u32;
        }
        (self.pages[page] as usize - 1) * PAGE + vertex as usize % PAGE
    }

    #[inline(always)]
    pub(super) fn at(&mut self, place: usize) -> &mut Known {
        &mut self.known[place]
    }
}

impl Known {
    /// Nothing.
    pub(super) const UNKNOWN: Self = Self {
        leaves: [NOWHERE; KEPT],
        lower: [f32::INFINITY; KEPT],
        rest: 0.0,
        triangles: [NOWHERE; CLOSEST],
        apart: [f32::INFINITY; CLOSEST],
        others: f32::NEG_INFINITY,
        triangle: NOWHERE,
        exact: false,
        searched: f64::NEG_INFINITY,
        distance: 0.0,
        at: f64::NEG_INFINITY,
    };

    /// The foot of a point on the other surface, when it is within `limit`. Where it must be searched for, all within `band` more than
    /// needed is found too, so that it need not be sought again at every step.
    #[inline(always)]
    pub(super) fn look(
        &mut self,
        p: Vec3,
        search: &Search<'_>,
        limit: f64,
        band: f64,
        slack: f32,
        nearest: &mut Nearest,
    ) -> Option<Foot> {
        let moved = search.travelled - self.searched;
        let mut found = self.recall(p, search.other, moved);
        if found.is_none() {
            found = self.settle(p, search.other, moved, limit);
        }
        if found.is_none() {
            self.search(p, search.other, limit, band, slack, &mut nearest.stack);
            self.searched = search.travelled;
            found = self.settle(p, search.other, 0.0, limit);
        }
        // More leaves are equally far than are remembered.
        let (foot, distance) = found.unwrap_or_else(|| {
            let found = nearest.search(search.other, p, self.leaves[0], limit, slack);
            let foot = found.then(|| feature::foot(p, nearest.triangle, search.other));
            self.triangle = NOWHERE;
            (foot, foot.map_or(limit, |f| f.signed_distance.abs()))
        });
        self.at = search.travelled;
        self.distance = distance;
        self.exact = foot.is_some();
        foot.filter(|_| distance <= limit)
    }

    /// The triangle that the last foot was on, and a lower bound of the distances of all others, plus what the surfaces had moved by then in
    /// all. None when that is not known.
    #[inline(always)]
    pub(super) fn held(&self) -> Option<(u32, f64)> {
        let others = self.triangles.iter().zip(self.apart).filter(|(t, _)| **t != self.triangle);
        let apart = others.fold(self.others, |least, (_, apart)| least.min(apart));
        (self.triangle != NOWHERE).then(|| (self.triangle, f64::from(apart) + self.searched))
    }

    /// The closest foot and its distance, from the triangles that are remembered. None when they do not tell.
    #[inline(always)]
    fn recall(&mut self, p: Vec3, other: &Surface, moved: f64) -> Option<(Option<Foot>, f64)> {
        if self.others == f32::NEG_INFINITY {
            return None;
        }
        let mut best = None;
        for k in 0..CLOSEST {
            let (triangle, bound) = (self.triangles[k], f64::from(self.apart[k]) - moved);
            if triangle == NOWHERE || best.is_some_and(|b: Best| bound > b.distance()) {
                continue;
            }
            let foot = feature::foot(p, triangle, other);
            self.apart[k] = ((foot.signed_distance.abs() + moved) as f32).next_down();
            Best::take(&mut best, triangle, foot);
        }
        let best = best.filter(|b| b.distance() < f64::from(self.others) - moved)?;
        self.triangle = best.triangle;
        Some((Some(best.foot), best.distance()))
    }

    /// Remembers the closest of the triangles that were looked at, leaf by leaf.
    #[inline(always)]
    fn remember(
        &mut self,
        other: &Surface,
        moved: f64,
        looked: &[bool; KEPT],
        squared: &[[f32; LANES]; KEPT],
    ) {
        self.triangles = [NOWHERE; CLOSEST];
        self.apart = [f32::INFINITY; CLOSEST];
        self.others = self.rest;
        for k in (0..KEPT).filter(|&k| self.leaves[k] != NOWHERE) {
            if !looked[k] {
                self.others = self.others.min(self.lower[k]);
                continue;
            }
            let (leaf, block) =
                (&other.leaves[self.leaves[k] as usize], &other.blocks[self.leaves[k] as usize]);
            for lane in 0..usize::from(leaf.triangles) {
                let far = squared[k][lane].sqrt();
                let apart = ((f64::from(far - (block.error + ERROR * far)) + moved) as f32).next_down();
                let dropped = insert((leaf.triangle(lane), apart), &mut self.triangles, &mut self.apart);
                self.others = self.others.min(dropped);
            }
        }
        // Around a vertex more are equally far than are remembered.
        if self.others < self.apart[0] * WORTH {
            self.others = f32::NEG_INFINITY;
        }
    }

    /// The closest foot and its distance, from the leaves that are remembered; none without a foot where all that is known is
    /// that the distance is at least so much, which is beyond the limit. None when they do not tell.
    #[inline(always)]
    fn settle(&mut self, p: Vec3, other: &Surface, moved: f64, limit: f64) -> Option<(Option<Foot>, f64)> {
        let rest = f64::from(self.rest) - moved;
        if !(rest > 0.0) {
            return None;
        }
        let mut squared = [[0.0; LANES]; KEPT];
        let mut error = [0.0; KEPT];
        let mut looked = [false; KEPT];
        let (mut within, mut lower) = (f32::INFINITY, rest);
        for k in 0..KEPT {
            let bound = f64::from(self.lower[k]) - moved;
            if self.leaves[k] == NOWHERE || bound > f64::from(within) {
                lower = lower.min(bound);
                continue;
            }
            let (near, wrong) = to_leaf(p, other, self.leaves[k], &mut squared[k]);
            (looked[k], error[k]) = (true, wrong);
            self.lower[k] = ((f64::from(near - wrong) + moved) as f32).next_down();
            lower = lower.min(f64::from(near - wrong));
            within = if near + wrong < within { near + wrong } else { within };
        }
        if lower > limit {
            return Some((None, lower));
        }
        if !(rest > f64::from(within)) {
            return None;
        }
        let mut best = None;
        for k in 0..KEPT {
            let reach = within + error[k];
            let leaf = &other.leaves[if looked[k] { self.leaves[k] as usize } else { 0 }];
            let mut mask = at_most(&squared[k], reach * reach * ROUNDING) & ((1 << leaf.triangles) - 1);
            mask = if looked[k] { mask } else { 0 };
            while mask != 0 {
                let triangle = leaf.first_triangle + mask.trailing_zeros();
                mask &= mask - 1;
                Best::take(&mut best, triangle, feature::foot(p, triangle, other));
            }
        }
        self.remember(other, moved, &looked, &squared);
        self.triangle = best.map_or(NOWHERE, |b: Best| b.triangle);
        best.map(|b: Best| (Some(b.foot), b.distance()))
    }

    /// Searches the tree for the closest leaves.
    #[inline(always)]
    fn search(
        &mut self,
        p: Vec3,
        other: &Surface,
        limit: f64,
        band: f64,
        slack: f32,
        stack: &mut Vec<(f32, u32)>,
    ) {
        let seeds = self.leaves;
        self.others = f32::NEG_INFINITY;
        self.leaves = [NOWHERE; KEPT];
        self.lower = [f32::INFINITY; KEPT];
        let mut squared = [0.0; LANES];
        let band = band as f32;
        // What is farther than this need not be known.
        let mut cut = limit as f32 + band;
        self.rest = f32::INFINITY;
        for leaf in seeds.into_iter().filter(|&l| l != NOWHERE) {
            let (near, wrong) = to_leaf(p, other, leaf, &mut squared);
            self.keep(leaf, near - wrong);
            cut = cut.min(near + wrong + band);
        }
        let p32 = p.map(|c| c as f32);
        stack.clear();
        if !other.nodes.is_empty() {
            stack.push((0.0, 0));
        }
        while let Some((bound, index)) = stack.pop() {
            let farthest = cut.min(self.lower[KEPT - 1]);
            if bound > farthest {
                self.rest = self.rest.min(bound);
                continue;
            }
            if index & LEAF != 0 {
                let leaf = index & !LEAF;
                if seeds.contains(&leaf) {
                    continue;
                }
                if misses_slab(other, leaf, p, slack, farthest) {
                    self.rest = self.rest.min(farthest);
                    continue;
                }
                let (near, wrong) = to_leaf(p, other, leaf, &mut squared);
                self.keep(leaf, near - wrong);
                cut = cut.min(near + wrong + band);
                continue;
            }
            let node = &other.nodes[index as usize];
            let bounds = box_distances(node, p32, slack).map(|b| b.sqrt() / ROUNDING);
            push_near(node.child, bounds, stack);
        }
        self.rest = self.rest.min(cut);
    }

    /// Remembers a leaf in the order of distances; the farthest one too many goes with the others.
    #[inline(always)]
    fn keep(&mut self, leaf: u32, lower: f32) {
        let dropped = insert((leaf, lower), &mut self.leaves, &mut self.lower);
        self.rest = self.rest.min(dropped);
    }
}

/// The closest triangle so far with the foot on it.
#[derive(Clone, Copy)]
struct Best {
    triangle: u32,
    foot: Foot,
}

impl Best {
    #[inline(always)]
    fn distance(&self) -> f64 {
        self.foot.signed_distance.abs()
    }

    /// Of equals the first.
    #[inline(always)]
    fn take(best: &mut Option<Self>, triangle: u32, foot: Foot) {
        let new = Self { triangle, foot };
        let closer = best.is_none_or(|held| {
            new.distance() < held.distance()
                || (new.distance() == held.distance() && triangle < held.triangle)
        });
        if closer {
            *best = Some(new);
        }
    }
}

/// Puts something into its place in an order of distances. Gives the distance of what is one too many.
#[inline(always)]
fn insert<const N: usize>(
    (mut what, mut lower): (u32, f32),
    kept: &mut [u32; N],
    lowers: &mut [f32; N],
) -> f32 {
    for (held, bound) in kept.iter_mut().zip(lowers) {
        if lower < *bound {
            core::mem::swap(&mut what, held);
            core::mem::swap(&mut lower, bound);
        }
    }
    lower
}

/// Puts the children of a node on the stack, the nearest on top; the order of the others matters less.
#[inline(always)]
fn push_near(children: [u32; LANES], bounds: [f32; LANES], stack: &mut Vec<(f32, u32)>) {
    let first = stack.len();
    for (bound, child) in bounds.into_iter().zip(children).filter(|(_, child)| *child != EMPTY) {
        stack.push((bound, child));
    }
    let mut nearest = first;
    for k in first..stack.len() {
        if stack[k].0 < stack[nearest].0 {
            nearest = k;
        }
    }
    let top = stack.len();
    if top > first {
        stack.swap(nearest, top - 1);
    }
}

/// Distance of a point to a leaf and its greatest error; squared distances to its triangles.
#[inline(always)]
fn to_leaf(p: Vec3, surface: &Surface, leaf: u32, squared: &mut [f32; LANES]) -> (f32, f32) {
    let block = &surface.blocks[leaf as usize];
    let local = [0, 1, 2].map(|k| (p[k] - f64::from(block.origin[k])) as f32);
    *squared = point_triangles(local, block);
    let near = least(squared).sqrt();
    (near, block.error + ERROR * near)
}

#[cfg(test)]
mod tests;
