//! `hapteron mesh --build`: the contact levels of detail of a mesh, in a table and in pictures.

use crate::arguments::Mesh;
use crate::commands::run::free_folder;
use crate::progress;
use crate::report;
use anyhow::{Context, Result};
use hapteron::collision::Surface;
use hapteron::collision::clod::cache::{Origin, default_folder, load_or_build};
use hapteron::collision::clod::{Defect, DefectKind, Hierarchy};
use std::io::Write;
use std::time::Instant;

/// Builds or loads the hierarchy, prints its levels, and writes the report.
pub fn levels(arguments: &Mesh, surface: &Surface, out: &mut impl Write) -> Result<()> {
    for defect in Hierarchy::defects(surface) {
        writeln!(out, "{}", describe(&defect))?;
    }
    let started = Instant::now();
    let hierarchy = build(surface, arguments.cache.clone().or_else(default_folder).as_deref(), out)?;
    let seconds = started.elapsed().as_secs_f64();
    let bytes = hierarchy.memory_bytes();
    let each = bytes as f64 / surface.triangle_count().max(1) as f64;
    writeln!(out, "in {seconds:.3} s, {:.2} MB ({each:.0} bytes a triangle)", bytes as f64 / 1e6)?;
    writeln!(
        out,
        "{:>5} {:>9} {:>10} {:>14} {:>13} {:>10}",
        "level", "patches", "triangles", "resolution 1/m", "deviation mm", "margin mm"
    )?;
    for l in hierarchy.levels() {
        let resolution = if l.edge > 0.0 { format!("{:.1}", 1.0 / l.edge) } else { "full".to_owned() };
        writeln!(
            out,
            "{:>5} {:>9} {:>10} {:>14} {:>13.4} {:>10.4}",
            l.level,
            l.patches,
            l.triangles,
            resolution,
            l.deviation * 1e3,
            l.margin * 1e3
        )?;
    }
    writeln!(out, "and {} mere hulls up to the root", hierarchy.pure_hulls())?;
    let folder = arguments.out.clone().unwrap_or_else(|| free_folder("mesh"));
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let path = folder.join("report.html");
    let html = report::levels(&arguments.file, &hierarchy)?;
    std::fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    writeln!(out, "{}", path.display())?;
    Ok(())
}

/// Builds or loads a hierarchy with a progress bar, and tells where it came from.
pub fn build(surface: &Surface, folder: Option<&std::path::Path>, out: &mut impl Write) -> Result<Hierarchy> {
    progress::catch_interrupt();
    let bar = progress::bar(1000, "contact levels");
    let (hierarchy, origin) = load_or_build(surface, folder, &mut |share| {
        bar.set_position((share * 1000.0) as u64);
        !progress::interrupted()
    })?;
    bar.finish_and_clear();
    let text = match origin {
        Origin::Cached(path) => format!("loaded from {}", path.display()),
        Origin::Built(path) => format!("built, and kept in {}", path.display()),
        Origin::Rebuilt(path, why) => {
            format!("built anew and kept in {}, which was not used: {why}", path.display())
        }
        Origin::NotCached(why) => format!("built, but not kept: {why}"),
    };
    writeln!(out, "contact levels     {text}")?;
    Ok(hierarchy)
}

fn describe(defect: &Defect) -> String {
    let [x, y, z] = defect.place;
    let (what, then) = match defect.kind {
        DefectKind::Rim => ("edges with one face", "the surface is open; its rim is simplified along itself"),
        DefectKind::NonManifoldEdge => (
            "edges with more than two faces or two of opposite orientation",
            "kept as they are at all levels",
        ),
        DefectKind::NonManifoldVertex => {
            ("vertices where the surface touches itself", "kept as they are at all levels")
        }
    };
    format!("note: {} {what} (the first at [{x:.6}, {y:.6}, {z:.6}]): {then}", defect.count)
}
