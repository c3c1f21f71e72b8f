//! Measures every branch of the tree and lays the result out flat.

use super::convex::CONVEX_SLACK;
use super::measure;
use super::portions::in_portions;
use super::samples;
use super::simplify::Level;
use super::tree::{Branch, Tree};
use super::{BuildError, Progress, tell};
use crate::clod::middle::middles;
use crate::clod::{Hierarchy, Node, PURE_HULL, range};
use crate::surface::Surface;
use crate::vector::{Vec3, add, cross, dot, sub, unit_or_zero};
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// A mere hull has no more vertices than this; the margin makes up for what it leaves out.
const HULL_VERTICES: usize = 64;

/// The levels with what is measured of each as a whole.
struct Coarse<'a> {
    levels: &'a [Level],
    surfaces: &'a [Surface],
    supports: &'a [Vec<f64>],
}

/// What is measured of a branch by itself.
struct Measured {
    hull: Vec<Vec3>,
    faces: Vec<[u8; 3]>,
    deviation: f64,
    edge: f64,
    support: f64,
    sphere: (Vec3, f64),
    slab: (Vec3, f64, f64),
}

pub(super) fn freeze(
    surface: &Surface,
    radius: f64,
    levels: &[Level],
    tree: &Tree,
    progress: &mut Progress<'_>,
) -> Result<Hierarchy, BuildError> {
    let supports = support_areas(levels, radius, progress)?;
    let surfaces: Vec<Surface> = levels.par_iter().map(Level::surface).collect();
    let coarse = Coarse { levels, surfaces: &surfaces, supports: &supports };
    tell(progress, 0.8)?;
    let weights: Vec<usize> = tree.branches.iter().map(|b| weight(&coarse, b)).collect();
    let measure =
        |b: usize, stop: &AtomicBool| measure_branch(surface, &coarse, tree, &tree.branches[b], stop);
    let mut measured = in_portions(&weights, measure, [0.8, 0.93], progress)?;
    let margins = complete(surface, tree, &mut measured, progress)?;
    let samples = samples::samples(surface, levels, tree);
    let mut result = Hierarchy {
        nodes: Vec::with_capacity(tree.branches.len()),
        middles: Vec::new(),
        hull_vertices: Vec::new(),
        faces: Vec::new(),
        triangles: tree.triangles.clone(),
        vertices: tree.vertices.clone(),
        samples: Vec::new(),
        levels: levels.len() as u32,
        identity: surface.identity,
    };
    for (index, branch) in tree.branches.iter().enumerate() {
        let own = &measured[index];
        let begin = [result.hull_vertices.len(), result.faces.len(), result.samples.len()];
        result.hull_vertices.extend(&own.hull);
        result.faces.extend(&own.faces);
        result.samples.extend(&samples[index]);
        let end = [result.hull_vertices.len(), result.faces.len(), result.samples.len()];
        let [hull, faces, samples] = [0, 1, 2].map(|k| [begin[k] as u32, end[k] as u32]);
        result.nodes.push(Node {
            center: own.sphere.0,
            radius: own.sphere.1,
            normal: own.slab.0,
            low: own.slab.1,
            high: own.slab.2,
            edge: own.edge,
            deviation: own.deviation,
            margin: margins[index],
            support: own.support,
            level: branch.patch.map_or(PURE_HULL, |p| p.0),
            parent: branch.parent,
            children: branch.children,
            hull,
            faces,
            triangles: branch.triangles,
            vertices: branch.vertices,
            samples,
        });
    }
    result.middles = middles(surface, &result.nodes, &result.vertices);
    Ok(result)
}

/// By level the support areas at its vertices.
fn support_areas(
    levels: &[Level],
    radius: f64,
    progress: &mut Progress<'_>,
) -> Result<Vec<Vec<f64>>, BuildError> {
    let all = levels.iter().map(|level| level.vertices.len()).sum::<usize>().max(1) as f64;
    let mut done = 0;
    let share = |done: usize| 0.7 + 0.1 * done as f64 / all;
    let of_level = |level: &Level| {
        let begin = done;
        done += level.vertices.len();
        measure::support_areas(level, radius, [share(begin), share(done)], progress)
    };
    levels.iter().map(of_level).collect()
}

/// About how long a branch takes to be measured: as long as there are triangles whose deviation is looked for.
fn weight(coarse: &Coarse<'_>, branch: &Branch) -> usize {
    let originals = (branch.triangles[1] - branch.triangles[0]) as usize;
    match branch.patch {
        None | Some((0, _)) => 1 + originals / 100,
        Some((level, patch)) => {
            let [begin, end] = coarse.levels[level as usize].patches[patch as usize].faces;
            1 + originals + (end - begin) as usize
        }
    }
}

