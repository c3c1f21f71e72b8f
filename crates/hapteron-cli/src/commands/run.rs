//! `hapteron run`: a scene from its start to its end, and the run folder.

use super::real_time::{self, Plan};
use crate::arguments::Run;
use crate::progress::{self, say};
use crate::report::{self, Digest, Outcome, Time};
use anyhow::{Context, Result, bail};
use hapteron::recording::{Recording, Summary};
use hapteron::scene::{Changes, Scene};
use hapteron::session::log::Log;
use hapteron::session::{ContactPass, replay, run_virtual_for};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Runs the command.
pub fn run(arguments: &Run) -> Result<ExitCode> {
    let log = arguments.replay.as_deref().filter(|path| is_log(path));
    // A log is no trajectory: it has the device's samples, the contact schedule and the commands of a session.
    let trajectory = if log.is_some() { None } else { arguments.replay.clone() };
    let changes = Changes { overrides: arguments.overrides.clone(), replay: trajectory };
    let scene = load(&arguments.scene, &changes)?;
    let duration = arguments.duration;
    let default =
        arguments.scene.file_stem().map_or_else(|| "run".into(), |s| s.to_string_lossy().into_owned());
    let folder = match &arguments.out {
        Some(folder) => folder.clone(),
        None => free_folder(&default),
    };
    if let Some(path) = log {
        if duration.is_some() {
            bail!(
                "--duration does not go with {}: a session is made again as long as it was",
                path.display()
            );
        }
        return replay_into(&scene, path, &folder);
    }
    if arguments.virtual_time && scene.file.hand.trajectory.is_none() {
        bail!(
            "in virtual time there is no real device; the scene needs [hand] trajectory, or give --replay FILE"
        );
    }
    if arguments.virtual_time {
        return run_into(&scene, duration, &folder);
    }
    let recorded_motion = arguments.replay.is_some();
    let on_fault = arguments.on_fault;
    let plan = Plan { duration, bare: false, repeat: false, recorded_motion, on_fault };
    real_time::run_into(scene, &plan, &folder)
}

/// Reads a scene, with a progress bar where contact levels have to be built.
pub fn load(path: &Path, changes: &Changes) -> Result<Scene> {
    let bar = progress::bar(1000, "contact levels");
    let scene = Scene::load_with(path, changes, &mut |share| {
        progress::catch_interrupt();
        bar.set_position((share * 1000.0) as u64);
        !progress::interrupted()
    });
    bar.finish_and_clear();
    Ok(scene?)
}
/// Whether a file is the log of a session; one that cannot be read is not, and says so later.
fn is_log(path: &Path) -> bool {
    let mut start = [0; 256];
    let read = std::fs::File::open(path).and_then(|mut f| f.read(&mut start));
    read.is_ok_and(|n| Log::is_log(&start[..n]))
}

/// `runs/NAME`, or `runs/NAME-2` and so on: a run never overwrites another unless told to.
pub fn free_folder(name: &str) -> PathBuf {
    let first = Path::new("runs").join(name);
    let numbered = (2..).map(|n| Path::new("runs").join(format!("{name}-{n}")));
    std::iter::once(first).chain(numbered).find(|p| !p.exists()).unwrap_or_else(|| Path::new("runs").into())
}

/// Runs a scene in virtual time and writes the run folder; fails when the run was not stable.
pub fn run_into(scene: &Scene, duration: Option<f64>, folder: &Path) -> Result<ExitCode> {
    let notes = begin(scene, folder)?;
    let duration = duration.unwrap_or_else(|| scene.duration());
    let started = Instant::now();
    let recording = record(scene, scene.name(), duration)?;
    let wall = started.elapsed().as_secs_f64();
    let time = Time::Virtual { wall, replayed: false };
    write_recording(&recording, folder)?;
    finish(Outcome { scene, digest: Digest::of(&recording), time }, duration, &notes, folder)
}

/// Makes the ticks of a session's log again and writes the run folder.
fn replay_into(scene: &Scene, path: &Path, folder: &Path) -> Result<ExitCode> {
    let log = Log::load(path, scene)?;
    let notes = begin(scene, folder)?;
    progress::catch_interrupt();
    let bar = progress::bar(1000, scene.name());
    let started = Instant::now();
    let recording = replay(scene, &log, &mut |share| {
        bar.set_position((share * 1000.0) as u64);
        !progress::interrupted()
    })?;
    bar.finish_and_clear();
    let wall = started.elapsed().as_secs_f64();
    let time = Time::Virtual { wall, replayed: true };
    write_recording(&recording, folder)?;
    let outcome = Outcome { scene, digest: Digest::of(&recording), time };
    finish(outcome, log.rows.last().map_or(0.0, |r| r.time), &notes, folder)
}

