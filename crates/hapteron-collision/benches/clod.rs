//! Contacts at levels of detail against exact ones and against parry3d: `cargo bench -p hapteron-collision --bench clod`.
//!
//! Time per query along a 1 kHz motion (30 queries from one pose to the next; median, mean, 95 % and greatest, after the first query, whose time stands apart), contacts, samples looked at, total
//! weight over the number of exact contacts, error of the total penalty force (all contacts k (d + depth) n, against exact, rms over the motion), and the greatest error of the least distance; before them what each surface's levels hold and how long they take from their file.
//! One core. Thresholds are shares of the body's radius. `--quick`: a few poses; `--no-peer`: without parry3d; `--passes=N`: every query's time is the least of N passes along the motion, the
//! thresholds in turns, for machines that others use too; a name: only that pair.
#![allow(clippy::unwrap_used)]

use hapteron_collision::clod::cache::load_or_build;
use hapteron_collision::clod::{Detail, Lod, LodWorkspace, query_levels};
use hapteron_collision::mesh::{TriMesh, load};
use hapteron_collision::{Contact, Surface};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use std::path::Path;
use std::time::Instant;

#[path = "../tests/common/ball.rs"]
mod shape;

/// Steps of a 1 kHz motion between two poses, which are 30 ms apart.
const STEPS: usize = 30;
const THRESHOLDS: [f64; 4] = [0.0, 0.025, 0.01, 0.004];

struct Pair {
    name: &'static str,
    body: TriMesh,
    obstacle: TriMesh,
    tolerance: f64,
    poses: Vec<Isometry3<f64>>,
}

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    println!(
        "{:<11} {:>9} {:>5} {:>9} {:>8} {:>9} {:>9} {:>9} {:>9} {:>8} {:>8} {:>6} {:>9} {:>11}",
        "pair",
        "triangles",
        "d mm",
        "threshold",
        "first ms",
        "median ms",
        "mean ms",
        "95 % ms",
        "most ms",
        "contacts",
        "samples",
        "weight",
        "force err",
        "dist err mm"
    );
    for make in [spheres_40k, jaws, tooth_rows, nut_bolt, peg_hole, spoon_mug, spheres_400k] {
        let pair = make().filter(|p| wanted.is_empty() || wanted.iter().any(|w| w == p.name));
        if let Some(pair) = pair {
            measure(&pair);
        }
    }
}

/// What the queries along a motion took and found.
#[derive(Default)]
struct Run {
    /// The first query makes the memory that the others live on.
    first: f64,
    times: Vec<f64>,
    contacts: Vec<f64>,
    samples: Vec<f64>,
    weights: Vec<f64>,
    forces: Vec<Vector3<f64>>,
    least: Vec<f64>,
}

fn measure(pair: &Pair) {
    let surfaces = [&pair.body, &pair.obstacle].map(Surface::build);
    let folder = std::env::temp_dir().join("hapteron-bench-cache");
    let load = |surface: &Surface| load_or_build(surface, Some(&folder), &mut |_| true).unwrap().0;
    let hierarchies = surfaces.each_ref().map(load);
    for (surface, hierarchy) in surfaces.iter().zip(&hierarchies) {
        let started = Instant::now();
        let again = load(surface);
        let loading = started.elapsed().as_secs_f64();
        assert!(again == *hierarchy);
        println!(
            "{:<11} {:>9} levels: {} bytes a triangle, loaded in {:.1} ms",
            pair.name,
            surface.triangle_count(),
            hierarchy.memory_bytes() / surface.triangle_count(),
            loading * 1e3
        );
    }
    let lods = [0, 1].map(|k| Lod { surface: &surfaces[k], hierarchy: &hierarchies[k] });
    let few = if std::env::args().any(|a| a == "--quick") { 4 } else { pair.poses.len() };
    let motion: Vec<Isometry3<f64>> = pair.poses[..few]
        .windows(2)
        .flat_map(|w| (0..STEPS).map(|k| w[0].lerp_slerp(&w[1], k as f64 / STEPS as f64)).collect::<Vec<_>>())
        .collect();
    let passes = std::env::args().find_map(|a| a.strip_prefix("--passes=")?.parse().ok()).unwrap_or(1);
    let mut runs: Vec<Run> = Vec::new();
    for _ in 0..passes {
        for (k, share) in THRESHOLDS.into_iter().enumerate() {
            let run = replay(lods, &motion, pair.tolerance, share);
            let Some(known) = runs.get_mut(k) else {
                runs.push(run);
                continue;
            };
            known.first = known.first.min(run.first);
            known.times.iter_mut().zip(run.times).for_each(|(known, time)| *known = known.min(time));
        }
    }
    for (run, share) in runs.iter().zip(THRESHOLDS) {
        print(pair, run, &runs[0], share);
    }
    if !std::env::args().any(|a| a == "--no-peer") {
        println!("{:<11} parry3d: {:.2} ms", pair.name, peer(pair, &motion) * 1e3);
    }
}

