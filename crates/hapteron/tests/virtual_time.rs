//! The deterministic schedule.
#![allow(clippy::unwrap_used)]

mod common;

use common::{csv, record};
use hapteron::recording::Recording;
use hapteron::scene::file::{Anticipation, ContactModel, Method};
use hapteron::scene::{Changes, Scene, SceneFile};
use hapteron::scenes::{spoon_in_cup, spoon_in_free_space};
use hapteron::session::{VirtualTime, run_virtual_for};
use hapteron::trajectory::Trajectory;
use std::path::Path;

fn scheduled(period: f64, latency: f64) -> SceneFile {
    let mut file = spoon_in_cup(0.01, 2e3, Method::BackwardEuler);
    file.contact_thread.period = Some(period);
    file.contact_thread.latency = Some(latency);
    file
}

/// Contact ages of the first ticks in milliseconds.
fn ages(period: f64, latency: f64, ticks: usize) -> Vec<f64> {
    let scene = Scene::from_file(scheduled(period, latency)).unwrap();
    let mut session = VirtualTime::new(&scene).unwrap();
    (0..ticks).map(|_| (session.advance().contact_age * 1e6).round() / 1e3).collect()
}

/// Would catch a pass that sees a state too new or too old, or contacts used before they are ready. The expected ages follow by
/// hand from the schedule's definition.
#[test]
fn contacts_are_as_old_as_period_and_latency_make_them() {
    // Each tick uses the state of the tick before.
    assert_eq!(ages(1e-3, 0.0, 5), [1.0; 5]);
    // Pass at 1 is ready at 2, in time for tick 2: the state of 1.
    assert_eq!(ages(1e-3, 1e-3, 5), [1.0; 5]);
    // Ready at 2.5, so tick 2 still has the start's; the next starts at 2.5 with the state of 2, and is ready at 4.
    assert_eq!(ages(1e-3, 1.5e-3, 6), [1.0, 2.0, 2.0, 2.0, 3.0, 2.0]);
    // Passes at 2, 4, 6 ... ready at once, used from the next tick.
    assert_eq!(ages(2e-3, 0.0, 6), [1.0, 2.0, 1.0, 2.0, 1.0, 2.0]);
    // Two passes a tick; the one at 0.5 sees the state of 0.
    assert_eq!(ages(0.5e-3, 0.0, 4), [1.0; 4]);
    // Slower than its period: passes at 2, 5, 8, ready 3 later.
    assert_eq!(ages(2e-3, 3e-3, 9), [1.0, 2.0, 3.0, 4.0, 3.0, 4.0, 5.0, 3.0, 4.0].map(|a: f64| a));
}

/// Would catch any state outside the scene: a clock, an address, an order of threads.
#[test]
fn the_same_scene_gives_the_same_bits() {
    for change in [(1e-3, 0.0), (3.3e-3, 2.1e-3)] {
        let (a, b) = (record(scheduled(change.0, change.1)), record(scheduled(change.0, change.1)));
        assert_eq!(csv(&a), csv(&b));
    }
}

/// Would catch a resolved scene that lacks a value, or holds one in fewer digits than it was used with.
#[test]
fn a_resolved_scene_runs_to_the_same_bits() {
    let scene = Scene::from_file(scheduled(1e-3, 1e-3)).unwrap();
    let text = scene.to_toml().unwrap();
    let again = Scene::parse(&text, "scene.toml", Path::new("."), &Changes::default()).unwrap();
    let run = |scene: &Scene| csv(&hapteron::session::run_virtual(scene, &mut |_| true).unwrap());
    assert_eq!(run(&scene), run(&again));
}

/// Would catch a number that is written in fewer digits than it has, or a column that is read into another.
#[test]
fn a_recording_reads_back_to_the_same_bits() {
    let recording = record(scheduled(1e-3, 1e-3));
    let bytes = csv(&recording);
    let again = Recording::read_csv(&bytes, "run.csv").unwrap();
    assert_eq!(recording.rows, again.rows);
    assert!(Recording::read_csv(b"t,px\n0,1\n", "x.csv").unwrap_err().to_string().contains("line 1"));
    let broken = String::from_utf8(bytes).unwrap().replacen("0.001", "oops", 1);
    assert!(Recording::read_csv(broken.as_bytes(), "x.csv").unwrap_err().to_string().contains("line 2"));
}

