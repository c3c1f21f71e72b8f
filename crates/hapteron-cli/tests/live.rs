//! The window as a person uses it: the real program under Xvfb, driven by xdotool. Skipped, with a message, where these are missing.
#![cfg(all(feature = "window", target_os = "linux"))]
#![allow(clippy::unwrap_used, reason = "a test, in several files")]

#[path = "live/desk.rs"]
mod desk;
#[path = "live/picture.rs"]
mod picture;

use desk::Desk;
use hapteron::recording::Recording;
use picture::Picture;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Without a display there is a reason and a cure, not a panic.
#[test]
fn without_a_display_it_says_so_and_what_to_do() {
    for display in [None, Some(":987")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hapteron"));
        command.arg("live");
        for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            command.env_remove(name);
        }
        if let Some(display) = display {
            command.env("DISPLAY", display);
        }
        let output = command.output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.starts_with("error: ") && text.contains("hapteron demo"), "{text}");
        assert!(!text.contains("panicked"), "{text}");
    }
}

/// Rows of the newest `run.csv` that the window has saved.
fn saved(desk: &Desk, name: &str) -> Recording {
    let path = desk.folder().join("runs").join(name).join("run.csv");
    Recording::load(&path).unwrap()
}

fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/live").join(name)
}

/// The main way through the window, from the start page to the end.
#[test]
fn a_person_drags_the_jaws_together_changes_mass_and_method_records_and_replays() {
    let Some(mut desk) = Desk::open() else { return };
    desk.must_resemble(&reference("start.png"));

    desk.click("jaws");
    desk.wait_for("view");
    desk.pause(1.5);
    let open = desk.must_resemble(&reference("open.png"));

    // The upper jaw into the lower one, and there it is held.
    let before = desk.place("body");
    desk.drag_body(0, 60);
    desk.pause(1.0);
    let closed = desk.must_resemble(&reference("closed.png"));
    let view = desk.area("view");
    assert!(open.difference_within(&closed, view) > 0.004, "nothing moves in the 3D view");
    let after = desk.place("body");
    assert!(after.1 > before.1 + 5, "the body does not follow the pointer: {before:?} {after:?}");
    // The hand stays where it is when the pointer lets go.
    desk.let_go();
    desk.click("csv");
    desk.wait_for_file("runs/live-jaws/run.csv");
    let pressed = saved(&desk, "live-jaws");
    let last = pressed.rows.last().unwrap();
    assert!(last.contacts > 0, "no contact");
    assert!(last.contact[0].norm() > 0.5 && last.feedback[0].norm() > 0.5, "no force: {last:?}");
    assert!(pressed.rows[0].contact[0].norm() == 0.0, "force before anything touches");

    // Mass and method, as they are typed and chosen, and as the recording tells.
    desk.type_into("mass", "200");
    desk.click("method");
    desk.wait_for("Backward Euler, Newton");
    desk.click("Backward Euler, Newton");
    desk.click("record");
    desk.drag_body(0, 25);
    desk.let_go();
    desk.click("record");
    desk.wait_for_file("runs/live-jaws-2/scene.toml");
    let scene = std::fs::read_to_string(desk.folder().join("runs/live-jaws-2/scene.toml")).unwrap();
    assert!(scene.contains("mass = 0.2"), "{scene}");
    assert!(scene.contains("method = \"backward-euler-newton\""), "{scene}");
    let recorded = saved(&desk, "live-jaws-2");
    let moved = |r: &Recording| {
        let heights = r.rows.iter().map(|row| row.handle.translation.z);
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
        high - low
    };
    assert!(moved(&recorded) > 1e-3, "the recorded hand stands still");

    // The same hand again: a new session whose handle goes where the recorded one went.
    desk.click("replay");
    desk.wait_for_end("replaying");
    desk.click("csv");
    desk.wait_for_file("runs/live-jaws-3/run.csv");
    let replayed = saved(&desk, "live-jaws-3");
    assert!(replayed.rows[0].time < 0.1, "not a new session");
    let same = (moved(&replayed) / moved(&recorded) - 1.0).abs();
    assert!(
        same < 0.02,
        "the replayed hand moves by {} m, the recorded one by {} m",
        moved(&replayed),
        moved(&recorded)
    );

    // Esc stops; the end is an end.
    desk.key("Escape");
    desk.wait_for("start again");
    desk.click("scenes");
    desk.wait_for("spoon_in_cup");
    desk.close();
}

/// Would catch a start page that opens no files, or forgets them.
#[test]
fn a_scene_file_opens_and_is_remembered() {
    let Some(mut desk) = Desk::open() else { return };
    let scene = desk.folder().join("mine.toml");
    std::fs::write(&scene, "[scene]\nname = \"mine\"\n[body]\nmesh = \"builtin:spoon\"\n").unwrap();
    desk.type_into("path", "mine.toml");
    desk.wait_for("view");
    desk.click("scenes");
    desk.wait_for("open");
    let list = std::fs::read_to_string(desk.folder().join("config/hapteron/recent.toml")).unwrap();
    assert!(list.contains("mine.toml"), "{list}");
    desk.close();
}

/// The saved pictures are pictures: used by the tests above, so they must be able to fail.
#[test]
fn pictures_that_differ_do_not_resemble_each_other() {
    let grey = Picture::plain(64, 40, [90, 90, 90]);
    let bright = Picture::plain(64, 40, [130, 130, 130]);
    assert!(grey.resembles(&grey).is_ok());
    assert!(grey.resembles(&bright).is_err());
    assert!(grey.difference_within(&bright, [0, 0, 64, 40]) > 0.1);
}
