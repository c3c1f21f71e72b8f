//! `hapteron reproduce`: the paper's experiments in virtual time.

mod fig2;
mod fig4;
mod fig6;
pub mod figure;
mod thresholds;

use crate::arguments::{Figure as Name, Reproduce};
use crate::commands::run::free_folder;
use crate::progress;
use crate::report;
use anyhow::{Context, Result};
use figure::{Figure, Row};
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// Runs the command.
pub fn reproduce(arguments: &Reproduce) -> Result<ExitCode> {
    let names = if arguments.figures.is_empty() {
        vec![Name::Fig2, Name::Fig4, Name::Fig6]
    } else {
        arguments.figures.clone()
    };
    let folder = arguments.out.clone().unwrap_or_else(|| free_folder("reproduce"));
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    progress::catch_interrupt();
    let mut figures = Vec::new();
    for name in names {
        let figure = match name {
            Name::Fig2 => fig2::run()?,
            Name::Fig4 => fig4::run()?,
            Name::Fig6 => fig6::run()?,
        };
        print_figure(&mut std::io::stdout().lock(), &figure)?;
        write_curves(&figure, &folder)?;
        figures.push(figure);
    }
    let rows: Vec<&Row> = figures.iter().flat_map(|f| &f.rows).collect();
    let holding = rows.iter().filter(|r| r.holds).count();
    let path = folder.join("report.html");
    std::fs::write(&path, report::reproduction(&figures))
        .with_context(|| format!("cannot write {}", path.display()))?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{holding} of {} rows hold", rows.len())?;
    writeln!(out, "{}", path.display())?;
    Ok(if holding == rows.len() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The table 'paper / measured / holds'.
fn print_figure(out: &mut impl Write, figure: &Figure) -> std::io::Result<()> {
    let width = |column: &dyn Fn(&Row) -> &str, title: &str| {
        figure.rows.iter().map(|r| column(r).chars().count()).chain([title.len()]).max().unwrap_or(0)
    };
    let what = width(&|r| &r.what, "what");
    let paper = width(&|r| &r.paper, "paper");
    let measured = width(&|r| &r.measured, "measured");
    writeln!(out, "{}", figure.title)?;
    writeln!(out, "  {:what$}  {:paper$}  {:measured$}  holds", "what", "paper", "measured")?;
    for row in &figure.rows {
        let verdict = if row.holds { "holds" } else { "does not hold" };
        writeln!(out, "  {:what$}  {:paper$}  {:measured$}  {verdict}", row.what, row.paper, row.measured)?;
    }
    writeln!(out)
}

/// One CSV per curve, in the form of `run.csv`.
fn write_curves(figure: &Figure, folder: &Path) -> Result<()> {
    let folder = folder.join(figure.name);
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    for curve in &figure.curves {
        let path = folder.join(format!("{}.csv", curve.file));
        let file =
            std::fs::File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
        curve.recording.write_csv(file).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}
