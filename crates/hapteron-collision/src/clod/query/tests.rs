//! The least distance by levels against the exact one (method A.6, 5).
#![allow(clippy::unwrap_used)]

use super::*;
use crate::clod::tests::shape;
use crate::mesh::load;
use crate::query::QueryWorkspace;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use std::path::Path;

/// Two surfaces with their levels, and a motion of a query a millisecond.
struct Case {
    name: &'static str,
    surfaces: [Surface; 2],
    tolerance: f64,
    motion: Vec<Isometry3<f64>>,
}

/// What a front's nodes are off by: where a feature is (zero when no node of the front is there), and at most.
fn deviations(lod: Lod<'_>, nodes: &[u32], feature: u32) -> [f64; 2] {
    let surface = lod.surface;
    let (vertices, edges) = (surface.vertices.len() as u32, surface.edges.len() as u32);
    let is_there = |t: u32| {
        if feature < vertices {
            surface.triangles[t as usize].contains(&feature)
        } else if feature < vertices + edges {
            surface.triangle_edges[t as usize].contains(&(feature - vertices))
        } else {
            t == feature - vertices - edges
        }
    };
    let own = nodes.iter().map(|&n| &lod.hierarchy.nodes[n as usize]);
    let there =
        own.clone().filter(|n| lod.hierarchy.triangles[range(n.triangles)].iter().any(|&t| is_there(t)));
    [there.map(|n| n.deviation).fold(0.0, f64::max), own.map(|n| n.deviation).fold(0.0, f64::max)]
}

/// Asserts the bound along the motion; returns how many queries were by levels.
fn check(case: &Case) -> usize {
    let built = case.surfaces.each_ref().map(|s| Hierarchy::build(s, &mut |_| true).unwrap());
    let lods = [0, 1].map(|k| Lod { surface: &case.surfaces[k], hierarchy: &built[k] });
    let still = Isometry3::identity();
    let mut by_levels = 0;
    for share in [0.025, 0.01, 0.004] {
        let detail = Detail::threshold(share * built[0].radius());
        let (mut workspace, mut exact) = (LodWorkspace::new(), QueryWorkspace::new());
        workspace.watch(true);
        let (mut worst, mut off, mut strict) = (0.0f64, 0, 0);
        for (i, pose) in case.motion.iter().enumerate() {
            let d = case.tolerance;
            let found = query_levels(lods[0], pose, lods[1], &still, d, &detail, &mut workspace).min_distance;
            let wanted = query(lods[0].surface, pose, lods[1].surface, &still, d, &mut exact);
            if found == wanted.min_distance {
                continue;
            }
            let fronts = workspace.front();
            assert!(fronts.iter().any(|nodes| !nodes.is_empty()), "{} {share} {i}: {found}", case.name);
            let closest = wanted.contacts.iter().max_by(|a, b| a.depth.total_cmp(&b.depth)).unwrap();
            // The closest place of a surface may face away and make no contact; then nobody tells where it is.
            let known = usize::from(closest.depth != -wanted.min_distance);
            strict += 1 - known;
            let features = [closest.body_feature, closest.obstacle_feature];
            let allowed: f64 = (0..2).map(|k| deviations(lods[k], fronts[k], features[k])[known]).sum();
            let allowed = allowed + 1e-12;
            let wrong = (found - wanted.min_distance).abs();
            (worst, off) = (worst.max(wrong), off + 1);
            assert!(wrong <= allowed, "{} {share} {i}: {found} {} {allowed}", case.name, wanted.min_distance);
        }
        by_levels += usize::from(workspace.way == Way::Levels);
        println!(
            "{} {share}: {off} of {} not exact, by up to {:.6} mm, the place known in {strict}",
            case.name,
            case.motion.len(),
            worst * 1e3
        );
    }
    by_levels
}