fn replay(lods: [Lod<'_>; 2], motion: &[Isometry3<f64>], tolerance: f64, share: f64) -> Run {
    let detail = Detail::threshold(share * lods[0].hierarchy.radius());
    let (mut workspace, still) = (LodWorkspace::new(), Isometry3::identity());
    let mut run = Run::default();
    for (i, pose) in motion.iter().enumerate() {
        let started = Instant::now();
        let found = query_levels(lods[0], pose, lods[1], &still, tolerance, &detail, &mut workspace);
        let time = started.elapsed().as_secs_f64();
        if i == 0 {
            run.first = time;
        } else {
            run.times.push(time);
        }
        run.contacts.push(found.contacts.len() as f64);
        run.weights.push(found.contacts.iter().map(|c| c.weight).sum());
        run.forces.push(force(found.contacts, tolerance));
        run.least.push(found.min_distance);
        run.samples.push(workspace.samples().iter().sum::<usize>() as f64);
    }
    run
}

fn print(pair: &Pair, run: &Run, exact: &Run, share: f64) {
    let both = || run.forces.iter().zip(&exact.forces);
    let wrong: f64 = both().map(|(a, b)| (a - b).norm_squared()).sum();
    let all: f64 = both().map(|(_, b)| b.norm_squared()).sum();
    let distances = run.least.iter().zip(&exact.least).filter(|(a, b)| a.is_finite() && b.is_finite());
    let count: f64 = exact.contacts.iter().sum();
    println!(
        "{:<11} {:>9} {:>5} {:>8}% {:>8.3} {:>9.4} {:>9.4} {:>9.4} {:>9.4} {:>8.0} {:>8.0} {:>6.3} {:>8.1}% {:>11.5}",
        pair.name,
        pair.body.triangles().len() + pair.obstacle.triangles().len(),
        pair.tolerance * 1e3,
        share * 100.0,
        run.first * 1e3,
        quantile(&run.times, 0.5) * 1e3,
        run.times.iter().sum::<f64>() / run.times.len() as f64 * 1e3,
        quantile(&run.times, 0.95) * 1e3,
        quantile(&run.times, 1.0) * 1e3,
        quantile(&run.contacts, 0.5),
        quantile(&run.samples, 0.5),
        run.weights.iter().sum::<f64>() / count.max(1.0),
        100.0 * (wrong / all.max(f64::MIN_POSITIVE)).sqrt(),
        distances.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) * 1e3,
    );
}

/// Direction and size of the sum of all penalty forces, for a stiffness of 1.
fn force(contacts: &[Contact], tolerance: f64) -> Vector3<f64> {
    contacts.iter().map(|c| -c.normal * (c.weight * (tolerance + c.depth).max(0.0))).sum()
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

/// Median time of parry3d's contact manifolds, with its workspace kept, on a few pieces of the motion.
fn peer(pair: &Pair, motion: &[Isometry3<f64>]) -> f64 {
    use parry3d_f64::math::{Pose, Rotation, Vector};
    use parry3d_f64::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher};
    let shape = |mesh: &TriMesh| {
        let vertices = mesh.vertices().iter().map(|p| Vector::new(p[0], p[1], p[2])).collect();
        parry3d_f64::shape::TriMesh::new(vertices, mesh.triangles().to_vec()).unwrap()
    };
    let (body, obstacle) = (shape(&pair.body), shape(&pair.obstacle));
    let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
    let mut workspace = None;
    let times: Vec<f64> = motion
        .chunks(15 * STEPS)
        .flat_map(|c| &c[..10.min(c.len())])
        .map(|pose| {
            let (t, q) = (pose.translation.vector, pose.rotation.quaternion());
            let rotation = Rotation::from_xyzw(q.i, q.j, q.k, q.w);
            let inverse = Pose::from_parts(Vector::new(t.x, t.y, t.z), rotation).inverse();
            let started = Instant::now();
            let _ = DefaultQueryDispatcher.contact_manifolds(
                &inverse,
                &body,
                &obstacle,
                pair.tolerance,
                &mut manifolds,
                &mut workspace,
            );
            started.elapsed().as_secs_f64()
        })
        .collect();
    quantile(&times, 0.5)
}

