//! The references of the real pairs beside the project, when they are there.
#![allow(clippy::unwrap_used)]

mod common;

use common::{pose_of, real_pairs};
use hapteron_collision::mesh::{TriMesh, load};
use hapteron_collision::{Contact, QueryWorkspace, Surface, query};
use nalgebra::{Isometry3, Point3, Vector3};
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
