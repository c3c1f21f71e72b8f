//! Building a hierarchy: decompose, simplify and merge, measure, freeze.

mod collapse;
mod convex;
mod decompose;
mod freeze;
mod measure;
mod merge;
mod portions;
mod quadric;
mod samples;
mod simplify;
mod tree;
mod work;

use super::{Defect, DefectKind, Hierarchy};
use crate::surface::{EdgeKind, Surface};
use work::{Work, faces_around, is_one_fan};

/// Told the share that is done (0 to 1); answering `false` stops the work.
pub type Progress<'a> = dyn FnMut(f64) -> bool + 'a;

/// A hierarchy that was not built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The progress callback asked for it.
    #[error("building the contact hierarchy was cancelled")]
    Cancelled,
}

fn tell(progress: &mut Progress<'_>, share: f64) -> Result<(), BuildError> {
    if progress(share) { Ok(()) } else { Err(BuildError::Cancelled) }
}

pub(super) fn hierarchy(surface: &Surface, progress: &mut Progress<'_>) -> Result<Hierarchy, BuildError> {
    let slack = convex::CONVEX_SLACK * surface.radius;
    let decomposition = decompose::decompose(surface, progress)?;
    tell(progress, 0.1)?;
    let (_, radius) = measure::sphere(surface.vertices.iter().copied());
    let work = Work::new(surface, decomposition, slack);
    let levels = simplify::levels(surface, radius, work, progress)?;
    tell(progress, 0.7)?;
    let tree = tree::tree(surface, &levels);
    let frozen = freeze::freeze(surface, radius, &levels, &tree, progress)?;
    tell(progress, 1.0)?;
    Ok(frozen)
}

pub(super) fn defects(surface: &Surface) -> Vec<Defect> {
    let mut found: Vec<Defect> = Vec::new();
    let mut note = |kind: DefectKind, place: [f64; 3]| match found.iter_mut().find(|d| d.kind == kind) {
        Some(known) => known.count += 1,
        None => found.push(Defect { kind, count: 1, place }),
    };
    for edge in &surface.edges {
        let place = surface.vertices[edge.vertices[0] as usize];
        match edge.kind {
            EdgeKind::Boundary => note(DefectKind::Rim, place),
            EdgeKind::Unoriented => note(DefectKind::NonManifoldEdge, place),
            EdgeKind::Convex | EdgeKind::Hollow => {}
        }
    }
    let at_edge: Vec<bool> = surface.edges.iter().filter(|e| e.kind == EdgeKind::Unoriented).fold(
        vec![false; surface.vertices.len()],
        |mut marks, e| {
            e.vertices.iter().for_each(|&v| marks[v as usize] = true);
            marks
        },
    );
    for (v, around) in faces_around(surface).iter().enumerate() {
        if !at_edge[v] && !is_one_fan(v as u32, around, &surface.triangles) {
            note(DefectKind::NonManifoldVertex, surface.vertices[v]);
        }
    }
    found
}
