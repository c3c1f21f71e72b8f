//! What a node knows of its patch and of the original surface that it stands for, measured.

use super::portions::in_portions;
use super::simplify::Level;
use super::{BuildError, Progress};
use crate::clod::nearest::{NOWHERE, Nearest, distance_to_hull, distance_to_triangle, search, slack};
use crate::surface::Surface;
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub, unit_or_zero};
use std::sync::atomic::{AtomicBool, Ordering};

/// A deviation is known to within this factor ...
const CLOSENESS: f64 = 1.05;
/// ... and this share of the surface's radius.
const FINEST: f64 = 1e-6;
/// A triangle is cut in four no more often than this.
const DEEPEST: u32 = 8;
/// Depth below the tangent plane down to which a surface counts as support, as a share of the object's radius.
const SUPPORT_DEPTH: f64 = 0.01;
/// Support areas are summed over no more faces than this.
const SUPPORT_FACES: usize = 256;

/// Upper bound, within [`CLOSENESS`], of the greatest distance of the original faces to the surface of their level, and of
/// the patch's faces to the original surface; of no meaning when it was stopped.
pub(super) fn deviation(
    surface: &Surface,
    originals: &[u32],
    level: &Level,
    level_surface: &Surface,
    patch: [u32; 2],
    stop: &AtomicBool,
) -> f64 {
    let mut search = Search { nearest: Nearest::default(), leaf: NOWHERE, most: 0.0, stack: Vec::new() };
    let tolerance = FINEST * surface.radius;
    for &t in originals {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        search.look(level_surface, corners(&surface.vertices, &surface.triangles[t as usize]), tolerance);
    }
    search.leaf = NOWHERE;
    for t in &level.faces[patch[0] as usize..patch[1] as usize] {
        search.look(surface, corners(&level.vertices, t), tolerance);
    }
    CLOSENESS * search.most + tolerance
}

fn corners(vertices: &[Vec3], t: &[u32; 3]) -> [Vec3; 3] {
    t.map(|v| vertices[v as usize])
}

/// Distances of triangles that follow each other closely.
struct Search {
    nearest: Nearest,
    leaf: u32,
    most: f64,
    stack: Vec<([Vec3; 3], u32)>,
}

impl Search {
    /// Raises `most` to the greatest distance of the triangle's points to the surface, unless it is nearly as much already.
    ///
    /// The distance to one triangle of the surface is convex, so over a triangle it is greatest at a corner, and nowhere
    /// less than the distance to the surface. Where that bound is not good enough the triangle is cut in four.
    fn look(&mut self, surface: &Surface, triangle: [Vec3; 3], tolerance: f64) {
        self.stack.push((triangle, 0));
        while let Some(([a, b, c], depth)) = self.stack.pop() {
            let center = scale(add(add(a, b), c), 1.0 / 3.0);
            let limit = 4.0 * surface.radius + norm(center);
            if !search(&mut self.nearest, surface, center, self.leaf, limit, slack(surface.radius)) {
                continue;
            }
            self.leaf = self.nearest.leaf;
            self.most = self.most.max(self.nearest.squared.max(0.0).sqrt());
            let closest = corners(&surface.vertices, &surface.triangles[self.nearest.triangle as usize]);
            let bound = [a, b, c].into_iter().map(|p| distance_to_triangle(p, closest)).fold(0.0, f64::max);
            if bound <= CLOSENESS * self.most + tolerance {
                continue;
            }
            if depth == DEEPEST {
                self.most = self.most.max(bound);
                continue;
            }
            let half = |p: Vec3, q: Vec3| scale(add(p, q), 0.5);
            let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
            for part in [[ab, bc, ca], [a, ab, ca], [ab, b, bc], [ca, bc, c]] {
                self.stack.push((part, depth + 1));
            }
        }
    }
}

