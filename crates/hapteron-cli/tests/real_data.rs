//! The real scenes and pairs beside the project, when they are there.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, hapteron, real_data, stderr, stdout};
use hapteron::recording::Recording;

/// Would catch a scene of real parts under a recorded hand that is thrown, stops early, or holds a number that is not finite.
///
/// The nut on the bolt takes minutes without optimisation of everything; its first second tells as much.
fn runs_to_its_end_and_is_stable(name: &str) {
    let Some(data) = real_data() else { return };
    let folder = Folder::new(name);
    let scene = data.join(format!("scenes/{name}.toml")).display().to_string();
    let output = hapteron(&folder, &["run", &scene, "--virtual-time", "--out", "r"]);
    assert!(output.status.success(), "{name}: {} {}", stdout(&output), stderr(&output));
    let recording = Recording::read_csv(folder.read("r/run.csv").as_bytes(), name).unwrap();
    assert_eq!(recording.rows.len(), 6666, "{name}");
    assert!(recording.rows.iter().any(|r| r.contact[0].norm() > 0.1), "{name} never touched");
}

#[test]
fn a_spoon_in_a_mug() {
    runs_to_its_end_and_is_stable("spoon_mug");
}

#[test]
fn rows_of_teeth() {
    runs_to_its_end_and_is_stable("tooth_rows");
}

#[test]
fn a_peg_in_a_hole() {
    runs_to_its_end_and_is_stable("peg_hole");
}
