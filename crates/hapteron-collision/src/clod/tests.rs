//! The invariants of method A.6, checked with other means than those that made them.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::mesh::TriMesh;
use crate::vector::{add, cross, dot, norm, scale, sub};
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use std::path::Path;

#[path = "../../tests/common/ball.rs"]
pub(super) mod shape;

/// Plain pseudo-random numbers in [-1, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = [self.next(), self.next(), self.next()];
            if (0.01..1.0).contains(&norm(v)) {
                return scale(v, 1.0 / norm(v));
            }
        }
    }
}

fn build(surface: &Surface) -> Hierarchy {
    Hierarchy::build(surface, &mut |_| true).unwrap()
}

/// A sphere with bumps, `rings` from pole to pole.
fn bumpy_sphere(rings: u32, bump: f64) -> Surface {
    let radius = |theta: f64, phi: f64| 1.0 + bump * (6.0 * theta).sin() * (5.0 * phi).cos() * theta.sin();
    let (vertices, triangles) = shape::ball(rings, radius, None);
    Surface::of_triangles(&vertices, &triangles)
}

/// Would catch a patch that is not convex, a deviation that is guessed, a margin too small, a hole in a level, samples that
/// do not stand for every vertex.
fn invariants_hold(name: &str, surface: &Surface) {
    let hierarchy = build(surface);
    assert!(hierarchy.levels >= 3, "{name}: only {} levels", hierarchy.levels);
    patches_are_convex(name, surface, &hierarchy);
    levels_cover(name, surface, &hierarchy);
    deviations_hold(name, surface, &hierarchy);
    margins_hold(name, surface, &hierarchy);
    samples_are_nested(name, &hierarchy);
    let bytes = hierarchy.memory_bytes() / surface.triangles.len();
    assert!(bytes < 1000, "{name}: {bytes} bytes a triangle");
}

#[test]
fn invariants_of_made_meshes() {
    invariants_hold("bumpy sphere", &bumpy_sphere(40, 0.03));
    for name in ["spoon", "cup", "lower_jaw"] {
        let mesh = hapteron::assets::builtin(name).unwrap();
        invariants_hold(name, &Surface::of_triangles(mesh.vertices(), mesh.triangles()));
    }
}

/// Where their data are; one test each, for they take long.
fn real_invariants_hold(file: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/queries");
    match crate::mesh::load(folder.join(file)) {
        Ok(mesh) => invariants_hold(file, &Surface::build(&mesh)),
        Err(_) => println!("skipped: {file} is not there"),
    }
}

#[test]
fn invariants_of_a_bolt_s_nut() {
    real_invariants_hold("nut_bolt/body.obj");
}

#[test]
fn invariants_of_teeth() {
    real_invariants_hold("tooth_rows/body.obj");
}

#[test]
fn invariants_of_a_mug() {
    real_invariants_hold("spoon_mug/obstacle.obj");
}

fn patches_are_convex(name: &str, surface: &Surface, h: &Hierarchy) {
    let slack = 1.01e-9 * surface.radius;
    for node in h.nodes.iter().filter(|n| n.level != PURE_HULL) {
        let hull = h.hull(node);
        for t in &h.faces[range(node.faces)] {
            let [a, b, c] = t.map(|v| hull[usize::from(v)]);
            let normal = cross(sub(b, a), sub(c, a));
            for &p in hull {
                let above = dot(normal, sub(p, a)) / norm(normal);
                assert!(above <= slack, "{name} level {}: {above:e} above a face", node.level);
            }
        }
    }
}

fn levels_cover(name: &str, surface: &Surface, h: &Hierarchy) {
    for level in 0..h.levels {
        let mut covered = vec![0; surface.triangles.len()];
        for node in h.nodes.iter().filter(|n| n.level == level) {
            h.triangles[range(node.triangles)].iter().for_each(|&t| covered[t as usize] += 1);
        }
        assert!(covered.iter().all(|&c| c == 1), "{name}: level {level} does not cover each triangle once");
    }
}