/// Greatest distance of the points outside the hull.
pub(super) fn outside(points: &[Vec3], hull: &[Vec3], tolerance: f64) -> f64 {
    points
        .iter()
        .filter(|p| !hull.contains(p))
        .map(|&p| distance_to_hull(p, hull, tolerance))
        .fold(0.0, f64::max)
}

/// By vertex of a level: the area, projected onto its tangent plane, of the connected faces around it that stay within
/// a fixed depth of that plane.
pub(super) fn support_areas(
    level: &Level,
    radius: f64,
    shares: [f64; 2],
    progress: &mut Progress<'_>,
) -> Result<Vec<f64>, BuildError> {
    let around = around(level);
    let depth = SUPPORT_DEPTH * radius;
    let area = |v: usize, _: &AtomicBool| support_area(level, &around, v, depth);
    in_portions(&vec![1; level.vertices.len()], area, shares, progress)
}

/// By vertex the faces around it, as ranges of one list.
struct Around {
    begin: Vec<u32>,
    faces: Vec<u32>,
}

impl Around {
    fn of(&self, vertex: usize) -> &[u32] {
        &self.faces[self.begin[vertex] as usize..self.begin[vertex + 1] as usize]
    }
}

fn around(level: &Level) -> Around {
    let mut begin = vec![0u32; level.vertices.len() + 1];
    for &v in level.faces.iter().flatten() {
        begin[v as usize + 1] += 1;
    }
    for v in 0..level.vertices.len() {
        begin[v + 1] += begin[v];
    }
    let mut next = begin.clone();
    let mut faces = vec![0; level.faces.len() * 3];
    for (f, t) in level.faces.iter().enumerate() {
        for &v in t {
            faces[next[v as usize] as usize] = f as u32;
            next[v as usize] += 1;
        }
    }
    Around { begin, faces }
}

fn support_area(level: &Level, around: &Around, vertex: usize, depth: f64) -> f64 {
    let face_area = |f: u32| {
        let [a, b, c] = corners(&level.vertices, &level.faces[f as usize]);
        scale(cross(sub(b, a), sub(c, a)), 0.5)
    };
    let sum = around.of(vertex).iter().fold([0.0; 3], |sum, &f| add(sum, face_area(f)));
    let normal = unit_or_zero(sum);
    let center = level.vertices[vertex];
    let is_near = |f: u32| {
        corners(&level.vertices, &level.faces[f as usize])
            .into_iter()
            .all(|p| dot(normal, sub(p, center)).abs() <= depth)
    };
    let mut seen: Vec<u32> = Vec::new();
    let mut reached = 0;
    let mut area = 0.0;
    seen.extend(around.of(vertex).iter().filter(|&&f| is_near(f)));
    while reached < seen.len() && reached < SUPPORT_FACES {
        let face = seen[reached];
        reached += 1;
        area += dot(face_area(face), normal).max(0.0);
        for v in level.faces[face as usize] {
            for &g in around.of(v as usize) {
                if seen.len() >= 2 * SUPPORT_FACES {
                    break;
                }
                if !seen.contains(&g) && is_near(g) {
                    seen.push(g);
                }
            }
        }
    }
    area
}

/// A sphere around points: from the middle of their box, its radius rounded up.
pub(super) fn sphere(points: impl Iterator<Item = Vec3> + Clone) -> (Vec3, f64) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points.clone() {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let mut center = scale(add(low, high), 0.5);
    let farthest = |c: Vec3| {
        points.clone().fold((c, 0.0), |best: (Vec3, f64), p| {
            let d = norm(sub(p, c));
            if d > best.1 { (p, d) } else { best }
        })
    };
    // A few steps towards the farthest point (Badoiu and Clarkson 2003).
    let mut best = (center, farthest(center).1);
    for step in 1..8 {
        let (p, d) = farthest(center);
        if d < best.1 {
            best = (center, d);
        }
        center = add(center, scale(sub(p, center), 1.0 / f64::from(step + 1)));
    }
    (best.0, best.1 * (1.0 + 1e-12))
}
