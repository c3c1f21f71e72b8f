//! What several tests need.
#![allow(dead_code, reason = "not every test file uses every helper")]

use hapteron::recording::Recording;
use hapteron::scene::{Scene, SceneFile};
use hapteron::session::run_virtual;

/// Runs a scene to its end.
pub fn record(file: SceneFile) -> Recording {
    let scene = Scene::from_file(file).unwrap();
    run_virtual(&scene, &mut |_| true).unwrap()
}

/// The recording as `run.csv`.
pub fn csv(recording: &Recording) -> Vec<u8> {
    let mut bytes = Vec::new();
    recording.write_csv(&mut bytes).unwrap();
    bytes
}
