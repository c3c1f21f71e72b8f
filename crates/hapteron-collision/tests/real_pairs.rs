//! The references of the real pairs beside the project, when they are there; and long motions of these and of the built-in jaws.
#![allow(clippy::unwrap_used)]

mod common;

use common::{pose_of, real_pairs};
use hapteron_collision::mesh::{TriMesh, load};
use hapteron_collision::{Contact, QueryWorkspace, Surface, query};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

type Table = Vec<BTreeMap<String, String>>;

fn table(path: &Path) -> Table {
    let text = std::fs::read_to_string(path).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let row =
        |line: &str| header.iter().map(|h| (*h).to_owned()).zip(line.split(',').map(str::to_owned)).collect();
    text.lines().skip(1).map(row).collect()
}

/// Cells with a contact point, for asking whether one is within a cell's size.
struct Grid {
    cell: f64,
    points: BTreeMap<[i64; 3], Vec<Vector3<f64>>>,
}

impl Grid {
    fn new(cell: f64, all: impl Iterator<Item = Vector3<f64>>) -> Self {
        let mut points: BTreeMap<[i64; 3], Vec<Vector3<f64>>> = BTreeMap::new();
        for p in all {
            points.entry([0, 1, 2].map(|k| (p[k] / cell).floor() as i64)).or_default().push(p);
        }
        Self { cell, points }
    }

    fn has_within_cell(&self, p: &Vector3<f64>) -> bool {
        let c = [0, 1, 2].map(|k| (p[k] / self.cell).floor() as i64);
        (0..27).any(|n| {
            let key = [c[0] + n % 3 - 1, c[1] + n / 3 % 3 - 1, c[2] + n / 9 - 1];
            self.points.get(&key).is_some_and(|list| list.iter().any(|q| (q - p).norm() <= self.cell))
        })
    }
}

fn median_edge(mesh: &TriMesh) -> f64 {
    let at = |i: u32| Vector3::from(mesh.vertices()[i as usize]);
    let mut lengths: Vec<f64> = mesh.triangles().iter().map(|t| (at(t[0]) - at(t[1])).norm()).collect();
    lengths.sort_by(f64::total_cmp);
    lengths[lengths.len() / 2]
}

/// Would catch a distance that is not exact, and a near vertex of either side without a contact nearby, on real meshes of tens of
/// thousands of triangles under a real hand's motion.
#[test]
fn distances_and_coverage_are_those_of_the_references() {
    let Some(folder) = real_pairs() else { return };
    for name in ["tooth_rows", "nut_bolt", "peg_hole", "spoon_mug"] {
        let here = folder.join(name);
        let meshes = ["body", "obstacle"].map(|file| load(here.join(format!("{file}.obj"))).unwrap());
        let [body, obstacle] = meshes.each_ref().map(Surface::build);
        let d: f64 = std::fs::read_to_string(here.join("tolerance.txt")).unwrap().trim().parse().unwrap();
        let poses = std::fs::read_to_string(here.join("poses.csv")).unwrap();
        let reference = table(&here.join("reference.csv"));
        let mut near: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        for row in table(&here.join("near_vertices.csv")) {
            let s: f64 = row["signed_distance"].parse().unwrap();
            if (-3.0 * d..d * (1.0 - 1e-6)).contains(&s) {
                let side = usize::from(row["side"] == "obstacle");
                near.entry((row["pose"].parse().unwrap(), side))
                    .or_default()
                    .push(row["vertex"].parse().unwrap());
            }
        }
        let mut workspace = QueryWorkspace::new();
        for (i, line) in poses.lines().skip(1).enumerate() {
            let pose = pose_of(line);
            let found = query(&body, &pose, &obstacle, &Isometry3::identity(), d, &mut workspace);
            let number = |key: &str| reference[i][key].parse::<f64>().unwrap();
            let least = number("min_distance");
            if number("intersecting_pairs") > 0.0 {
                let deepest = number("deepest_body_vertex").max(number("deepest_obstacle_vertex"));
                assert!(
                    -found.min_distance >= 0.9 * deepest,
                    "{name} {i}: {} of {deepest}",
                    found.min_distance
                );
            } else if least > d * (1.0 + 1e-9) {
                assert!(found.min_distance.is_infinite(), "{name} {i}");
            } else {
                assert!(
                    (found.min_distance - least).abs() <= 1e-9 + 1e-6 * least,
                    "{name} {i}: {}",
                    found.min_distance
                );
            }
            for side in 0..2 {
                let point = |c: &Contact| if side == 0 { c.point_body } else { c.point_obstacle };
                let grid = Grid::new(d + 1.5 * median_edge(&meshes[side]), found.contacts.iter().map(point));
                let world = if side == 0 { pose } else { Isometry3::identity() };
                let at = |&v: &usize| (world * Point3::from(meshes[side].vertices()[v])).coords;
                let bare: BTreeSet<usize> = near
                    .get(&(i, side))
                    .into_iter()
                    .flatten()
                    .copied()
                    .filter(|v| !grid.has_within_cell(&at(v)))
                    .collect();
                assert!(bare.is_empty(), "{name} {i}, side {side}: no contact near {bare:?}");
            }
        }
    }
}