fn measure_branch(
    surface: &Surface,
    coarse: &Coarse<'_>,
    tree: &Tree,
    branch: &Branch,
    stop: &AtomicBool,
) -> Measured {
    let originals = &tree.triangles[range(branch.triangles)];
    let corners = originals.iter().flat_map(|&t| surface.triangles[t as usize]);
    let points = corners.map(|v| surface.vertices[v as usize]);
    let mut result = Measured {
        hull: Vec::new(),
        faces: Vec::new(),
        deviation: f64::INFINITY,
        edge: f64::INFINITY,
        support: 0.0,
        sphere: measure::sphere(points.clone()),
        slab: slab(surface, originals, points),
    };
    let Some((number, patch)) = branch.patch else { return result };
    let level = &coarse.levels[number as usize];
    let patch = &level.patches[patch as usize];
    let mut corner: Vec<u32> = Vec::new();
    for t in &level.faces[range(patch.faces)] {
        result.faces.push(t.map(|v| {
            let known = corner.iter().position(|&c| c == v);
            let at = known.unwrap_or_else(|| {
                corner.push(v);
                corner.len() - 1
            });
            at as u8
        }));
    }
    result.hull = corner.iter().map(|&v| level.vertices[v as usize]).collect();
    result.edge = patch.edge;
    let of_corners = corner.iter().map(|&v| coarse.supports[number as usize][v as usize]);
    result.support = of_corners.fold(0.0, f64::max);
    // At the leaves the patch is the original.
    result.deviation = if number == 0 {
        0.0
    } else {
        measure::deviation(surface, originals, level, &coarse.surfaces[number as usize], patch.faces, stop)
    };
    result
}

/// The mean normal of some triangles and the heights along it between which they lie.
fn slab(surface: &Surface, originals: &[u32], points: impl Iterator<Item = Vec3>) -> (Vec3, f64, f64) {
    let sum = originals.iter().fold([0.0; 3], |sum, &t| {
        let [a, b, c] = surface.triangles[t as usize].map(|v| surface.vertices[v as usize]);
        add(sum, cross(sub(b, a), sub(c, a)))
    });
    let normal = unit_or_zero(sum);
    let heights = points.map(|p| dot(normal, p));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let rounding = 1e-12 * (low.abs().max(high.abs()));
    (normal, low - rounding, high + rounding)
}

/// From the leaves up, the hulls of what has no patch, and the margins: a hull whose vertices lie within e of another lies
/// within e of it altogether, so margins add up from child to parent.
fn complete(
    surface: &Surface,
    tree: &Tree,
    measured: &mut [Measured],
    progress: &mut Progress<'_>,
) -> Result<Vec<f64>, BuildError> {
    let tolerance = CONVEX_SLACK * surface.radius;
    for index in (0..tree.branches.len()).rev() {
        let children = range(tree.branches[index].children);
        let support = children.clone().map(|c| measured[c].support).fold(0.0, f64::max);
        measured[index].support = measured[index].support.max(support);
        if tree.branches[index].patch.is_none() {
            let points: Vec<Vec3> = children.flat_map(|c| measured[c].hull.clone()).collect();
            measured[index].hull = extremes(points);
        }
    }
    let parent = |index: usize| &measured[tree.branches[index].parent as usize];
    let weights: Vec<usize> =
        (0..measured.len()).map(|i| measured[i].hull.len() * parent(i).hull.len()).collect();
    let outside = |index: usize, _: &AtomicBool| {
        measure::outside(&measured[index].hull, &parent(index).hull, tolerance)
    };
    let step = in_portions(&weights, outside, [0.93, 0.97], progress)?;
    let mut margins = vec![0.0; tree.branches.len()];
    for index in (1..tree.branches.len()).rev() {
        let parent = tree.branches[index].parent as usize;
        let needed: f64 = margins[index] + step[index];
        margins[parent] = needed.max(margins[parent]);
    }
    Ok(margins)
}

/// The points that are extreme in some direction out of a fixed set, spread evenly over the sphere.
fn extremes(points: Vec<Vec3>) -> Vec<Vec3> {
    if points.len() <= HULL_VERTICES {
        return points;
    }
    let golden = core::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    let mut kept: Vec<usize> = (0..HULL_VERTICES)
        .filter_map(|k| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / HULL_VERTICES as f64;
            let (sin, cos) = libm::sincos(golden * k as f64);
            let flat = (1.0 - z * z).sqrt();
            let direction = [flat * cos, flat * sin, z];
            (0..points.len()).max_by(|&i, &j| {
                dot(points[i], direction).total_cmp(&dot(points[j], direction)).then(j.cmp(&i))
            })
        })
        .collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|i| points[i]).collect()
}
