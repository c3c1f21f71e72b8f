//! `hapteron demo`: the jaws in a simulated hand.

use super::real_time::{self, Plan};
use crate::arguments::Demo;
use crate::commands::run::{free_folder, run_into};
use crate::progress::say;
use anyhow::Result;
use hapteron::scene::Scene;
use hapteron::scenes;
use std::process::ExitCode;

/// Runs the command.
pub fn demo(arguments: &Demo) -> Result<ExitCode> {
    let time = if arguments.virtual_time {
        "in virtual time, a deterministic schedule"
    } else {
        "in real time, beside a loop that does nothing, for comparison"
    };
    say!(
        "The upper jaw (47,340 triangles) in a simulated hand is held on the lower one (40,180), at 1 kHz, {time}."
    );
    let scene = Scene::from_file(scenes::demo())?;
    let duration = arguments.duration;
    let folder = arguments.out.clone().unwrap_or_else(|| free_folder("demo"));
    if arguments.virtual_time {
        return run_into(&scene, duration, &folder);
    }
    let on_fault = arguments.on_fault;
    let plan = Plan { duration, bare: true, repeat: true, recorded_motion: false, on_fault };
    real_time::run_into(scene, &plan, &folder)
}