/// Asks along pieces of a motion, 30 steps of 1 kHz from a pose to the next one, with one workspace for all, and again with an empty one at
/// every pose that `cold` chooses. Gives how many contacts were compared.
fn assert_memory_changes_nothing(
    name: &str,
    [body, obstacle]: &[Surface; 2],
    d: f64,
    poses: &[Isometry3<f64>],
    cold: usize,
) -> usize {
    let still = Isometry3::identity();
    let mut workspace = QueryWorkspace::new();
    let mut compared = 0;
    for (piece, pair) in poses.windows(2).enumerate().step_by(6) {
        for step in 0..30 {
            let pose = pair[0].lerp_slerp(&pair[1], step as f64 / 30.0);
            let warm = query(body, &pose, obstacle, &still, d, &mut workspace);
            if step % cold != 0 {
                continue;
            }
            let mut fresh = QueryWorkspace::new();
            let found = query(body, &pose, obstacle, &still, d, &mut fresh);
            assert_eq!(
                found.min_distance.to_bits(),
                warm.min_distance.to_bits(),
                "{name}, {step} steps after pose {piece}"
            );
            assert_eq!(found.contacts, warm.contacts, "{name}, {step} steps after pose {piece}");
            compared += found.contacts.len();
        }
    }
    compared
}

/// Would catch what the memory of a query hides or keeps: along a real hand's motion its result is, bit for bit, that of a query that knows nothing.
#[test]
fn memory_changes_nothing_along_real_motions() {
    let Some(folder) = real_pairs() else { return };
    // Of the pair with thousands of contacts every fifth pose is compared.
    for (name, cold) in [("tooth_rows", 1), ("nut_bolt", 5), ("peg_hole", 1), ("spoon_mug", 1)] {
        let here = folder.join(name);
        let surfaces =
            ["body", "obstacle"].map(|file| Surface::build(&load(here.join(format!("{file}.obj"))).unwrap()));
        let d: f64 = std::fs::read_to_string(here.join("tolerance.txt")).unwrap().trim().parse().unwrap();
        let table = std::fs::read_to_string(here.join("poses.csv")).unwrap();
        let poses: Vec<Isometry3<f64>> = table.lines().skip(1).map(pose_of).collect();
        let compared = assert_memory_changes_nothing(name, &surfaces, d, &poses, cold);
        assert!(compared > 1000, "{name}: {compared}");
    }
}

/// The same on the built-in jaws, closing and grinding.
#[test]
fn memory_changes_nothing_while_jaws_grind() {
    let surfaces =
        ["upper_jaw", "lower_jaw"].map(|name| Surface::build(&hapteron::assets::builtin(name).unwrap()));
    let pose = |i: i32| {
        let phase = 0.1 * f64::from(i);
        let shift = [4e-4 * phase.sin(), 3e-4 * (1.7 * phase).sin(), 1e-4 + 2e-4 * (0.6 * phase).cos()];
        let turn = UnitQuaternion::from_euler_angles(0.003 * phase.cos(), 0.0, 0.01 * phase.sin());
        Isometry3::from_parts(Translation3::from(shift), turn)
    };
    let poses: Vec<Isometry3<f64>> = (0..60).map(pose).collect();
    let compared = assert_memory_changes_nothing("jaws", &surfaces, 5e-4, &poses, 1);
    assert!(compared > 1000, "{compared}");
}
