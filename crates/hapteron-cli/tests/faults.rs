//! What a user is told when the force is taken away, or cannot be delivered.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, hapteron, hapteron_command, stderr, stdout};
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::process::Stdio;

fn timing(folder: &Folder) -> Value {
    serde_json::from_str(&folder.read("r/timing.json")).unwrap()
}

/// Would catch a run that goes on for minutes at zero force and says nothing, or says it and calls it a success.
#[test]
fn a_fault_of_the_guard_is_told_and_ends_the_run_as_a_failure() {
    let folder = Folder::new("fault-end");
    hapteron(&folder, &["models", "m"]);
    let run = ["run", "m/spoon_in_cup.toml", "--out", "r", "--set", "hand.grip=medium"];
    let output = hapteron(&folder, &[&run[..], &["--set", "guard.max_speed=0.001"]].concat());
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    for words in ["no force since", "guard.max_speed", "--on-fault wait", "error: there was no force from"] {
        assert!(message.contains(words), "no '{words}' in {message}");
    }
    assert!(stdout(&output).contains("to the end: the guard took it away"), "{}", stdout(&output));
    let faults = timing(&folder)["faults"].clone();
    assert_eq!(faults.as_array().map(Vec::len), Some(1), "{faults}");
    assert!(faults[0]["rearmed"].is_null() && faults[0]["reason"].as_str().unwrap().contains("max_speed"));
    assert!(folder.read("r/report.html").contains("no force from, s"));
}

/// Would catch an Enter that does nothing, or a force that comes back without one.
#[test]
fn enter_gives_the_force_back() {
    let folder = Folder::new("fault-wait");
    hapteron(&folder, &["models", "m"]);
    let run = ["run", "m/spoon_in_cup.toml", "--out", "r", "--set", "hand.grip=medium"];
    let rest = ["--set", "guard.max_speed=0.001", "--on-fault", "wait", "--duration", "3"];
    let mut child = hapteron_command(&folder, &[&run[..], &rest[..]].concat())
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let (mut losses, mut returns) = (0, 0);
    for line in BufReader::new(child.stderr.take().unwrap()).lines() {
        let line = line.unwrap();
        returns += u32::from(line.starts_with("force again since"));
        if line.starts_with("no force since") {
            assert_eq!(losses, returns, "it came back without an Enter");
            losses += 1;
            if losses == 1 {
                input.write_all(b"\n").unwrap();
            }
        }
    }
    assert!(!child.wait().unwrap().success());
    let timing = timing(&folder);
    assert!(losses >= 1 && returns == 1, "lost {losses} times, came back {returns} times");
    assert!(timing["faults"][0]["rearmed"].as_f64() > timing["faults"][0]["time"].as_f64(), "{timing}");
    // It waited for its time to be over.
    assert_eq!(timing["end"], "the time was over");
}

/// Would catch a torque that vanishes without a word on a device that senses six axes and drives three, or one that is told where it is displayed.
#[test]
fn a_torque_that_a_device_cannot_drive_is_told() {
    let folder = Folder::new("torque");
    hapteron(&folder, &["models", "m"]);
    for (model, drives_torque) in [("touch", false), ("premium-1.5-6dof", true)] {
        let model = format!("device.model={model}");
        let run = ["run", "m/spoon_in_cup.toml", "--out", "r", "--set", "hand.grip=medium", "--set", &model];
        let output = hapteron(&folder, &run);
        let left_out = timing(&folder)["undelivered"].clone();
        assert_eq!(left_out["greatest_force"], 0.0);
        assert_eq!(left_out["greatest_torque"].as_f64().unwrap() > 1e-4, !drives_torque, "{left_out}");
        assert_eq!(left_out["ticks"].as_u64().unwrap() > 100, !drives_torque, "{left_out}");
        assert_eq!(stdout(&output).contains("no motors for some"), !drives_torque, "{}", stdout(&output));
    }
}
