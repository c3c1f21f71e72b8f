//! `hapteron demo`: the built-in scene, in virtual time.

use crate::arguments::Demo;
use anyhow::Result;
use std::process::ExitCode;

/// Runs the command.
pub fn demo(_arguments: &Demo) -> Result<ExitCode> {
    anyhow::bail!("later")
}