/// Makes the folder, and tells what a user should know of the scene.
pub fn begin(scene: &Scene, folder: &Path) -> Result<Vec<String>> {
    // Before the run, so that a folder that cannot be written is known at once.
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let notes = notes(scene);
    for note in &notes {
        say!("warning: {note}");
    }
    Ok(notes)
}

/// Writes `scene.toml` and `report.html`, and the summary on stdout. `duration` is what the run was to last.
pub fn finish(outcome: Outcome<'_>, duration: f64, notes: &[String], folder: &Path) -> Result<ExitCode> {
    let (scene, cancelled) = (outcome.scene, outcome.digest.cancelled);
    let summary = outcome.digest.summary();
    let mut text = Vec::new();
    print_summary(&mut text, &outcome, &summary)?;
    let path = folder.join("scene.toml");
    std::fs::write(&path, scene.to_toml()?).with_context(|| format!("cannot write {}", path.display()))?;
    let path = folder.join("report.html");
    let html = report::run(outcome, notes)?;
    std::fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    let mut out = std::io::stdout().lock();
    out.write_all(&text)?;
    writeln!(out, "  {}", path.display())?;
    if cancelled {
        say!("{}: stopped after {:.3} s of {duration:.3} s", scene.name(), summary.duration);
    }
    Ok(if summary.stable && !cancelled { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// What a user should know of a scene before it runs.
fn notes(scene: &Scene) -> Vec<String> {
    let depth = -ContactPass::new(scene).measure(scene, &scene.start);
    let mut notes = Vec::new();
    if depth > scene.contact.tolerance.min(1e-4) {
        notes.push(format!(
            "at the start the surfaces already cross, by {:.3} mm: the body will be pushed out, or stay wedged. Cure: another body.position or \
             body.orientation, or a motion that starts apart",
            depth * 1e3
        ));
    }
    notes
}

/// Runs a scene in virtual time with a progress bar, ended by Ctrl-C.
pub fn record(scene: &Scene, title: &str, duration: f64) -> Result<Recording> {
    progress::catch_interrupt();
    let bar = progress::bar(1000, title);
    let recording = run_virtual_for(scene, duration, &mut |share| {
        bar.set_position((share * 1000.0) as u64);
        !progress::interrupted()
    })?;
    bar.finish_and_clear();
    if recording.rows.is_empty() {
        bail!("the motion or --duration is shorter than one time step of {} s", scene.time_step);
    }
    Ok(recording)
}

fn write_recording(recording: &Recording, folder: &Path) -> Result<()> {
    let path = folder.join("run.csv");
    let file = std::fs::File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
    recording.write_csv(file).with_context(|| format!("cannot write {}", path.display()))
}

fn print_summary(out: &mut impl Write, outcome: &Outcome<'_>, summary: &Summary) -> std::io::Result<()> {
    let Outcome { scene, digest, time } = outcome;
    let state = if summary.stable { "stable" } else { "NOT STABLE" };
    writeln!(out, "{}: {:.3} s in {}, {state}", scene.name(), summary.duration, time.name())?;
    if let Some(time) = digest.fault_time() {
        writeln!(out, "  a fault took the force away at {time:.3} s, for good")?;
    }
    writeln!(
        out,
        "  feedback up to {:.3} N, {:.1} mN m; coupling deviation up to {:.3} mm",
        summary.greatest_force,
        summary.greatest_torque * 1e3,
        summary.greatest_deviation * 1e3
    )?;
    let depth = summary.greatest_penetration * 1e3;
    let penetration = if depth > 0.0 {
        format!("surfaces crossed by up to {depth:.4} mm")
    } else {
        "the surfaces never crossed".to_owned()
    };
    writeln!(
        out,
        "  in contact {:.0} % of the time, up to {} contacts on {} planes; {penetration}",
        summary.in_contact * 100.0,
        summary.most_contacts,
        summary.most_planes
    )?;
    match time {
        Time::Virtual { wall, .. } => {
            writeln!(out, "  computed in {wall:.2} s ({:.2} times real time)", summary.duration / wall)
        }
        Time::Real(live) => real_time::print_timing(out, live),
    }
}
