//! What an experiment yields: rows to compare, curves to show.

use crate::progress;
use anyhow::{Result, bail};
use hapteron::recording::{GREATEST_ANGLE, GREATEST_DEVIATION, Recording};
use hapteron::scene::{Scene, SceneFile};
use hapteron::session::{VirtualTime, run_virtual};

/// A number of the paper with ours.
#[derive(Clone, Debug)]
pub struct Row {
    /// What is compared.
    pub what: String,
    /// As the paper has it.
    pub paper: String,
    /// As it is here.
    pub measured: String,
    /// Whether they agree.
    pub holds: bool,
}

impl Row {
    /// A row.
    pub fn new(what: &str, paper: &str, measured: String, holds: bool) -> Self {
        Self { what: what.to_owned(), paper: paper.to_owned(), measured, holds }
    }
}

/// A run to be shown.
#[derive(Clone, Debug)]
pub struct Curve {
    /// For people.
    pub label: String,
    /// File name without extension.
    pub file: String,
    /// The run.
    pub recording: Recording,
}

/// A quantity that is plotted over time.
#[derive(Clone, Copy)]
pub struct Quantity {
    /// For people.
    pub title: &'static str,
    /// After scaling.
    pub unit: &'static str,
    /// Not shown beyond this magnitude.
    pub clip: f64,
    /// A level with a name.
    pub mark: Option<(f64, &'static str)>,
    /// From a tick.
    pub value: fn(&hapteron::recording::Row) -> f64,
}

/// An experiment's results.
#[derive(Clone)]
pub struct Figure {
    /// As on the command line.
    pub name: &'static str,
    /// For people.
    pub title: &'static str,
    /// What was done, with the values that the paper leaves out.
    pub setting: &'static str,
    /// The comparison.
    pub rows: Vec<Row>,
    /// The runs shown.
    pub curves: Vec<Curve>,
    /// What is plotted of them.
    pub shown: &'static [Quantity],
    /// Groups of plots: a title and the labels of the curves in it.
    pub panels: Vec<(String, Vec<String>)>,
}

/// Runs a scene to its end.
pub fn record(file: SceneFile) -> Result<Recording> {
    let scene = Scene::from_file(file)?;
    let recording = run_virtual(&scene, &mut |_| !progress::interrupted())?;
    if recording.cancelled {
        bail!("stopped by Ctrl-C");
    }
    Ok(recording)
}

/// A run as a curve.
pub fn curve(label: &str, file: SceneFile) -> Result<Curve> {
    let name: String = label
        .to_lowercase()
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' })
        .collect();
    Ok(Curve { label: label.to_owned(), file: name.replace("--", "-"), recording: record(file)? })
}

/// Whether a scene runs to its end without fault, large deviation or large angle; stops at the first sign that it does not.
pub fn is_stable(file: SceneFile) -> Result<bool> {
    let scene = Scene::from_file(file)?;
    let mut session = VirtualTime::new(&scene)?;
    let ticks = (scene.duration() / scene.time_step).round() as u64;
    for _ in 0..ticks {
        let tick = session.advance();
        let lost = tick.flags.no_force()
            || tick.step.deviation >= GREATEST_DEVIATION
            || tick.step.angle >= GREATEST_ANGLE;
        if lost {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Greatest of a quantity over a run, from a time on.
pub fn greatest(recording: &Recording, value: impl Fn(&hapteron::recording::Row) -> f64) -> f64 {
    recording.rows.iter().map(value).fold(f64::NEG_INFINITY, f64::max)
}
