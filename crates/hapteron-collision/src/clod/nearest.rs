//! The closest triangle of a surface to a point.

use crate::query::kernel::{at_most, least, point_triangles};
use crate::surface::{EMPTY, ERROR, LANES, LEAF, Node, Surface};
use crate::vector::{Vec3, add, dot, norm, scale, sub};
use fearless_simd::Level;

/// Covers the rounding of squares in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;

/// No leaf, no triangle.
pub(crate) const NOWHERE: u32 = u32::MAX;

/// What a search found, and its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nearest {
    pub squared: f64,
    pub triangle: u32,
    pub leaf: u32,
    pub stack: Vec<(f32, u32)>,
}

impl Nearest {
    /// Finds the closest triangle within `limit` of `p`; `guess` is a leaf to look in first. False when there is none.
    #[inline(always)]
    pub(crate) fn search(&mut self, surface: &Surface, p: Vec3, guess: u32, limit: f64, slack: f32) -> bool {
        self.squared = limit * limit;
        self.triangle = NOWHERE;
        self.leaf = NOWHERE;
        let level = Level::new();
        if guess != NOWHERE {
            self.look(level, surface, guess, p);
        }
        let p32 = p.map(|c| c as f32);
        self.stack.clear();
        if !surface.nodes.is_empty() {
            self.stack.push((0.0, 0));
        }
        while let Some((lower, index)) = self.stack.pop() {
            if f64::from(lower) > self.squared * (1.0 + 1e-6) {
                continue;
            }
            if index & LEAF != 0 {
                let leaf = index & !LEAF;
                if leaf != guess
                    && !misses_slab(surface, leaf, p, slack, self.squared.sqrt() as f32 * (1.0 + 1e-6))
                {
                    self.look(level, surface, leaf, p);
                }
                continue;
            }
            let node = &surface.nodes[index as usize];
            let lower = box_distances(node, p32, slack);
            let limit = self.squared as f32 * (1.0 + 1e-6);
            let first = self.stack.len();
            for lane in 0..LANES {
                if lower[lane] <= limit && node.child[lane] != EMPTY {
                    self.stack.push((lower[lane], node.child[lane]));
                }
            }
            // Nearest on top; the order of the others matters less.
            let top = self.stack.len();
            if top > first + 1 {
                let mut nearest = first;
                for k in first + 1..top {
                    if self.stack[k].0 < self.stack[nearest].0 {
                        nearest = k;
                    }
                }
                self.stack.swap(nearest, top - 1);
            }
        }
        self.triangle != NOWHERE
    }

    /// Looks at those triangles of a leaf that may be closer, for all that single precision says; the first of equals counts.
    #[inline(always)]
    fn look(&mut self, level: Level, surface: &Surface, leaf: u32, p: Vec3) {
        let (own, block) = (&surface.leaves[leaf as usize], &surface.blocks[leaf as usize]);
        let local = [0, 1, 2].map(|k| (p[k] - f64::from(block.origin[k])) as f32);
        let squared = point_triangles(level, local, block);
        let nearest = least(&squared).sqrt() * (1.0 + ERROR) + block.error;
        let within = nearest.min((self.squared.sqrt() as f32).next_up());
        let reach = within * (1.0 + ERROR) + block.error;
        let mut mask = at_most(&squared, reach * reach * ROUNDING) & ((1 << own.triangles) - 1);
        while mask != 0 {
            let triangle = own.first_triangle + mask.trailing_zeros();
            mask &= mask - 1;
            let [a, b, c] =
                surface.triangles[triangle as usize].map(|v| sub(surface.vertices[v as usize], p));
            let squared = point_triangle(sub(b, a), sub(c, a), scale(a, -1.0));
            if squared < self.squared {
                (self.squared, self.triangle, self.leaf) = (squared, triangle, leaf);
            }
        }
    }
}

/// [`Nearest::search`] as a call of its own, in the widest vector instructions that there are.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
pub(crate) fn search(
    nearest: &mut Nearest,
    surface: &Surface,
    p: Vec3,
    guess: u32,
    limit: f64,
    slack: f32,
) -> bool {
    nearest.search(surface, p, guess, limit, slack)
}

/// Whether the slab around a leaf is farther away than a distance.
#[inline(always)]
pub(crate) fn misses_slab(surface: &Surface, leaf: u32, p: Vec3, slack: f32, than: f32) -> bool {
    let leaf = &surface.leaves[leaf as usize];
    let height = dot(leaf.normal.map(f64::from), p);
    let beyond = (f64::from(leaf.low) - height).max(height - f64::from(leaf.high)) - f64::from(slack);
    beyond > f64::from(than)
}

/// Squared distances of a point to the boxes of a node's children, from below.
#[inline(always)]
pub(crate) fn box_distances(node: &Node, p: [f32; 3], slack: f32) -> [f32; LANES] {
    let mut squared = [0.0; LANES];
    for l in 0..LANES {
        let mut sum = 0.0;
        for k in 0..3 {
            let (under, over) = (node.min[k][l] - p[k], p[k] - node.max[k][l]);
            let beyond = (if under > over { under } else { over }) - slack;
            let beyond = if beyond > 0.0 { beyond } else { 0.0 };
            sum += beyond * beyond;
        }
        squared[l] = sum;
    }
    squared
}

/// Squared distance of the point `ap` to the triangle 0, `ab`, `ac`.
#[inline(always)]
fn point_triangle(ab: Vec3, ac: Vec3, ap: Vec3) -> f64 {
    let e = from_triangle(ab, ac, ap);
    dot(e, e)
}

