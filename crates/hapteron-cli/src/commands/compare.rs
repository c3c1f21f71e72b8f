//! `hapteron compare`: two runs side by side.

use crate::arguments::Compare;
use crate::commands::run::free_folder;
use crate::report::{self, Compared};
use anyhow::{Context, Result};
use hapteron::recording::{Recording, Row, Summary};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Runs the command.
pub fn compare(arguments: &Compare) -> Result<ExitCode> {
    let [first, second] = [&arguments.first, &arguments.second].map(|path| table_of(path));
    let runs = [Recording::load(&first)?, Recording::load(&second)?];
    let names = names(&first, &second);
    let table = table(&runs);
    print(&mut std::io::stdout().lock(), &names, &table)?;
    let folder = arguments.out.clone().unwrap_or_else(|| free_folder("compare"));
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let path = folder.join("report.html");
    let html = report::comparison([&names[0], &names[1]], [&runs[0], &runs[1]], &table);
    std::fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    writeln!(std::io::stdout(), "{}", path.display())?;
    Ok(ExitCode::SUCCESS)
}

/// A run folder stands for its `run.csv`.
fn table_of(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("run.csv") } else { path.to_owned() }
}

/// The folders' names, or the whole paths when those are the same.
fn names(first: &Path, second: &Path) -> [String; 2] {
    let short = |path: &Path| {
        let file = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let parent = path.parent().and_then(Path::file_name).map(|n| n.to_string_lossy().into_owned());
        if file == "run.csv" { parent.unwrap_or(file) } else { file }
    };
    let names = [short(first), short(second)];
    if names[0] == names[1] { [first, second].map(|p| p.display().to_string()) } else { names }
}

fn table(runs: &[Recording; 2]) -> Vec<Compared> {
    let summaries = [runs[0].summary(), runs[1].summary()];
    let number = |what, unit: &str, scale: f64, value: &dyn Fn(&Summary) -> f64| {
        let [a, b] = summaries.each_ref().map(|s| value(s) * scale);
        let show = |v: f64| format!("{v:.4} {unit}").trim_end().to_owned();
        Compared {
            what,
            values: [show(a), show(b)],
            difference: format!("{:+.4} {unit}", b - a).trim_end().to_owned(),
        }
    };
    let yes = |b: bool| (if b { "yes" } else { "no" }).to_owned();
    let stable = summaries.each_ref().map(|s| s.stable);
    vec![
        Compared {
            what: "stable",
            values: stable.map(yes),
            difference: (if stable[0] == stable[1] { "" } else { "differs" }).to_owned(),
        },
        number("duration", "s", 1.0, &|s| s.duration),
        number("greatest feedback force", "N", 1.0, &|s| s.greatest_force),
        number("greatest feedback torque", "mN m", 1e3, &|s| s.greatest_torque),
        number("greatest penetration", "mm", 1e3, &|s| s.greatest_penetration),
        number("greatest coupling deviation", "mm", 1e3, &|s| s.greatest_deviation),
        number("time in contact", "%", 100.0, &|s| s.in_contact),
        number("most planes", "", 1.0, &|s| f64::from(s.most_planes)),
        number("greatest age of contacts", "ms", 1e3, &|s| s.greatest_contact_age),
        number("rms force step a tick", "mN", 1e3, &|s| s.force_roughness),
        difference(runs, "rms difference of feedback force", "N", &|r| r.feedback[0]),
        difference(runs, "rms difference of body position", "mm", &|r| r.body.translation.vector * 1e3),
    ]
}

/// Rows of the same time: a run in real time lacks the ticks that were missed.
fn pairs(runs: &[Recording; 2]) -> impl Iterator<Item = (&Row, &Row)> {
    let half_step = runs[0].rows.windows(2).map(|w| w[1].time - w[0].time).fold(1e-3, f64::min) / 2.0;
    let mut second = runs[1].rows.iter().peekable();
    runs[0].rows.iter().filter_map(move |a| {
        while second.next_if(|b| b.time < a.time - half_step).is_some() {}
        second.peek().filter(|b| b.time <= a.time + half_step).map(|b| (a, *b))
    })
}

/// Over the ticks that both runs have.
fn difference(
    runs: &[Recording; 2],
    what: &'static str,
    unit: &str,
    value: &dyn Fn(&Row) -> nalgebra::Vector3<f64>,
) -> Compared {
    let sum: f64 = pairs(runs).map(|(a, b)| (value(a) - value(b)).norm_squared()).sum();
    let rms = (sum / pairs(runs).count().max(1) as f64).sqrt();
    Compared { what, values: [String::new(), String::new()], difference: format!("{rms:.4} {unit}") }
}

fn print(out: &mut impl Write, names: &[String; 2], table: &[Compared]) -> std::io::Result<()> {
    let width = |texts: &mut dyn Iterator<Item = usize>| texts.max().unwrap_or(0);
    let what = width(&mut table.iter().map(|c| c.what.len()));
    let column = |i: usize| {
        width(&mut table.iter().map(|c| c.values[i].chars().count()).chain([names[i].chars().count()]))
    };
    let (a, b) = (column(0), column(1));
    writeln!(out, "{:what$}  {:>a$}  {:>b$}  difference", "", names[0], names[1])?;
    for row in table {
        writeln!(
            out,
            "{:what$}  {:>a$}  {:>b$}  {}",
            row.what, row.values[0], row.values[1], row.difference
        )?;
    }
    Ok(())
}
