//! The foot of a vertex on the other surface, and what is remembered of it from one query to the next.
//!
//! A search through the tree notes the few closest leaves, each with its distance, and a bound for all the others. No distance
//! changes by more than the surfaces have moved, so for many steps only one or two of these leaves need be looked at. They
//! are refused in single precision and decided in double, so the foot does not depend on what was remembered.

use super::side::Search;
use crate::clod::nearest::{NOWHERE, Nearest, box_distances, misses_slab};
use crate::query::feature::{self, Foot};
use crate::query::kernel::{at_most, least, point_triangles};
use crate::surface::{EMPTY, ERROR, LANES, LEAF};
use crate::vector::{Vec3, norm, sub};

/// Leaves that are remembered.
const KEPT: usize = 6;
/// Triangles that are held for a sample.
pub(super) const HELD: usize = 16;
/// Covers the rounding of squares in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;

/// What is known of a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// The closest leaves of the other surface when it was last searched for.
    leaves: [u32; KEPT],
    /// Lower bounds of their distances at the search.
    lower: [f32; KEPT],
    /// Lower bound of the distances of all other leaves at the search.
    rest: f32,
    /// The triangle that the last foot was on.
    pub triangle: u32,
    /// Whether `distance` is exact and not only a lower bound.
    pub exact: bool,
    /// Where it was at the search.
    searched: Vec3,
    /// Its distance to the other surface, or a lower bound ...
    pub distance: f64,
    /// ... when the surfaces had moved this far in all.
    pub at: f64,
}

/// The triangles closest to a vertex, and a lower bound of the distances of all others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Closest {
    pub triangles: [u32; HELD],
    pub rest: f64,
}

/// What the last look at the remembered leaves found, by leaf.
#[derive(Clone, Debug, Default)]
pub(super) struct Looks {
    looked: [bool; KEPT],
    /// Squared distances of the triangles, and the greatest error of the distances.
    squared: [[f32; LANES]; KEPT],
    error: [f32; KEPT],
}

impl Looks {
    /// Looks at a leaf, unless that has been done.
    #[inline(always)]
    fn at(&mut self, k: usize, p: Vec3, search: &Search<'_>, leaf: u32) {
        if !self.looked[k] {
            (self.looked[k], self.error[k]) = (true, to_leaf(p, search, leaf, &mut self.squared[k]).1);
        }
    }
}

impl Known {
    /// Nothing.
    pub(super) const UNKNOWN: Self = Self {
        leaves: [NOWHERE; KEPT],
        lower: [f32::INFINITY; KEPT],
        rest: 0.0,
        triangle: NOWHERE,
        exact: false,
        searched: [f64::NAN; 3],
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
        looks: &mut Looks,
        searches: &mut usize,
    ) -> Option<Foot> {
        let mut found = self.settle(p, search, limit, looks);
        if found.is_none() {
            self.search(p, search, limit, band, slack, &mut nearest.stack);
            self.searched = p;
            *searches += 1;
            found = self.settle(p, search, limit, looks);
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

    /// The triangles that are closest to a vertex at `p`, from the leaves that are within `reach`; `looks` are those of the last look, which was from there.
    #[inline(always)]
    pub(super) fn closest(&self, p: Vec3, search: &Search<'_>, reach: f64, looks: &mut Looks) -> Closest {
        let other = search.other;
        let moved = norm(sub(p, self.searched));
        let mut result = Closest { triangles: [NOWHERE; HELD], rest: f64::from(self.rest) - moved };
        let (mut all, mut count) = ([(f32::INFINITY, NOWHERE); KEPT * LANES], 0);
        for k in (0..KEPT).filter(|&k| self.leaves[k] != NOWHERE) {
            let bound = f64::from(self.lower[k]) - moved;
            if bound > reach {
                result.rest = result.rest.min(bound);
                continue;
            }
            looks.at(k, p, search, self.leaves[k]);
            let index = self.leaves[k] as usize;
            let (leaf, block) = (&other.leaves[index], &other.blocks[index]);
            for lane in 0..usize::from(leaf.triangles) {
                let far = looks.squared[k][lane].sqrt();
                all[count] = (far - (block.error + ERROR * far), leaf.triangle(lane));
                count += 1;
            }
        }
        let all = &mut all[..count];
        if count > HELD {
            let by_distance = |a: &(f32, u32), b: &(f32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            let (_, dropped, _) = all.select_nth_unstable_by(HELD, by_distance);
            result.rest = result.rest.min(f64::from(dropped.0));
        }
        for (triangle, close) in result.triangles.iter_mut().zip(all) {
            *triangle = close.1;
        }
        result
    }

    /// Whether some triangle is surely within a distance, as far as that shows without a search.
    #[inline(always)]
    pub(super) fn is_within(&self, p: Vec3, search: &Search<'_>, limit: f64) -> bool {
        let mut squared = [0.0; LANES];
        self.leaves[0] != NOWHERE && {
            let (near, wrong) = to_leaf(p, search, self.leaves[0], &mut squared);
            f64::from(near + wrong) <= limit
        }
    }

    /// The closest foot and its distance, from the leaves that are remembered; none without a foot where all that is known is
    /// that the distance is at least so much, which is beyond the limit. None when they do not tell.
    #[inline(always)]
    fn settle(
        &mut self,
        p: Vec3,
        search: &Search<'_>,
        limit: f64,
        Looks { looked, squared, error }: &mut Looks,
    ) -> Option<(Option<Foot>, f64)> {
        let other = search.other;
        *looked = [false; KEPT];
        // Not a number before the first search.
        let moved = norm(sub(p, self.searched));
        let rest = f64::from(self.rest) - moved;
        if !(rest > 0.0) {
            return None;
        }
        let (mut within, mut lower) = (f32::INFINITY, rest);
        for k in 0..KEPT {
            let bound = f64::from(self.lower[k]) - moved;
            if self.leaves[k] == NOWHERE || bound > f64::from(within) {
                lower = lower.min(bound);
                continue;
            }
            let (near, wrong) = to_leaf(p, search, self.leaves[k], &mut squared[k]);
            (looked[k], error[k]) = (true, wrong);
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
        self.triangle = best.map_or(NOWHERE, |b: Best| b.triangle);
        best.map(|b: Best| (Some(b.foot), b.distance()))
    }

    /// Searches the tree for the closest leaves.
    #[inline(always)]
    fn search(
        &mut self,
        p: Vec3,
        search: &Search<'_>,
        limit: f64,
        band: f64,
        slack: f32,
        stack: &mut Vec<(f32, u32)>,
    ) {
        let other = search.other;
        let seeds = self.leaves;
        self.leaves = [NOWHERE; KEPT];
        self.lower = [f32::INFINITY; KEPT];
        let mut squared = [0.0; LANES];
        let band = band as f32;
        // What is farther than this need not be known.
        let mut cut = limit as f32 + band;
        self.rest = f32::INFINITY;
        for leaf in seeds.into_iter().filter(|&l| l != NOWHERE) {
            let (near, wrong) = to_leaf(p, search, leaf, &mut squared);
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
                let (near, wrong) = to_leaf(p, search, leaf, &mut squared);
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
fn to_leaf(p: Vec3, search: &Search<'_>, leaf: u32, squared: &mut [f32; LANES]) -> (f32, f32) {
    let block = &search.other.blocks[leaf as usize];
    let local = [0, 1, 2].map(|k| (p[k] - f64::from(block.origin[k])) as f32);
    *squared = point_triangles(search.level, local, block);
    let near = least(squared).sqrt();
    (near, block.error + ERROR * near)
}

#[cfg(test)]
mod tests;
