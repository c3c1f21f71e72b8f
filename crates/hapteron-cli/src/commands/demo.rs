//! `hapteron demo`: the jaws in a simulated hand, in virtual time.

use crate::arguments::Demo;
use crate::commands::run::{free_folder, run_into};
use anyhow::Result;
use hapteron::scene::Scene;
use hapteron::scene::file::Hand;
use hapteron::scenes;
use std::process::ExitCode;

/// Runs the command.
pub fn demo(arguments: &Demo) -> Result<ExitCode> {
    eprintln!(
        "The upper jaw (47,340 triangles) in a simulated hand chews on the lower one (40,180), at 1 kHz.\n\
         note: real devices are not supported yet; this runs in virtual time, a deterministic schedule"
    );
    let mut file = scenes::jaws();
    // A light grip: it feels the force and yields to it.
    file.hand = Hand { mass: Some(0.1), damping: Some(6.0), stiffness: Some(400.0), ..file.hand };
    let folder = arguments.out.clone().unwrap_or_else(|| free_folder("demo"));
    run_into(&Scene::from_file(file)?, &folder)
}
