//! Time of exact queries, against parry3d's contact manifolds on the same poses: `cargo bench -p hapteron-collision --bench query`.
//!
//! The built-in jaws are always measured; the real pairs when their data are there. `cold`: each pose alone, with a workspace that knows nothing;
//! `1 kHz`: along the motion, 30 queries from each pose to the next, with one workspace. Medians, milliseconds, one core. The peer lists every pair of close triangles.
//! `B/tri`: memory of the two structures, bytes a triangle. Names of pairs as arguments choose among them; `--alone` leaves the peer out.
#![allow(clippy::unwrap_used)]

use hapteron_collision::mesh::{TriMesh, load};
use hapteron_collision::{QueryWorkspace, Surface, query};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Steps of a 1 kHz motion between two poses, which are 30 ms apart.
const STEPS: usize = 30;

struct Pair {
    name: String,
    body: TriMesh,
    obstacle: TriMesh,
    tolerance: f64,
    poses: Vec<Isometry3<f64>>,
}

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    println!(
        "{:<12} {:>6} {:>9} {:>7} {:>9} {:>9} {:>8} {:>10} {:>10} {:>6} {:>6}",
        "pair",
        "d mm",
        "triangles",
        "B/tri",
        "cold ms",
        "1 kHz ms",
        "contacts",
        "parry cold",
        "parry 1kHz",
        "x cold",
        "x 1kHz"
    );
    for pair in real_pairs().into_iter().chain([jaws()]) {
        if wanted.is_empty() || wanted.contains(&pair.name) {
            measure(&pair);
        }
    }
}

fn measure(pair: &Pair) {
    let body = Surface::build(&pair.body);
    let obstacle = Surface::build(&pair.obstacle);
    let still = Isometry3::identity();
    let mut contacts = Vec::new();
    let cold: Vec<f64> = pair
        .poses
        .iter()
        .map(|pose| {
            least_of(3, || {
                let mut workspace = QueryWorkspace::new();
                let start = Instant::now();
                let found = query(&body, pose, &obstacle, &still, pair.tolerance, &mut workspace);
                contacts.push(found.contacts.len() as f64);
                start.elapsed().as_secs_f64()
            })
        })
        .collect();
    let motion = motion(&pair.poses);
    let mut workspace = QueryWorkspace::new();
    let warm: Vec<f64> = motion
        .iter()
        .map(|pose| {
            let start = Instant::now();
            let _ = query(&body, pose, &obstacle, &still, pair.tolerance, &mut workspace);
            start.elapsed().as_secs_f64()
        })
        .collect();
    let alone = std::env::args().any(|a| a == "--alone");
    let [parry_cold, parry_warm] = if alone { [f64::NAN; 2] } else { peer(pair, &motion) };
    let (cold, warm) = (median(cold) * 1e3, median(warm) * 1e3);
    println!(
        "{:<12} {:>6} {:>9} {:>7.1} {:>9.4} {:>9.4} {:>8.0} {:>10.3} {:>10.3} {:>6.1} {:>6.1}",
        pair.name,
        pair.tolerance * 1e3,
        body.triangle_count() + obstacle.triangle_count(),
        (body.memory_bytes() + obstacle.memory_bytes()) as f64
            / (body.triangle_count() + obstacle.triangle_count()) as f64,
        cold,
        warm,
        median(contacts),
        parry_cold * 1e3,
        parry_warm * 1e3,
        parry_cold * 1e3 / cold,
        parry_warm * 1e3 / warm
    );
}

/// Medians of the same queries by parry3d: with fresh manifolds for every pose, and along the motion with its workspace kept.
fn peer(pair: &Pair, motion: &[Isometry3<f64>]) -> [f64; 2] {
    let shape = |mesh: &TriMesh| {
        let vertices = mesh.vertices().iter().map(|p| Vector::new(p[0], p[1], p[2])).collect();
        parry3d_f64::shape::TriMesh::new(vertices, mesh.triangles().to_vec()).unwrap()
    };
    let (body, obstacle) = (shape(&pair.body), shape(&pair.obstacle));
    let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
    let mut workspace = None;
    let mut ask = |pose: &Isometry3<f64>, manifolds: &mut Vec<ContactManifold<(), ()>>, keep: bool| {
        if !keep {
            workspace = None;
            manifolds.clear();
        }
        let (t, q) = (pose.translation.vector, pose.rotation.quaternion());
        let inverse =
            Pose::from_parts(Vector::new(t.x, t.y, t.z), Rotation::from_xyzw(q.i, q.j, q.k, q.w)).inverse();
        let start = Instant::now();
        let _ = DefaultQueryDispatcher.contact_manifolds(
            &inverse,
            &body,
            &obstacle,
            pair.tolerance,
            manifolds,
            &mut workspace,
        );
        start.elapsed().as_secs_f64()
    };
    let cold = pair.poses.iter().map(|pose| ask(pose, &mut manifolds, false)).collect();
    // A tenth of the motion in one piece each is enough: the peer takes seconds.
    let warm = motion
        .chunks(10 * STEPS)
        .flat_map(|c| &c[..STEPS.min(c.len())])
        .map(|pose| ask(pose, &mut manifolds, true))
        .collect();
    [median(cold), median(warm)]
}

fn least_of(count: usize, mut run: impl FnMut() -> f64) -> f64 {
    (0..count).map(|_| run()).fold(f64::INFINITY, f64::min)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn motion(poses: &[Isometry3<f64>]) -> Vec<Isometry3<f64>> {
    let steps = |w: &[Isometry3<f64>]| {
        (0..STEPS).map(|k| w[0].lerp_slerp(&w[1], k as f64 / STEPS as f64)).collect::<Vec<_>>()
    };
    poses.windows(2).flat_map(steps).collect()
}

/// The upper jaw closing on the lower one and grinding.
fn jaws() -> Pair {
    let [body, obstacle] = ["upper_jaw", "lower_jaw"].map(|name| hapteron::assets::builtin(name).unwrap());
    let poses = (0..60)
        .map(|i| {
            let phase = f64::from(i) * 0.1;
            let shift = Translation3::new(
                4e-4 * phase.sin(),
                3e-4 * (1.7 * phase).sin(),
                1e-4 + 2e-4 * (0.6 * phase).cos(),
            );
            Isometry3::from_parts(
                shift,
                UnitQuaternion::from_euler_angles(0.003 * phase.cos(), 0.0, 0.01 * phase.sin()),
            )
        })
        .collect();
    Pair { name: "jaws".to_owned(), body, obstacle, tolerance: 5e-4, poses }
}

fn real_pairs() -> Vec<Pair> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/queries");
    if !folder.is_dir() {
        println!("the real pairs are skipped: {} is not there", folder.display());
        return Vec::new();
    }
    ["tooth_rows", "nut_bolt", "peg_hole", "spoon_mug"].map(|name| real_pair(name, folder.join(name))).into()
}

fn real_pair(name: &str, folder: PathBuf) -> Pair {
    let [body, obstacle] = ["body", "obstacle"].map(|file| load(folder.join(format!("{file}.obj"))).unwrap());
    let tolerance = std::fs::read_to_string(folder.join("tolerance.txt")).unwrap().trim().parse().unwrap();
    let table = std::fs::read_to_string(folder.join("poses.csv")).unwrap();
    let pose = |line: &str| {
        let c: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(c[4], c[5], c[6], c[7]));
        Isometry3::from_parts(Translation3::new(c[1], c[2], c[3]), rotation)
    };
    Pair {
        name: name.to_owned(),
        body,
        obstacle,
        tolerance,
        poses: table.lines().skip(1).map(pose).collect(),
    }
}
