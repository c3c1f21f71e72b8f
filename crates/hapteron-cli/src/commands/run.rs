//! `hapteron run`: a scene from its start to its end, and the run folder.

use crate::arguments::Run;
use crate::progress;
use crate::report;
use anyhow::{Context, Result, bail};
use hapteron::recording::{Recording, Summary};
use hapteron::scene::{Changes, Scene};
use hapteron::session::{ContactPass, run_virtual};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Runs the command.
pub fn run(arguments: &Run) -> Result<ExitCode> {
    let changes = Changes { overrides: arguments.overrides.clone(), replay: arguments.replay.clone() };
    let scene = Scene::load(&arguments.scene, &changes)?;
    if !arguments.virtual_time {
        eprintln!("note: real devices are not supported yet; running in virtual time");
    }
    let default =
        arguments.scene.file_stem().map_or_else(|| "run".into(), |s| s.to_string_lossy().into_owned());
    let folder = match &arguments.out {
        Some(folder) => folder.clone(),
        None => free_folder(&default),
    };
    run_into(&scene, &folder)
}

/// `runs/NAME`, or `runs/NAME-2` and so on: a run never overwrites another unless told to.
pub fn free_folder(name: &str) -> PathBuf {
    let first = Path::new("runs").join(name);
    let numbered = (2..).map(|n| Path::new("runs").join(format!("{name}-{n}")));
    std::iter::once(first).chain(numbered).find(|p| !p.exists()).unwrap_or_else(|| Path::new("runs").into())
}

/// Runs a scene and writes the run folder; fails when the run was not stable.
pub fn run_into(scene: &Scene, folder: &Path) -> Result<ExitCode> {
    // Before the run, so that a folder that cannot be written is known at once.
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let notes = notes(scene);
    for note in &notes {
        eprintln!("warning: {note}");
    }
    let started = Instant::now();
    let recording = record(scene, scene.name())?;
    let wall = started.elapsed().as_secs_f64();
    write_folder(scene, &recording, wall, &notes, folder)?;
    let summary = recording.summary();
    let mut out = std::io::stdout().lock();
    print_summary(&mut out, scene, &recording, &summary, wall)?;
    writeln!(out, "  {}", folder.join("report.html").display())?;
    if recording.cancelled {
        eprintln!("stopped by Ctrl-C after {:.3} s of {:.3} s", summary.duration, scene.duration());
    }
    Ok(if summary.stable && !recording.cancelled { ExitCode::SUCCESS } else { ExitCode::FAILURE })
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

/// Runs a scene with a progress bar, ended by Ctrl-C.
pub fn record(scene: &Scene, title: &str) -> Result<Recording> {
    progress::catch_interrupt();
    let bar = progress::bar(1000, title);
    let recording = run_virtual(scene, &mut |share| {
        bar.set_position((share * 1000.0) as u64);
        !progress::interrupted()
    })?;
    bar.finish_and_clear();
    if recording.rows.is_empty() {
        bail!("the motion is shorter than one time step of {} s", scene.time_step);
    }
    Ok(recording)
}

/// Writes `run.csv`, `scene.toml` and `report.html`.
fn write_folder(
    scene: &Scene,
    recording: &Recording,
    wall: f64,
    notes: &[String],
    folder: &Path,
) -> Result<()> {
    let path = folder.join("run.csv");
    let file = std::fs::File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
    recording.write_csv(file).with_context(|| format!("cannot write {}", path.display()))?;
    let path = folder.join("scene.toml");
    std::fs::write(&path, scene.to_toml()?).with_context(|| format!("cannot write {}", path.display()))?;
    let path = folder.join("report.html");
    let html = report::run(scene, recording, wall, notes)?;
    std::fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(())
}

fn print_summary(
    out: &mut impl Write,
    scene: &Scene,
    recording: &Recording,
    summary: &Summary,
    wall: f64,
) -> std::io::Result<()> {
    let state = if summary.stable { "stable" } else { "NOT STABLE" };
    writeln!(out, "{}: {:.3} s in virtual time, {state}", scene.name(), summary.duration)?;
    if let Some(time) = recording.fault_time {
        writeln!(out, "  a fault stopped the force at {time:.3} s")?;
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
    writeln!(out, "  computed in {wall:.2} s ({:.2} times real time)", summary.duration / wall)
}