/// Would catch a replay that does not put the handle where the recording had it.
#[test]
fn a_recorded_handle_can_be_replayed() {
    let recording = record(scheduled(1e-3, 1e-3));
    let replay = Trajectory::parse(&csv(&recording), "run.csv").unwrap();
    for row in recording.rows.iter().step_by(37) {
        let sample = replay.sample(row.time - replay.start(), 1e-3);
        assert_eq!(sample.position, row.handle.translation.vector);
        assert!(sample.orientation.angle_to(&row.handle.rotation) < 1e-12);
    }
}

/// Would catch a margin that is not asked for, and a model that is not the one named: held force must differ from planes.
#[test]
fn contact_models_differ_and_the_margin_shows_in_the_planes() {
    let with = |model, anticipation| {
        let mut file = scheduled(5e-3, 5e-3);
        file.contact.model = Some(model);
        file.contact.anticipation = Some(Anticipation::Metres(anticipation));
        record(file)
    };
    let bare = with(ContactModel::Planes, 0.0);
    let ahead = with(ContactModel::Planes, 3e-3);
    let total = |r: &Recording| r.rows.iter().map(|r| u64::from(r.clusters)).sum::<u64>();
    assert!(total(&ahead) > total(&bare), "{} {}", total(&ahead), total(&bare));
    assert_ne!(csv(&with(ContactModel::Linearized, 0.0)), csv(&with(ContactModel::Held, 0.0)));
}

/// Would catch an energy source: a body held still by its coupling in a gravity field must come to rest where the spring balances it.
#[test]
fn a_body_hangs_from_its_coupling_by_its_weight() {
    let mut file = spoon_in_free_space(0.05, Method::BackwardEuler);
    file.scene.gravity = Some([0.0, 0.0, -9.81]);
    file.coupling.grasp_position = Some([0.0; 3]);
    let folder = std::env::temp_dir().join(format!("hapteron-hang-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("still.csv");
    std::fs::write(&path, "t,px,py,pz,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n2,0,0,0,1,0,0,0\n").unwrap();
    file.hand.trajectory = Some(path.display().to_string());
    let recording = record(file);
    let last = recording.rows.last().unwrap();
    let sag = 0.05 * 9.81 / 200.0;
    assert!((last.body.translation.z + sag).abs() < 1e-6, "{}", last.body.translation.z);
    assert!(
        (last.feedback[0].z + 0.05 * 9.81).abs() < 1e-3,
        "the hand carries the weight: {}",
        last.feedback[0]
    );
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Would catch a simulated hand that does not feel the force, or gains energy from it.
#[test]
fn a_simulated_hand_yields_to_contact() {
    let replayed = record(scheduled(1e-3, 1e-3));
    let mut file = scheduled(1e-3, 1e-3);
    file.hand.mass = Some(0.1);
    file.hand.damping = Some(2.0);
    file.hand.stiffness = Some(50.0);
    let yielding = record(file);
    let (a, b) = (replayed.summary(), yielding.summary());
    assert!(b.stable && b.in_contact > 0.2, "{b:?}");
    assert!(b.greatest_force < 0.8 * a.greatest_force, "{} {}", b.greatest_force, a.greatest_force);
}

/// Would catch tremor, jitter or a guard that do not follow from the seed alone, and a resolved scene that loses one of their keys.
#[test]
fn a_closed_loop_has_the_same_bits_and_comes_back_from_its_written_scene() {
    let mut file = scheduled(1e-3, 1e-3);
    file.hand.grip = Some(hapteron::scene::file::Grip::Medium);
    file.hand.tremor = Some(1e-4);
    file.device.jitter = Some(5e-5);
    file.scene.seed = Some(7);
    let first = record(file.clone());
    assert_eq!(csv(&first), csv(&record(file.clone())));
    let text = Scene::from_file(file.clone()).unwrap().to_toml().unwrap();
    let again = Scene::parse(&text, "scene.toml", Path::new("."), &Changes::default()).unwrap();
    assert_eq!(csv(&first), csv(&hapteron::session::run_virtual(&again, &mut |_| true).unwrap()));
    file.scene.seed = Some(8);
    assert_ne!(csv(&first), csv(&record(file)));
}

/// Would catch a typing error that fills the memory: times in milliseconds where seconds were meant, or worse.
#[test]
fn a_run_without_end_is_refused() {
    let scene = Scene::from_file(spoon_in_free_space(0.01, Method::BackwardEuler)).unwrap();
    for duration in [1e7, 1e300, f64::INFINITY, f64::NAN] {
        let error = run_virtual_for(&scene, duration, &mut |_| false).unwrap_err().to_string();
        assert!(error.contains("a billion steps"), "{error}");
    }
    assert_eq!(run_virtual_for(&scene, 0.005, &mut |_| true).unwrap().rows.len(), 5);
}
