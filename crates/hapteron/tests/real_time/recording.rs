//! Sessions that are recorded while they run.

use crate::common::csv;
use crate::rig::{Trouble, Troubled, options, scene};
use hapteron::device::Pacing;
use hapteron::recording::Recording;
use hapteron::session::real_time::{RealTime, Recorder, Spool, Told};
use hapteron::session::{Command, log::Log, replay};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("hapteron-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.0.join(name)).unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Would catch a row that the disk has otherwise than memory, one that is only there at the end, a depth that is not measured, or files from which the session
/// does not come again bit for bit.
#[test]
fn what_is_streamed_is_what_was() {
    let folder = Folder::new("spool");
    let scene = scene();
    let (device, _) = Troubled::new(&scene, Pacing::Polled, Trouble::None, u64::MAX);
    let mut running = RealTime::start(Arc::clone(&scene), device, options(&scene, 0.8)).unwrap();
    running.send(Command::mass(&scene, 0.02).unwrap()).unwrap();
    let mut recorder = Recorder::new(Arc::clone(&scene));
    let mut spool = Spool::create(Arc::clone(&scene), &folder.0).unwrap();
    let mut early = None;
    while !running.is_over() {
        std::thread::sleep(Duration::from_millis(5));
        running.drain(&mut |told| match told {
            Told::Tick(tick) => {
                recorder.tick(tick);
                spool.tick(tick);
            }
            Told::Pass(pass) => {
                recorder.pass(pass);
                spool.pass(pass);
            }
        });
        if early.is_none() && running.timing().ticks > 400 {
            let so_far = folder.read("run.csv");
            early = (so_far.len() > 50_000).then_some(so_far);
        }
    }
    let finished = running.stop();
    finished.records.iter().for_each(|r| recorder.tick(r));
    finished.passes.iter().for_each(|p| recorder.pass(p));
    let spooled = spool.finish(&finished.records, &finished.passes);
    let recorded = recorder.finish(&mut |_| true);
    assert!(spooled.trouble().is_none() && spooled.is_complete());
    assert_eq!(spooled.rows() as usize, recorded.recording.rows.len());
    assert_eq!(spooled.greatest_angle(), recorded.recording.greatest_angle);
    let (mut rows, mut timing) = (Vec::new(), Vec::new());
    spooled
        .settle(&mut |_| true, &mut |row, of_tick| {
            rows.push(*row);
            timing.push((of_tick[0], of_tick[1]));
        })
        .unwrap();
    assert!(rows == recorded.recording.rows, "what was told of the rows is not what was");
    assert_eq!(timing, recorded.timing);
    assert!(folder.read("run.csv") == csv(&recorded.recording), "run.csv is not what was");
    let mut log = Vec::new();
    recorded.log.write_csv(&mut log).unwrap();
    assert!(folder.read("device.csv") == log, "device.csv is not what was");
    let mut files: Vec<_> = std::fs::read_dir(&folder.0).unwrap().map(|f| f.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["device.csv", "run.csv"]);
    let again = replay(&scene, &Log::load(folder.0.join("device.csv"), &scene).unwrap(), &mut |_| true);
    assert!(csv(&again.unwrap()) == folder.read("run.csv"), "made again it is different");
    // What was there in the middle of it, cut off anywhere, reads as the beginning of the run; only depths may not have been known.
    let early = early.expect("nothing was written while it ran");
    let cut = Recording::read_csv(&early[..early.len() - 100], "run.csv").unwrap();
    assert!(cut.rows.len() > 50);
    assert!(cut.rows.iter().zip(&rows).all(|(a, b)| a.time == b.time && a.feedback == b.feedback));
    assert!(cut.rows.iter().all(|r| r.penetration.is_finite()));
}

/// Would catch a session that starts although nothing can be recorded, or an error that does not name the file.
#[test]
fn a_folder_that_is_not_there_is_told_before_the_start() {
    let error = Spool::create(scene(), &std::env::temp_dir().join("hapteron-is-not-there")).err().unwrap();
    assert!(error.to_string().contains("hapteron-is-not-there/run.csv"), "{error}");
}
