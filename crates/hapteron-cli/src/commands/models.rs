//! `hapteron models`: the built-in meshes and scenes as files.

use crate::arguments::Models;
use anyhow::{Context, Result};
use hapteron::{assets, scenes};
use std::io::Write;
use std::process::ExitCode;

/// Runs the command.
pub fn models(arguments: &Models) -> Result<ExitCode> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let mut out = std::io::stdout().lock();
    for name in assets::BUILTIN_NAMES {
        let mesh = assets::builtin(name)?;
        let path = folder.join(format!("{name}.obj"));
        let write = || -> std::io::Result<()> {
            assets::write_obj(&mesh, name, std::io::BufWriter::new(std::fs::File::create(&path)?))
        };
        write().with_context(|| format!("cannot write {}", path.display()))?;
        writeln!(out, "{}  {} triangles", path.display(), mesh.triangles().len())?;
    }
    for name in scenes::NAMES {
        let Some(scene) = scenes::builtin(name) else { continue };
        let path = folder.join(format!("{name}.toml"));
        let text = format!("# hapteron run {} --virtual-time\n{}", path.display(), scene.to_toml()?);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        writeln!(out, "{}", path.display())?;
    }
    Ok(ExitCode::SUCCESS)
}
