//! Contact levels of detail in the whole loop: a coarse replay feels like the exact one.
#![allow(clippy::unwrap_used)]

use hapteron::collision::clod::Lod;
use hapteron::recording::Recording;
use hapteron::scene::{Scene, SceneFile};
use hapteron::scenes::{demo, jaws};
use hapteron::session::real_time::{RealTime, RealTimeOptions, SceneDevice};
use hapteron::session::{ContactPass, ContactSnapshot, LevelsInUse, VirtualTime, run_virtual};
use nalgebra::Vector3;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

fn run(mut file: SceneFile, threshold: f64) -> Recording {
    file.contact.error_threshold = Some(threshold);
    run_virtual(&Scene::from_file(file).unwrap(), &mut |_| true).unwrap()
}

/// Root mean square of the difference of two runs' feedback force over that of the first.
fn difference(exact: &Recording, other: &Recording) -> f64 {
    let pairs = || exact.rows.iter().zip(&other.rows);
    let wrong: f64 = pairs().map(|(a, b)| (a.feedback[0] - b.feedback[0]).norm_squared()).sum();
    let all: f64 = pairs().map(|(a, _)| a.feedback[0].norm_squared()).sum();
    (wrong / all).sqrt()
}

/// Would catch coarse contacts that push otherwise than exact ones: too weak, too strong, or elsewhere.
#[test]
fn coarse_jaws_feel_like_exact_ones() {
    let exact = run(jaws(), 0.0);
    for threshold in [0.025, 0.01, 0.004] {
        let coarse = run(jaws(), threshold);
        let difference = difference(&exact, &coarse);
        let depth = coarse.summary().greatest_penetration;
        println!("{threshold}: {:.3} % rms, penetration {:.4} mm", 100.0 * difference, depth * 1e3);
        assert!(difference < 0.05, "{threshold}: {difference}");
        assert!(depth < 1e-4, "{threshold}: {depth} m deep");
    }
}

/// Would catch forces that jump when levels change: the jaws closed, ground slowly against each other, and opened so that
/// the contact grows and shrinks.
#[test]
fn a_slow_slide_does_not_jump() {
    let path = slide();
    let mut file = jaws();
    file.hand.trajectory = Some(path.display().to_string());
    let largest_step = |r: &Recording| {
        r.rows.windows(2).map(|w| (w[1].feedback[0] - w[0].feedback[0]).norm()).fold(0.0, f64::max)
    };
    let exact = largest_step(&run(file.clone(), 0.0));
    for threshold in [0.025, 0.004] {
        let coarse = largest_step(&run(file.clone(), threshold));
        println!("{threshold}: largest step {coarse:.4} N, exact {exact:.4} N");
        assert!(coarse < 0.1, "{threshold}: {coarse} N");
    }
    std::fs::remove_file(path).unwrap();
}

