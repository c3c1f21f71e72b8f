//! `hapteron stability`: where in the plane of two scene keys a simulated hand can hold the object.

mod axis;
mod chart;
mod judge;

pub use axis::Axis;
pub use judge::{Outcome, Verdict};

use crate::arguments::Stability;
use crate::commands::run::{free_folder, load};
use crate::progress::{self, say};
use crate::report;
use anyhow::{Context, Result, bail};
use hapteron::scene::{Changes, Scene};
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// What is set in the scene when neither it nor the command line says who holds the handle.
const USUAL_GRIP: &str = "hand.grip=medium";

/// A finished map.
pub struct Map {
    /// Columns and rows.
    pub axes: [Axis; 2],
    /// Row by row, from the first value of y.
    pub cells: Vec<Outcome>,
}

impl Map {
    /// At column x and row y.
    pub fn at(&self, x: usize, y: usize) -> &Outcome {
        &self.cells[y * self.axes[0].values.len() + x]
    }
}

/// Runs the command.
pub fn stability(arguments: &Stability) -> Result<ExitCode> {
    let axes = [Axis::parse(&arguments.x)?, Axis::parse(&arguments.y)?];
    if axes[0].key == axes[1].key {
        bail!("both axes are `{}`; a map needs two keys", axes[0].key);
    }
    let default = arguments.scene.file_stem().map_or("scene".into(), |s| s.to_string_lossy());
    let folder = arguments.out.clone().unwrap_or_else(|| free_folder(&format!("stability-{default}")));
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let common = common_overrides(arguments, &axes)?;
    let cells = run_cells(arguments, &axes, &common)?;
    let map = Map { axes, cells };
    write_folder(&map, arguments, &common, &folder)?;
    let mut out = std::io::stdout().lock();
    print_map(&mut out, &map)?;
    writeln!(out, "  {}", folder.join("report.html").display())?;
    Ok(ExitCode::SUCCESS)
}

/// The overrides of every cell: those of the command line, and a hand where no one holds the handle.
fn common_overrides(arguments: &Stability, axes: &[Axis; 2]) -> Result<Vec<String>> {
    let mut common = arguments.overrides.clone();
    let hand = |text: &str| {
        let key = text.split('=').next().unwrap_or_default().trim();
        ["hand.grip", "hand.mass", "hand.damping", "hand.stiffness"].contains(&key)
    };
    if axes.iter().any(|a| hand(&a.key)) || common.iter().any(|o| hand(o)) {
        return Ok(common);
    }
    // The cells find the contact levels in the cache then, where there are any.
    let scene = load(&arguments.scene, &Changes { overrides: common.clone(), replay: None })?;
    if scene.hand.is_none() {
        say!("note: the scene has no hand; it is held with a medium grip ({USUAL_GRIP})");
        common.push(USUAL_GRIP.to_owned());
    }
    Ok(common)
}

/// All cells, on all cores; a fault of one scene ends it.
fn run_cells(arguments: &Stability, axes: &[Axis; 2], common: &[String]) -> Result<Vec<Outcome>> {
    progress::catch_interrupt();
    let [columns, rows] = [axes[0].values.len(), axes[1].values.len()];
    let bar = progress::bar((columns * rows) as u64, "stability");
    let cells: Result<Vec<Outcome>> = (0..columns * rows)
        .into_par_iter()
        .map(|i| {
            if progress::interrupted() {
                bail!("stopped by Ctrl-C");
            }
            let set = |axis: &Axis, value: usize| format!("{}={}", axis.key, axis.values[value]);
            let mut overrides = common.to_vec();
            overrides.extend([set(&axes[0], i % columns), set(&axes[1], i / columns)]);
            let changes = Changes { overrides, replay: None };
            let scene = Scene::load_with(&arguments.scene, &changes, &mut |_| !progress::interrupted())?;
            let outcome = judge::judge(&scene)?;
            bar.inc(1);
            Ok(outcome)
        })
        .collect();
    bar.finish_and_clear();
    cells
}

/// Writes `map.csv`, `map.png` and `report.html`.
fn write_folder(map: &Map, arguments: &Stability, common: &[String], folder: &Path) -> Result<()> {
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
    };
    let mut csv = format!(
        "{},{},verdict,fault_time,swing,greatest_force,greatest_deviation\n",
        map.axes[0].key, map.axes[1].key
    );
    for (y, row) in map.axes[1].values.iter().enumerate() {
        for (x, column) in map.axes[0].values.iter().enumerate() {
            let c = map.at(x, y);
            let time = c.fault_time.map_or_else(String::new, |t| t.to_string());
            csv += &format!(
                "{column},{row},{},{time},{},{},{}\n",
                c.verdict.name(),
                c.swing,
                c.greatest_force,
                c.greatest_deviation
            );
        }
    }
    write("map.csv", csv.as_bytes())?;
    let png = chart::draw(map)?;
    write("map.png", &png)?;
    let scene = std::fs::read_to_string(&arguments.scene).unwrap_or_default();
    let html = report::stability(map, &arguments.scene.display().to_string(), common, png, &scene);
    write("report.html", html.as_bytes())
}

/// The map in letters: the largest y at the top.
fn print_map(out: &mut impl Write, map: &Map) -> std::io::Result<()> {
    let [x, y] = &map.axes;
    let width = y.values.iter().map(String::len).max().unwrap_or(0);
    writeln!(out, "{} upward, {} to the right; . stable, h hums, o oscillates, X lost", y.key, x.key)?;
    for row in (0..y.values.len()).rev() {
        let cells: String = (0..x.values.len())
            .map(|column| match map.at(column, row).verdict {
                Verdict::Stable => " .",
                Verdict::Hums => " h",
                Verdict::Oscillates => " o",
                Verdict::Lost => " X",
            })
            .collect();
        writeln!(out, "  {:>width$} {cells}", y.values[row])?;
    }
    let (first, last) = (x.values.first(), x.values.last());
    let stable = map.cells.iter().filter(|c| c.verdict == Verdict::Stable).count();
    writeln!(
        out,
        "  {} from {} to {}; {stable} of {} stable",
        x.key,
        first.map_or("", |s| s),
        last.map_or("", |s| s),
        map.cells.len()
    )
}
