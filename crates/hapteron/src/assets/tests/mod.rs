//! What the built-in models promise.

mod intersections;
mod measures;

use std::collections::BTreeSet;

use hapteron_collision::mesh::{Format, mass_properties, parse};

use super::*;
use measures::{Measures, digest};

fn model(name: &str) -> TriMesh {
    builtin(name).unwrap_or_else(|error| panic!("{error}"))
}

/// Counts, closedness, orientation and genus of one model, and its bounding sphere about the middle of its box.
fn assert_sound(name: &str, triangles: usize, euler: i64, radius: std::ops::Range<f64>) -> Measures {
    let mesh = model(name);
    let measures = Measures::of(&mesh);
    assert_eq!(mesh.triangles().len(), triangles, "{name}");
    assert_eq!(
        measures.unmatched_edges, 0,
        "{name}: an edge is open, shared by more than two, or badly oriented"
    );
    assert_eq!(measures.euler_characteristic, euler, "{name}");
    assert!(measures.volume > 0.0, "{name} is inside out");
    assert!(radius.contains(&measures.radius), "{name}: radius {} m", measures.radius);
    let found = intersections::intersecting_pairs(&mesh);
    assert!(found.is_empty(), "{name}: {} intersecting pairs, first {:?}", found.len(), found.first());
    measures
}