/// The upper jaw lowered by 7 mm in 0.7 s, moved sideways by 3 mm in 0.6 s, lifted again.
fn slide() -> PathBuf {
    use std::fmt::Write;
    let [x, y, z] = hapteron::scenes::JAW_GRIP;
    let smooth = |u: f64| {
        let u = u.clamp(0.0, 1.0);
        u * u * (3.0 - 2.0 * u)
    };
    let mut text = "t,px,py,pz,qw,qx,qy,qz\n".to_owned();
    for i in 0..=2000 {
        let t = f64::from(i) * 1e-3;
        let down = 7e-3 * (smooth(t / 0.7) - smooth((t - 1.3) / 0.7));
        let aside = 3e-3 * smooth((t - 0.7) / 0.6);
        let height = z + hapteron::scenes::JAW_OPENING - down;
        writeln!(text, "{t},{},{y},{height},1,0,0,0", x + aside).unwrap();
    }
    let path = std::env::temp_dir().join(format!("hapteron-slide-{}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    path
}

/// The jaws at a level, with the state in which they are closed.
fn closed(threshold: f64) -> (Scene, hapteron::dynamics::State) {
    let mut file = jaws();
    file.contact.error_threshold = Some(threshold);
    let scene = Scene::from_file(file).unwrap();
    let mut session = VirtualTime::new(&scene).unwrap();
    let mut last = session.advance();
    for _ in 0..450 {
        last = session.advance();
    }
    (scene, last.after.state)
}

/// Distance from a point to the nearest corner of some nodes' triangles.
fn to_corners(lod: &Lod<'_>, nodes: &[u32], point: &Vector3<f64>) -> f64 {
    let corners = nodes.iter().flat_map(|&node| lod.corners(node));
    corners.map(|(corner, _)| (Vector3::from(corner) - point).norm()).fold(f64::INFINITY, f64::min)
}

/// Would catch patches shown that are not those the contacts come from: every contact is at a vertex of a patch that is shown, on the body or
/// on the obstacle, and coarse levels have fewer patches than fine ones.
#[test]
fn the_levels_that_are_shown_are_those_that_contacts_are_made_at() {
    let mut counts = Vec::new();
    for threshold in [0.025, 0.004] {
        let (scene, state) = closed(threshold);
        let mut pass = ContactPass::new(&scene);
        let mut snapshot = ContactSnapshot::empty(&scene.body, &state);
        let mut levels = LevelsInUse::default();
        pass.run(&scene, &state, 0.0, 0.0, &mut snapshot);
        pass.levels_in_use(&mut levels);
        assert_eq!(levels.fronts, [[vec![], vec![]]], "noted though nobody looks");
        pass.watch_levels(true);
        // The first passes are exact, while the levels are made ready.
        for _ in 0..500 {
            pass.run(&scene, &state, 0.0, 0.0, &mut snapshot);
        }
        pass.levels_in_use(&mut levels);
        let [on_body, on_obstacle] = &levels.fronts[0];
        let (body, obstacle) = (scene.model.lod().unwrap(), scene.obstacles[0].model.lod().unwrap());
        assert!(snapshot.planes().len() > 20, "the jaws are open");
        let mesh_from_world = scene.world_from_mesh(&state).inverse();
        for plane in snapshot.planes() {
            let point = state.position + state.unit_quaternion() * plane.point_b;
            let foot = point - plane.normal_w * (plane.normal_w.dot(&point) - plane.offset);
            let there = to_corners(&body, on_body, &(mesh_from_world * nalgebra::Point3::from(point)).coords);
            let world_from_obstacle = scene.obstacles[0].world_from_mesh;
            let foot = world_from_obstacle.inverse_transform_point(&foot.into()).coords;
            let nearest = there.min(to_corners(&obstacle, on_obstacle, &foot));
            assert!(nearest < 1e-7, "a contact {nearest} m from all patches");
        }
        for (lod, nodes) in [(body, on_body), (obstacle, on_obstacle)] {
            assert!(nodes.iter().all(|&n| lod.hierarchy.level_of(n).is_some()));
        }
        counts.push(on_body.len() + on_obstacle.len());
    }
    assert!(counts[0] < counts[1], "{counts:?}");
}

/// Would catch levels that do not come out of a running session, or come although nobody looks.
#[test]
fn a_running_session_tells_its_levels_to_who_looks() {
    // Held closed and ground slowly: what moves quickly is exact.
    let mut file = demo();
    file.contact.error_threshold = Some(0.025);
    let scene = Arc::new(Scene::from_file(file).unwrap());
    let device = Box::new(SceneDevice::new(Arc::clone(&scene), true).unwrap());
    let mut running = RealTime::start(
        Arc::clone(&scene),
        device,
        RealTimeOptions { attach: false, ..RealTimeOptions::of(&scene) },
    )
    .unwrap();
    std::thread::sleep(Duration::from_millis(1000));
    assert!(running.levels().fronts.is_empty());
    running.watch_levels(true);
    let mut looks = 0;
    while running.levels().fronts.iter().flatten().all(Vec::is_empty) {
        looks += 1;
        assert!(looks < 6000, "no levels in use");
        std::thread::sleep(Duration::from_millis(5));
        running.drain(&mut |_| {});
    }
    assert!(running.stop().end.is_regular());
}
