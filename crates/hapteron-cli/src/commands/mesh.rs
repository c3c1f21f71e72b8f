//! `hapteron mesh`: what a mesh is like, and what is wrong with it.

use crate::arguments::Mesh;
use crate::commands::levels::levels;
use anyhow::{Result, ensure};
use hapteron::assets;
use hapteron::collision::Surface;
use hapteron::collision::mesh::{self, TriMesh};
use std::io::Write;
use std::process::ExitCode;

/// Runs the command.
pub fn mesh(arguments: &Mesh) -> Result<ExitCode> {
    ensure!(
        arguments.scale > 0.0 && arguments.scale.is_finite(),
        "--scale is {}; it must be positive and finite",
        arguments.scale
    );
    let mesh = load(&arguments.file, arguments.scale)?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", arguments.file)?;
    writeln!(out, "{}", mesh::check(&mesh))?;
    match mesh::mass_properties(&mesh) {
        Ok(m) => {
            let c = m.center_of_mass;
            writeln!(out, "as a uniform solid:")?;
            writeln!(out, "  volume           {:.6e} m^3 ({:.3} cm^3)", m.volume, m.volume * 1e6)?;
            writeln!(out, "  center of mass   [{:.6}, {:.6}, {:.6}] m", c.x, c.y, c.z)?;
            writeln!(out, "  inertia per kg   (m^2, about the center of mass)")?;
            for row in m.inertia_per_mass.row_iter() {
                writeln!(out, "    [{:>13.6e}, {:>13.6e}, {:>13.6e}]", row[0], row[1], row[2])?;
            }
        }
        Err(error) => writeln!(out, "no mass properties: {error}")?,
    }
    let surface = Surface::build(&mesh);
    let bytes = surface.memory_bytes();
    let each = bytes as f64 / surface.triangle_count().max(1) as f64;
    writeln!(out, "query structure    {:.2} MB ({each:.0} bytes a triangle)", bytes as f64 / 1e6)?;
    if arguments.build {
        levels(arguments, &surface, &mut out)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A mesh from a file or `builtin:NAME`, scaled.
pub fn load(name: &str, scale: f64) -> Result<TriMesh> {
    let mesh = match name.strip_prefix("builtin:") {
        Some(builtin) => assets::builtin(builtin)?,
        None => mesh::load(name)?,
    };
    Ok(if scale == 1.0 { mesh } else { mesh.scaled(scale)? })
}