/// The way to the point `ap` from the closest point of the triangle 0, `ab`, `ac`: by region as in Ericson, Real-Time Collision Detection, 5.1.5,
/// with the choice of region as selections, so that several can be found side by side.
#[inline(always)]
pub(crate) fn from_triangle(ab: Vec3, ac: Vec3, ap: Vec3) -> Vec3 {
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    let (aa, bc, cc) = (dot(ab, ab), dot(ab, ac), dot(ac, ac));
    let (d3, d4, d5, d6) = (d1 - aa, d2 - bc, d1 - bc, d2 - cc);
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let (toward_c, toward_b) = (d4 - d3, d5 - d6);
    // Later selections take precedence: interior, then edges, then corners.
    let (mut v, mut w, mut whole) = (vb, vc, va + vb + vc);
    let mut choose = |when: bool, nv: f64, nw: f64, n: f64| {
        v = if when { nv } else { v };
        w = if when { nw } else { w };
        whole = if when { n } else { whole };
    };
    choose((va <= 0.0) & (toward_c >= 0.0) & (toward_b >= 0.0), toward_b, toward_c, toward_c + toward_b);
    choose((vb <= 0.0) & (d2 >= 0.0) & (d6 <= 0.0), 0.0, d2, cc);
    choose((d6 >= 0.0) & (d5 <= d6), 0.0, 1.0, 1.0);
    choose((vc <= 0.0) & (d1 >= 0.0) & (d3 <= 0.0), d1, 0.0, aa);
    choose((d3 >= 0.0) & (d4 <= d3), 1.0, 0.0, 1.0);
    choose((d1 <= 0.0) & (d2 <= 0.0), 0.0, 0.0, 1.0);
    // A triangle without area has no interior.
    let (v, w, whole) = if whole > 0.0 { (v, w, whole) } else { (0.0, 0.0, 1.0) };
    let inverse = 1.0 / whole;
    let (v, w) = (v * inverse, w * inverse);
    [ap[0] - v * ab[0] - w * ac[0], ap[1] - v * ab[1] - w * ac[1], ap[2] - v * ab[2] - w * ac[2]]
}

/// Distance of a point to a triangle.
pub(crate) fn distance_to_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> f64 {
    point_triangle(sub(b, a), sub(c, a), sub(p, a)).max(0.0).sqrt()
}

/// Covers the rounding of single-precision boxes for points within `reach` of the origin.
pub(crate) fn slack(reach: f64) -> f32 {
    1e-6 * reach as f32
}

/// Upper bound of the distance of `p` to the convex hull of `points`, by the Frank-Wolfe method with steps away from a
/// corner (Guelat and Marcotte 1986) on the hull's weights; what is below `tolerance` need not be exact.
pub(crate) fn distance_to_hull(p: Vec3, points: &[Vec3], tolerance: f64) -> f64 {
    const STEPS: usize = 400;
    let Some(start) =
        (0..points.len()).min_by(|&i, &j| norm(sub(points[i], p)).total_cmp(&norm(sub(points[j], p))))
    else {
        return f64::INFINITY;
    };
    let mut weights = vec![0.0; points.len()];
    weights[start] = 1.0;
    let mut x = points[start];
    for _ in 0..STEPS {
        let g = sub(x, p);
        let along = |i: usize| dot(g, points[i]);
        let mut toward = start;
        let mut away = start;
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..points.len() {
            let value = along(i);
            if value < least {
                (toward, least) = (i, value);
            }
            if weights[i] > 0.0 && value > most {
                (away, most) = (i, value);
            }
        }
        let gap = dot(g, x) - least;
        let size = norm(g);
        // What is left to gain is at most gap / size.
        if size <= tolerance || !(gap > tolerance * size) {
            break;
        }
        let toward_step = gap >= most - dot(g, x);
        let direction = if toward_step { sub(points[toward], x) } else { sub(x, points[away]) };
        let square = dot(direction, direction);
        if square == 0.0 {
            break;
        }
        let kept = weights[away];
        let limit = if toward_step {
            1.0
        } else if kept < 1.0 {
            kept / (1.0 - kept)
        } else {
            0.0
        };
        let t = (-dot(g, direction) / square).clamp(0.0, limit);
        if toward_step {
            weights.iter_mut().for_each(|w| *w *= 1.0 - t);
            weights[toward] += t;
        } else {
            weights.iter_mut().for_each(|w| *w *= 1.0 + t);
            weights[away] = if t == limit { 0.0 } else { weights[away] - t };
        }
        x = add(x, scale(direction, t));
    }
    norm(sub(x, p))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a wrong corner or edge region of the hull: distances to a cube are known.
    #[test]
    fn distance_to_a_cube() {
        let corners: Vec<Vec3> =
            (0..8).map(|i| [f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
        for (p, wanted) in [
            ([0.5, 0.5, 3.0], 2.0),
            ([2.0, 2.0, 0.5], 2.0f64.sqrt()),
            ([2.0, 2.0, 2.0], 3.0f64.sqrt()),
            ([0.3, 0.6, 0.2], 0.0),
            ([-1.0, 0.25, 0.75], 1.0),
        ] {
            let d = distance_to_hull(p, &corners, 1e-6);
            assert!((d - wanted).abs() < 1e-4 && d >= wanted - 1e-12, "{p:?}: {d} {wanted}");
        }
    }
}
