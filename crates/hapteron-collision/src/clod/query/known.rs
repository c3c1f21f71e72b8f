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
/// Covers the rounding of squares in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;

/// What is known of a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// The closest leaves of the other surface when it was last searched for ...
    leaves: [u32; KEPT],
    /// ... lower bounds of their distances ...
    lower: [f32; KEPT],
    /// ... and of the distances of all other leaves ...
    rest: f32,
    /// Whether `distance` is exact and not only a lower bound.
    pub exact: bool,
    /// ... when the surfaces had moved this far in all.
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
        let mut found = self.settle(p, search.other, moved, limit);
        if found.is_none() {
            self.search(p, search.other, limit, band, slack, &mut nearest.stack);
            self.searched = search.travelled;
            found = self.settle(p, search.other, 0.0, limit);
        }
        // More leaves are equally far than are remembered.
        let (foot, distance) = found.unwrap_or_else(|| {
            let found = nearest.search(search.other, p, self.leaves[0], limit, slack);
            let foot = found.then(|| feature::foot(p, nearest.triangle, search.other));
            (foot, foot.map_or(limit, |f| f.signed_distance.abs()))
        });
        self.at = search.travelled;
        self.distance = distance;
        self.exact = foot.is_some();
        foot.filter(|_| distance <= limit)
    }

    /// The closest foot and its distance, from the leaves that are remembered; none without a foot where all that is known is
    /// that the distance is at least so much, which is beyond the limit. None when they do not tell.
    #[inline(always)]
    fn settle(&self, p: Vec3, other: &Surface, moved: f64, limit: f64) -> Option<(Option<Foot>, f64)> {
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
            lower = lower.min(f64::from(near - wrong));
            within = if near + wrong < within { near + wrong } else { within };
        }
        if lower > limit {
            return Some((None, lower));
        }
        if !(rest > f64::from(within)) {
            return None;
        }
        let mut best: Option<(u32, Foot)> = None;
        for k in 0..KEPT {
            let reach = within + error[k];
            let leaf = &other.leaves[if looked[k] { self.leaves[k] as usize } else { 0 }];
            let mut mask = at_most(&squared[k], reach * reach * ROUNDING) & ((1 << leaf.triangles) - 1);
            mask = if looked[k] { mask } else { 0 };
            while mask != 0 {
                let triangle = leaf.first_triangle + mask.trailing_zeros();
                mask &= mask - 1;
                let foot = feature::foot(p, triangle, other);
                let distance = foot.signed_distance.abs();
                let closer = best.is_none_or(|(held_triangle, held)| {
                    let held = held.signed_distance.abs();
                    distance < held || (distance == held && triangle < held_triangle)
                });
                if closer {
                    best = Some((triangle, foot));
                }
            }
        }
        best.map(|(_, foot)| (Some(foot), foot.signed_distance.abs()))
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
        let (mut leaf, mut lower) = (leaf, lower);
        for k in 0..KEPT {
            if lower < self.lower[k] {
                core::mem::swap(&mut leaf, &mut self.leaves[k]);
                core::mem::swap(&mut lower, &mut self.lower[k]);
            }
        }
        self.rest = self.rest.min(lower);
    }
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
mod tests {
    use super::*;
    use crate::vector::{Rigid, norm, sub};

    /// A wavy sheet of 2 n^2 triangles, a metre wide.
    fn sheet(n: u32) -> Surface {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        let at = |i: u32, j: u32| i * (n + 1) + j;
        for i in 0..=n {
            for j in 0..=n {
                let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                vertices.push([x, y, 0.05 * (9.0 * x).sin() * (7.0 * y).cos()]);
                if i > 0 && j > 0 {
                    triangles.push([at(i - 1, j - 1), at(i, j - 1), at(i, j)]);
                    triangles.push([at(i - 1, j - 1), at(i, j), at(i - 1, j)]);
                }
            }
        }
        Surface::of_triangles(&vertices, &triangles)
    }

    /// Would catch a foot that is not the closest because of what was remembered, along slow and fast motions, with feet on
    /// faces, edges and vertices (of six triangles), near and out of reach: every triangle is looked at for comparison.
    #[test]
    fn feet_are_the_closest_along_motions() {
        let surface = sheet(24);
        let still =
            Rigid { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };
        let (limit, band) = (0.06, 0.03);
        let (mut near, mut far) = (0, 0);
        for (round, step) in [0.0002, 0.001, 0.006, 0.05].into_iter().enumerate() {
            let (mut known, mut nearest) = (Known::UNKNOWN, Nearest::default());
            let (mut last, mut travelled) = ([0.0; 3], 0.0);
            for i in 0..400 {
                let t = step * f64::from(i);
                // Over a vertex of the sheet at first.
                let p = [
                    0.25 + 0.4 * (t * (1.0 + round as f64)).sin(),
                    0.5 + 0.3 * t.cos() - 0.3,
                    0.08 * (3.0 * t).cos(),
                ];
                travelled += if i > 0 { norm(sub(p, last)) } else { 0.0 };
                last = p;
                let search = Search {
                    own: &surface,
                    other: &surface,
                    motion: &still,
                    last: &still,
                    tolerance: limit,
                    travelled,
                };
                let found = known.look(p, &search, limit, band, 2e-6, &mut nearest);
                let feet = (0..surface.triangles.len() as u32).map(|t| feature::foot(p, t, &surface));
                let least = feet.map(|f| f.signed_distance.abs()).fold(f64::INFINITY, f64::min);
                match found {
                    Some(foot) => {
                        near += 1;
                        assert!((foot.signed_distance.abs() - least).abs() < 1e-15, "{foot:?} {least}");
                        assert!((known.distance - least).abs() < 1e-15 && known.exact);
                    }
                    None => {
                        far += 1;
                        assert!(least > limit && known.distance <= least, "{least} {}", known.distance);
                    }
                }
            }
        }
        assert!(near > 400 && far > 100, "{near} {far}");
    }
}
