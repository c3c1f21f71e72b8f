//! Fig. 6 with the paper's error thresholds on contact levels of detail, and what each costs.

use super::figure::{Curve, Row, curve};
use anyhow::Result;
use hapteron::collision::clod::{LodWorkspace, query_levels};
use hapteron::recording::Recording;
use hapteron::scene::Scene;
use hapteron::scenes::jaws;
use std::time::Instant;

/// Thresholds as shares of the radius, with the contact rate that the paper reports; none where it reports none.
const THRESHOLDS: [(f64, Option<f64>); 3] = [(0.025, Some(500.0)), (0.01, None), (0.004, Some(100.0))];
/// Force may differ from that of exact contacts by this share, root mean square.
const SAME_FORCE: f64 = 0.05;

/// The rows and curves of the thresholds.
pub struct Thresholds {
    /// The comparison with the paper and with exact contacts.
    pub rows: Vec<Row>,
    /// One for each threshold.
    pub curves: Vec<Curve>,
}

/// Runs the jaws at each threshold; `exact` is the same run with exact contacts.
pub fn run(exact: &Curve) -> Result<Thresholds> {
    let mut result = Thresholds { rows: Vec::new(), curves: Vec::new() };
    for (threshold, paper) in THRESHOLDS {
        let mut file = jaws();
        file.contact.error_threshold = Some(threshold);
        let scene = Scene::from_file(file.clone())?;
        let label = format!("levels {} %", threshold * 100.0);
        let coarse = curve(&label, file)?;
        let off = difference(&exact.recording, &coarse.recording);
        result.rows.push(Row::new(
            &format!("{label}: force against exact contacts (beyond the paper)"),
            "(< 5 % rms)",
            format!("{:.2} % rms", off * 100.0),
            off < SAME_FORCE,
        ));
        let rate = 1.0 / mean_time(&scene, &exact.recording);
        result.rows.push(Row::new(
            &format!("{label}: contact queries a second, one core"),
            &paper.map_or_else(
                || "(more than 500)".to_owned(),
                |p| format!("{}{p:.0}", if p > 400.0 { "> " } else { "down to " }),
            ),
            format!("{rate:.0}"),
            rate > paper.unwrap_or(500.0),
        ));
        result.curves.push(coarse);
    }
    Ok(result)
}

/// Root mean square of the difference of the feedback forces over that of the first.
fn difference(exact: &Recording, other: &Recording) -> f64 {
    let pairs = || exact.rows.iter().zip(&other.rows);
    let wrong: f64 = pairs().map(|(a, b)| (a.feedback[0] - b.feedback[0]).norm_squared()).sum();
    let all: f64 = pairs().map(|(a, _)| a.feedback[0].norm_squared()).sum();
    (wrong / all).sqrt()
}

/// Seconds that a query takes along a run, on average.
fn mean_time(scene: &Scene, recording: &Recording) -> f64 {
    let mut workspace = LodWorkspace::new();
    let started = Instant::now();
    for row in &recording.rows {
        for obstacle in &scene.obstacles {
            if let (Some(body), Some(other)) = (scene.model.lod(), obstacle.model.lod()) {
                let _ = query_levels(
                    body,
                    &row.body,
                    other,
                    &obstacle.world_from_mesh,
                    scene.contact.tolerance,
                    &scene.contact.detail,
                    &mut workspace,
                );
            }
        }
    }
    started.elapsed().as_secs_f64() / recording.rows.len().max(1) as f64
}