/// The upper jaw grinding on the lower one in full occlusion.
fn jaws() -> Option<Pair> {
    let [body, obstacle] = ["upper_jaw", "lower_jaw"].map(|name| hapteron::assets::builtin(name).unwrap());
    let poses = (0..60)
        .map(|i| {
            let phase = f64::from(i) * 0.1;
            let shift = Translation3::new(
                4e-4 * phase.sin(),
                3e-4 * (1.7 * phase).sin(),
                1e-4 + 2e-4 * (0.6 * phase).cos(),
            );
            let turn = UnitQuaternion::from_euler_angles(0.003 * phase.cos(), 0.0, 0.01 * phase.sin());
            Isometry3::from_parts(shift, turn)
        })
        .collect();
    Some(Pair { name: "jaws", body, obstacle, tolerance: 1e-3, poses })
}

fn spheres_40k() -> Option<Pair> {
    Some(spheres("spheres", 100))
}

fn spheres_400k() -> Option<Pair> {
    Some(spheres("spheres x10", 316))
}

/// A bumpy sphere in a bumpy cavity, half a tolerance apart, of 4 n^2 triangles each.
fn spheres(name: &'static str, n: u32) -> Pair {
    let poses = (0..60)
        .map(|i| {
            let phase = f64::from(i) * 0.1;
            let shift =
                Translation3::new(3e-4 * phase.sin(), 3e-4 * (1.3 * phase).cos(), 2e-4 * (0.7 * phase).sin());
            Isometry3::from_parts(shift, UnitQuaternion::from_euler_angles(0.0, 0.0, 0.005 * phase.sin()))
        })
        .collect();
    Pair {
        name,
        body: sphere(n, 0.06, false),
        obstacle: sphere(n, 0.06 + 7.5e-4, true),
        tolerance: 1.5e-3,
        poses,
    }
}

fn sphere(n: u32, size: f64, cavity: bool) -> TriMesh {
    let radius = |theta: f64, phi: f64| size + 5e-4 * (14.0 * theta).sin() * (12.0 * phi).cos() * theta.sin();
    // The cavity's vertices stand between the sphere's.
    let (vertices, triangles) = shape::ball(n + 1, radius, cavity.then_some(0.5));
    TriMesh::new(vertices, triangles).unwrap()
}

fn tooth_rows() -> Option<Pair> {
    real_pair("tooth_rows")
}

fn nut_bolt() -> Option<Pair> {
    real_pair("nut_bolt")
}

fn peg_hole() -> Option<Pair> {
    real_pair("peg_hole")
}

fn spoon_mug() -> Option<Pair> {
    real_pair("spoon_mug")
}

fn real_pair(name: &'static str) -> Option<Pair> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/queries").join(name);
    if !folder.is_dir() {
        println!("{name:<14} skipped: {} is not there", folder.display());
        return None;
    }
    let [body, obstacle] = ["body", "obstacle"].map(|file| load(folder.join(format!("{file}.obj"))).unwrap());
    let tolerance = std::fs::read_to_string(folder.join("tolerance.txt")).unwrap().trim().parse().unwrap();
    let table = std::fs::read_to_string(folder.join("poses.csv")).unwrap();
    let pose = |line: &str| {
        let c: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(c[4], c[5], c[6], c[7]));
        Isometry3::from_parts(Translation3::new(c[1], c[2], c[3]), rotation)
    };
    let poses = table.lines().skip(1).map(pose).collect();
    Some(Pair { name, body, obstacle, tolerance, poses })
}
