//! The `hapteron` command.
//!
//! Results go to stdout or files, messages to stderr. Exit code 0: done; 1: it failed, or a run was not stable, or an experiment's row
//! does not hold; 2: wrong usage.

mod arguments;
mod commands;
mod progress;
mod render;
mod report;

use arguments::{Arguments, Command};
use clap::Parser;
use progress::say;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = match arguments.command {
        Command::Demo(a) => commands::demo::demo(&a),
        Command::Run(a) => commands::run::run(&a),
        Command::Reproduce(a) => commands::reproduce::reproduce(&a),
        Command::Query(a) => commands::query::query(&a),
        Command::Mesh(a) => commands::mesh::mesh(&a),
        Command::Compare(a) => commands::compare::compare(&a),
        Command::Bench(a) => commands::bench::bench(&a),
        Command::Devices(a) => commands::devices::devices(&a),
        Command::Stability(a) => commands::stability::stability(&a),
        Command::Models(a) => commands::models::models(&a),
        Command::Live(a) => commands::live::live(&a),
    };
    match outcome {
        Ok(code) => code,
        Err(error) if closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            say!("error: {}", message(&error));
            ExitCode::FAILURE
        }
    }
}

/// The error with its causes, each said once: many of our errors quote their cause themselves.
fn message(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// Whoever read our output has enough of it: no failure (`hapteron query ... | head`).
fn closed_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|e| e.downcast_ref::<std::io::Error>())
        .any(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}