fn deviations_hold(name: &str, surface: &Surface, h: &Hierarchy) {
    let mut random = Random(7);
    let original = parry(&surface.vertices, &surface.triangles);
    let rounding = 1e-9 * surface.radius;
    for level in 1..h.levels {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for patch in h.patches(level) {
            let first = vertices.len() as u32;
            vertices.extend(patch.vertices);
            triangles.extend(patch.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        let coarse = parry(&vertices, &triangles);
        for node in h.nodes.iter().filter(|n| n.level == level) {
            for &t in &h.triangles[range(node.triangles)] {
                let corners = surface.triangles[t as usize].map(|v| surface.vertices[v as usize]);
                for p in corners {
                    let d = distance(&coarse, p);
                    assert!(
                        d <= node.deviation + rounding,
                        "{name} level {level}: {d} > s = {}",
                        node.deviation
                    );
                }
                let d = distance(&coarse, inside(corners, &mut random));
                assert!(d <= node.deviation + rounding, "{name} level {level}: {d}, s = {}", node.deviation);
            }
            for t in &h.faces[range(node.faces)] {
                let corners = t.map(|v| h.hull(node)[usize::from(v)]);
                let d = distance(&original, inside(corners, &mut random));
                assert!(
                    d <= node.deviation + rounding,
                    "{name} level {level}: back {d}, s = {}",
                    node.deviation
                );
            }
        }
    }
}

fn parry(vertices: &[Vec3], triangles: &[[u32; 3]]) -> parry3d_f64::shape::TriMesh {
    let points = vertices.iter().map(|p| Vector::new(p[0], p[1], p[2])).collect();
    parry3d_f64::shape::TriMesh::new(points, triangles.to_vec()).unwrap()
}

fn distance(mesh: &parry3d_f64::shape::TriMesh, p: Vec3) -> f64 {
    mesh.distance_to_local_point(Vector::new(p[0], p[1], p[2]), false)
}

/// A random point of a triangle.
fn inside([a, b, c]: [Vec3; 3], random: &mut Random) -> Vec3 {
    let (mut u, mut v) = (0.5 + 0.5 * random.next(), 0.5 + 0.5 * random.next());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    add(a, add(scale(sub(b, a), u), scale(sub(c, a), v)))
}

/// A hull is within h of another when along no direction it reaches farther by more than h.
fn margins_hold(name: &str, surface: &Surface, h: &Hierarchy) {
    let mut random = Random(3);
    let directions: Vec<Vec3> = (0..40).map(|_| random.direction()).collect();
    let reach =
        |points: &[Vec3], d: Vec3| points.iter().map(|&p| dot(p, d)).fold(f64::NEG_INFINITY, f64::max);
    for &d in &directions {
        let mut farthest: Vec<f64> = h.nodes.iter().map(|n| reach(h.hull(n), d)).collect();
        for index in (1..h.nodes.len()).rev() {
            let parent = h.nodes[index].parent as usize;
            let own = reach(h.hull(&h.nodes[parent]), d);
            let beyond = farthest[index] - own;
            let margin = h.nodes[parent].margin;
            assert!(beyond <= margin + 1e-8 * surface.radius, "{name}: {beyond} beyond a hull, h = {margin}");
            farthest[parent] = farthest[parent].max(farthest[index]);
        }
    }
}

fn samples_are_nested(name: &str, h: &Hierarchy) {
    for node in h.nodes.iter().filter(|n| n.level != PURE_HULL) {
        let own = &h.samples[range(node.samples)];
        let weight: f32 = own.iter().map(|s| s.weight).sum();
        assert_eq!(
            weight as u32,
            node.vertices[1] - node.vertices[0],
            "{name}: not every vertex is stood for"
        );
        if node.level > 0 {
            let of_children: Vec<u32> = range(node.children)
                .flat_map(|c| &h.samples[range(h.nodes[c].samples)])
                .map(|s| s.vertex)
                .collect();
            assert!(own.iter().all(|s| of_children.contains(&s.vertex)), "{name}: a sample is new");
        }
    }
}

/// Would catch results that depend on the number of threads or on anything random.
#[test]
fn building_is_deterministic() {
    let surface = bumpy_sphere(24, 0.05);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| build(&surface));
    let many = rayon::ThreadPoolBuilder::new().num_threads(5).build().unwrap().install(|| build(&surface));
    assert_eq!(one, many);
    assert_eq!(one.to_bytes(&surface), many.to_bytes(&surface));
}

/// Would catch a build that cannot be stopped.
#[test]
fn building_stops_when_told_to() {
    let surface = bumpy_sphere(24, 0.05);
    let mut calls = 0;
    let stopped = Hierarchy::build(&surface, &mut |share| {
        calls += 1;
        assert!((0.0..=1.0).contains(&share));
        calls < 3
    });
    assert_eq!(stopped, Err(BuildError::Cancelled));
    assert_eq!(calls, 3);
}

/// Would catch a mesh that is open, bent back on itself, one-sided or torn and gives no hierarchy, or whose faults are not told.
#[test]
fn faulty_meshes_get_a_hierarchy_and_a_report() {
    // A wavy open sheet.
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..20u32 {
        for j in 0..20u32 {
            let (x, y) = (f64::from(i) * 0.1, f64::from(j) * 0.1);
            vertices.push([x, y, 0.05 * (5.0 * x).sin() * (4.0 * y).cos()]);
            if i > 0 && j > 0 {
                let [a, b, c, d] = [(i - 1) * 20 + j - 1, i * 20 + j - 1, i * 20 + j, (i - 1) * 20 + j];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let sheet = Surface::of_triangles(&vertices, &triangles);
    // The same with a fin (three faces at an edge), a cone standing on its tip, and a face turned over.
    let (mut torn, mut more) = (vertices, triangles);
    torn.extend([[0.55, 0.55, 0.4], [1.0, 1.0, 1.0], [1.1, 1.0, 1.0], [1.0, 1.1, 1.0]]);
    more.extend([[105, 106, 400], [210, 401, 402], [210, 402, 403], [210, 403, 401]]);
    more[50].swap(0, 1);
    let torn = Surface::of_triangles(&torn, &more);
    let kinds = |s: &Surface| Hierarchy::defects(s).iter().map(|d| d.kind).collect::<Vec<_>>();
    assert_eq!(kinds(&bumpy_sphere(8, 0.1)), []);
    assert_eq!(kinds(&sheet), [DefectKind::Rim]);
    for kind in [DefectKind::Rim, DefectKind::NonManifoldEdge, DefectKind::NonManifoldVertex] {
        assert!(kinds(&torn).contains(&kind), "{kind:?} in {:?}", kinds(&torn));
    }
    for (name, surface) in [("sheet", sheet), ("torn", torn)] {
        let hierarchy = build(&surface);
        assert!(hierarchy.levels >= 3, "{name}: {}", hierarchy.levels);
        patches_are_convex(name, &surface, &hierarchy);
        levels_cover(name, &surface, &hierarchy);
        deviations_hold(name, &surface, &hierarchy);
        margins_hold(name, &surface, &hierarchy);
        let again = Hierarchy::from_bytes(&hierarchy.to_bytes(&surface), &surface);
        assert_eq!(again.as_ref(), Ok(&hierarchy));
    }
}

/// A bar of so many sides with a fan of triangles at each end.
fn turned(sides: u32, radius: f64) -> Surface {
    let mut vertices = vec![[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
    let mut triangles = Vec::new();
    for k in 0..sides {
        let angle = core::f64::consts::TAU * f64::from(k) / f64::from(sides);
        let (x, y) = (radius * angle.cos(), radius * angle.sin());
        vertices.extend([[x, y, -1.0], [x, y, 1.0]]);
        let [a, b] = [k, (k + 1) % sides].map(|k| 2 + 2 * k);
        triangles.extend([[0, b, a], [1, a + 1, b + 1], [a, b, b + 1], [a, b + 1, a + 1]]);
    }
    Surface::of_triangles(&vertices, &triangles)
}

/// Would catch turned parts, whose ends are fans, that get no levels or are taken for faulty.
#[test]
fn fans_are_no_hindrance() {
    for radius in [0.01, 1.0] {
        let surface = turned(100, radius);
        assert_eq!(Hierarchy::defects(&surface), []);
        let hierarchy = build(&surface);
        assert!(hierarchy.levels >= 2, "{}", hierarchy.levels);
        levels_cover("turned", &surface, &hierarchy);
        deviations_hold("turned", &surface, &hierarchy);
    }
}

/// Would catch a soup of single triangles, or one triangle, that has no tree.
#[test]
fn tiny_and_scattered_meshes() {
    let one = TriMesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]).unwrap();
    let one = Surface::build(&one);
    assert_eq!(build(&one).nodes.len(), 1);
    let mut random = Random(1);
    let vertices: Vec<Vec3> = (0..300).map(|_| random.direction()).collect();
    let triangles: Vec<[u32; 3]> = (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let soup = Surface::of_triangles(&vertices, &triangles);
    let hierarchy = build(&soup);
    levels_cover("soup", &soup, &hierarchy);
    margins_hold("soup", &soup, &hierarchy);
    assert_eq!(hierarchy.levels()[0].patches, 100);
    let none = Surface::of_triangles(&[], &[]);
    let empty = build(&none);
    assert_eq!(Hierarchy::from_bytes(&empty.to_bytes(&none), &none), Ok(empty));
}
