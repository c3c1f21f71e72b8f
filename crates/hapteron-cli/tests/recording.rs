//! What is left of a run in real time that ends otherwise than it was to.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, fails, hapteron, hapteron_command, stderr};
use hapteron::recording::Recording;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A run that lasts a minute, once it has so many bytes on the disk.
fn begun(folder: &Folder, bytes: u64) -> Child {
    hapteron(folder, &["models", "m"]);
    let run = ["run", "m/spoon_in_cup.toml", "--out", "r", "--set", "hand.grip=medium", "--duration", "60"];
    let child = hapteron_command(folder, &run).stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let started = Instant::now();
    while std::fs::metadata(folder.path().join("r/run.csv")).map_or(0, |m| m.len()) < bytes {
        std::thread::sleep(Duration::from_millis(5));
        assert!(started.elapsed() < Duration::from_secs(60), "nothing is written while it runs");
    }
    child
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// Would catch a Ctrl-C that leaves no whole run folder, or one from which the run does not come again.
#[test]
fn ctrl_c_leaves_a_whole_run_folder() {
    let folder = Folder::new("ctrl-c");
    let child = begun(&folder, 300_000);
    signal(&child, "-INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("stopped after"), "{}", stderr(&output));
    let rows = Recording::load(folder.path().join("r/run.csv")).unwrap().rows.len();
    assert!(rows > 200, "{rows} rows");
    let timing: serde_json::Value = serde_json::from_str(&folder.read("r/timing.json")).unwrap();
    assert_eq!(timing["ticks"].as_u64(), Some(rows as u64));
    assert_eq!((timing["records_lost"].as_u64(), timing["recording_trouble"].is_null()), (Some(0), true));
    assert!(folder.read("r/report.html").trim_end().ends_with("</html>"));
    hapteron(&folder, &["run", "r/scene.toml", "--replay", "r/device.csv", "--out", "again"]);
    assert!(folder.read("again/run.csv") == folder.read("r/run.csv"), "made again it is different");
}

/// Would catch a run that ends in a panic, its files as they were, because nobody reads its messages any more (a terminal that was closed, a `tee` that Ctrl-C
/// ended first), one that a key that repeats kills before its device is stopped, and one that Ctrl-Z stops with a force on the hand.
#[test]
fn a_closed_terminal_and_hasty_keys_leave_a_whole_run_folder() {
    let folder = Folder::new("closed");
    let mut child = begun(&folder, 300_000);
    if cfg!(target_os = "linux") {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
        let ignored = status.lines().find_map(|l| l.strip_prefix("SigIgn:")).unwrap().trim();
        // SIGTSTP is 20, counted from 1.
        assert_eq!(u64::from_str_radix(ignored, 16).unwrap() >> 19 & 1, 1, "Ctrl-Z would stop it: {ignored}");
    }
    drop((child.stderr.take(), child.stdout.take()));
    let id = child.id();
    let twice = format!("kill -HUP {id}; kill -INT {id}");
    assert!(Command::new("sh").args(["-c", &twice]).status().unwrap().success());
    let code = child.wait().unwrap().code();
    // That nobody can be told the summary is what is wrong, or that the run was not over: no panic, no kill.
    assert!(code == Some(0) || code == Some(1), "{code:?}");
    let rows = Recording::load(folder.path().join("r/run.csv")).unwrap().rows.len();
    let timing: serde_json::Value = serde_json::from_str(&folder.read("r/timing.json")).unwrap();
    assert_eq!(timing["ticks"].as_u64(), Some(rows as u64));
    assert!(folder.read("r/report.html").trim_end().ends_with("</html>"));
    assert!(!folder.path().join("r/run.part").exists());
}

/// Would catch rows that are in the memory of the process when it dies.
#[test]
fn a_process_that_is_killed_leaves_what_was() {
    let folder = Folder::new("killed");
    let child = begun(&folder, 300_000);
    signal(&child, "-KILL");
    assert!(!child.wait_with_output().unwrap().status.success());
    let rows = Recording::load(folder.path().join("r/run.csv")).unwrap().rows.len();
    assert!(rows > 200, "{rows} rows");
    let log = folder.read("r/device.csv");
    assert!(log.lines().count() > 200, "{} lines", log.lines().count());
}

/// Would catch a full disk that takes the force out of the hand, is not told at once and in the end, or is called a success.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_and_the_session_goes_on() {
    let folder = Folder::new("full-disk");
    hapteron(&folder, &["models", "m"]);
    std::fs::create_dir(folder.path().join("r")).unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("r/device.csv")).unwrap();
    let run = ["run", "m/spoon_in_cup.toml", "--out", "r", "--set", "hand.grip=medium", "--duration", "0.5"];
    let output = hapteron(&folder, &run);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for words in [
        "cannot write r/device.csv: No space left",
        "the session goes on",
        "error: cannot write r/device.csv",
    ] {
        assert!(text.contains(words), "no '{words}' in {text}");
    }
    let timing: serde_json::Value = serde_json::from_str(&folder.read("r/timing.json")).unwrap();
    let (ticks, missed) = (timing["ticks"].as_u64().unwrap(), timing["missed_deadlines"].as_u64().unwrap());
    assert!((450..=500).contains(&(ticks + missed)), "{ticks} ticks, {missed} missed: it did not go on");
    assert!(timing["records_lost"].as_u64() >= Some(ticks), "{timing}");
    assert!(folder.read("r/report.html").contains("nothing is recorded"));
}

/// Would catch a session that starts, motors on, where nothing can be written.
#[test]
fn a_folder_that_cannot_be_written_is_told_before_the_start() {
    let folder = Folder::new("no-folder");
    hapteron(&folder, &["models", "m"]);
    folder.file("r", "a file, not a folder");
    let run = ["run", "m/spoon_in_cup.toml", "--out", "r", "--set", "hand.grip=medium"];
    fails(&folder, 1, &run, &["cannot make the folder r"]);
    std::fs::create_dir_all(folder.path().join("s/run.csv")).unwrap();
    let run = ["run", "m/spoon_in_cup.toml", "--out", "s", "--set", "hand.grip=medium"];
    fails(&folder, 1, &run, &["cannot write s/run.csv"]);
}
