//! `hapteron query`: contacts between two meshes at given poses.

use crate::arguments::Query;
use crate::commands::levels;
use crate::commands::mesh::load;
use crate::progress;
use anyhow::{Context, Result, bail, ensure};
use hapteron::collision::clod::cache::default_folder;
use hapteron::collision::clod::{Detail, Hierarchy, Lod, LodWorkspace, query_levels};
use hapteron::collision::{Contact, QueryWorkspace, Surface, query as find};
use hapteron::trajectory::read_poses;
use nalgebra::Isometry3;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Runs the command.
pub fn query(arguments: &Query) -> Result<ExitCode> {
    let d = arguments.tolerance;
    ensure!(d >= 0.0 && d.is_finite(), "--tolerance is {d}; it must be finite and not negative");
    let scale = arguments.scale;
    ensure!(scale > 0.0 && scale.is_finite(), "--scale is {scale}; it must be positive and finite");
    let surface = |path: &std::path::Path| -> Result<Surface> {
        Ok(Surface::build(&load(&path.display().to_string(), scale)?))
    };
    let (body, obstacle) = (surface(&arguments.body)?, surface(&arguments.obstacle)?);
    let threshold = arguments.error_threshold;
    ensure!(
        (0.0..1.0).contains(&threshold),
        "--error-threshold is {threshold}; it is a share of A's radius, such as 0.025, and 0 is exact"
    );
    let levels = levels(&body, &obstacle, threshold)?;
    let name = arguments.poses.display().to_string();
    let bytes = std::fs::read(&arguments.poses).with_context(|| format!("cannot read the poses {name}"))?;
    let poses = read_poses(&bytes, &name)?;
    if poses.is_empty() {
        bail!("{name}: there are no poses");
    }
    let mut contacts = match &arguments.contacts {
        Some(path) => {
            let file = File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
            let mut file = BufWriter::new(file);
            writeln!(file, "pose,px,py,pz,ox,oy,oz,nx,ny,nz,depth,weight")?;
            Some(file)
        }
        None => None,
    };
    let mut out = BufWriter::new(std::io::stdout().lock());
    writeln!(out, "pose,t,min_distance,contacts")?;
    progress::catch_interrupt();
    let bar = progress::bar(poses.len() as u64, "querying");
    let mut workspace = QueryWorkspace::new();
    let mut coarse = LodWorkspace::new();
    let still = Isometry3::identity();
    let mut times = Vec::with_capacity(poses.len());
    for (index, row) in poses.iter().enumerate() {
        let started = Instant::now();
        let found = match &levels {
            None => find(&body, &row.pose, &obstacle, &still, d, &mut workspace),
            Some([of_body, of_obstacle]) => {
                let detail = Detail::threshold(threshold * of_body.radius());
                let body = Lod { surface: &body, hierarchy: of_body };
                let obstacle = Lod { surface: &obstacle, hierarchy: of_obstacle };
                query_levels(body, &row.pose, obstacle, &still, d, &detail, &mut coarse)
            }
        };
        times.push(started.elapsed());
        writeln!(out, "{index},{},{},{}", row.time, found.min_distance, found.contacts.len())?;
        if let Some(file) = &mut contacts {
            write_contacts(file, index, found.contacts)?;
        }
        bar.inc(1);
        if progress::interrupted() {
            break;
        }
    }
    bar.finish_and_clear();
    out.flush()?;
    if let Some(mut file) = contacts {
        file.flush()?;
    }
    if arguments.rate {
        print_rate(&mut times);
    }
    let stopped = progress::interrupted();
    Ok(if stopped { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The levels of both surfaces, where contacts may be coarse.
fn levels(body: &Surface, obstacle: &Surface, threshold: f64) -> Result<Option<[Hierarchy; 2]>> {
    if threshold == 0.0 {
        return Ok(None);
    }
    let folder = default_folder();
    let build = |surface| levels::build(surface, folder.as_deref(), &mut std::io::stderr());
    Ok(Some([build(body)?, build(obstacle)?]))
}

fn write_contacts(file: &mut impl Write, pose: usize, contacts: &[Contact]) -> std::io::Result<()> {
    for c in contacts {
        let (p, o, n) = (c.point_body, c.point_obstacle, c.normal);
        writeln!(
            file,
            "{pose},{},{},{},{},{},{},{},{},{},{},{}",
            p.x, p.y, p.z, o.x, o.y, o.z, n.x, n.y, n.z, c.depth, c.weight
        )?;
    }
    Ok(())
}

fn print_rate(times: &mut [Duration]) {
    times.sort_unstable();
    let milliseconds = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
    eprintln!(
        "{} queries: median {:.4} ms, fastest {:.4} ms, 95 % within {:.4} ms, slowest {:.4} ms",
        times.len(),
        milliseconds(0.5),
        milliseconds(0.0),
        milliseconds(0.95),
        milliseconds(1.0)
    );
}