fn swaying(i: u32, low: f64) -> Isometry3<f64> {
    let phase = f64::from(i) * 0.02;
    let shift =
        Translation3::new(4e-4 * phase.sin(), 3e-4 * (1.7 * phase).sin(), low + 2e-4 * (0.6 * phase).cos());
    let turn = UnitQuaternion::from_euler_angles(0.003 * phase.cos(), 0.0, 0.01 * phase.sin());
    Isometry3::from_parts(shift, turn)
}

/// Would catch a least distance that is off by more than the levels are: bumpy balls from apart until they are pressed.
#[test]
fn the_least_distance_is_within_the_deviations() {
    let motion = (0..300).map(|i| swaying(i, -2e-6 * f64::from(i))).collect();
    let balls = Case { name: "balls", surfaces: balls(40), tolerance: 1.5e-3, motion };
    assert_eq!(check(&balls), 3);
}

/// The same for contacts so large that the least distance is that of a local minimum.
#[test]
#[ignore = "builds the levels of two balls of 40,000 triangles, which takes minutes unless optimized"]
fn the_least_distance_of_large_balls_is_within_the_deviations() {
    let motion = (0..300).map(|i| swaying(i, -1e-6 * f64::from(i))).collect();
    let balls = Case { name: "large balls", surfaces: balls(101), tolerance: 1.5e-3, motion };
    assert_eq!(check(&balls), 3);
}

/// A bumpy ball of so many rings in a cavity.
fn balls(rings: u32) -> [Surface; 2] {
    let bump = |theta: f64, phi: f64| 5e-4 * (14.0 * theta).sin() * (12.0 * phi).cos() * theta.sin();
    [(0.06, None), (0.06075, Some(0.5))].map(|(size, cavity)| {
        let (vertices, triangles) = shape::ball(rings, |theta, phi| size + bump(theta, phi), cavity);
        Surface::of_triangles(&vertices, &triangles)
    })
}

/// The same for the built-in jaws, apart, touching and pressed.
#[test]
#[ignore = "builds the levels of two jaws, which takes minutes unless optimized"]
fn the_least_distance_of_jaws_is_within_the_deviations() {
    let surfaces = ["upper_jaw", "lower_jaw"].map(|name| {
        let mesh = hapteron::assets::builtin(name).unwrap();
        Surface::of_triangles(mesh.vertices(), mesh.triangles())
    });
    let low = |i: u32| 1e-4 - 5e-4 * f64::from(i) / 900.0;
    let motion = (0..900).map(|i| swaying(i, low(i))).collect();
    assert_eq!(check(&Case { name: "jaws", surfaces, tolerance: 1e-3, motion }), 3);
}

/// The same for real pairs, where their data are.
#[test]
#[ignore = "builds the levels of eight surfaces, which takes minutes unless optimized"]
fn the_least_distance_of_real_pairs_is_within_the_deviations() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/queries");
    for (name, poses) in [("tooth_rows", 60), ("spoon_mug", 60), ("peg_hole", 60), ("nut_bolt", 10)] {
        let here = folder.join(name);
        let Ok(table) = std::fs::read_to_string(here.join("poses.csv")) else {
            println!("skipped: {} is not there", here.display());
            continue;
        };
        let pose = |line: &str| {
            let c: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(c[4], c[5], c[6], c[7]));
            Isometry3::from_parts(Translation3::new(c[1], c[2], c[3]), turn)
        };
        let poses: Vec<_> = table.lines().skip(1).take(poses).map(pose).collect();
        let between = |w: &[Isometry3<f64>]| {
            [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(|k| w[0].lerp_slerp(&w[1], 0.1 * f64::from(k)))
        };
        let motion = poses.windows(2).flat_map(between).collect();
        let surfaces =
            ["body", "obstacle"].map(|f| Surface::build(&load(here.join(format!("{f}.obj"))).unwrap()));
        let tolerance = std::fs::read_to_string(here.join("tolerance.txt")).unwrap().trim().parse().unwrap();
        check(&Case { name, surfaces, tolerance, motion });
    }
}
