//! What a report needs of a run's rows, taken one by one: no more memory for a run of hours than for one of seconds.

use super::plot::{Plot, Plots, Thinned};
use hapteron::recording::{GREATEST_DEVIATION, Recording, Row, Summarizer, Summary};
use nalgebra::{Point3, Vector3};

/// Red in the list of colours of the script is the second; the magnitude is drawn dark.
const DARK: usize = 3;
/// Points of the handle's way in the picture, at the least.
const WAY: usize = 400;

/// A run in short.
pub struct Digest {
    summarizer: Summarizer,
    /// Greatest coupling angle, radians.
    pub greatest_angle: f64,
    /// Whether the run was ended before its motion was.
    pub cancelled: bool,
    /// Where it began.
    pub first: Option<Row>,
    /// The row with the greatest contact force.
    pub hardest: Option<Row>,
    /// The handle, now and then.
    pub way: Vec<Point3<f64>>,
    way_step: u64,
    times: Thinned,
    curves: Vec<Curve>,
    lateness: Thinned,
    compute: Thinned,
}

impl Digest {
    /// Of a run with so many rows.
    pub fn expecting(rows: usize) -> Self {
        Self {
            summarizer: Summarizer::default(),
            greatest_angle: 0.0,
            cancelled: false,
            first: None,
            hardest: None,
            way: Vec::new(),
            way_step: (rows / WAY).max(1) as u64,
            times: Thinned::times(rows),
            curves: curves(rows),
            lateness: Thinned::values(rows),
            compute: Thinned::values(rows),
        }
    }

    /// Of a run in memory.
    pub fn of(recording: &Recording) -> Self {
        let mut digest = Self::expecting(recording.rows.len());
        recording.rows.iter().for_each(|row| digest.push(row, [0; 2]));
        Self { greatest_angle: recording.greatest_angle, cancelled: recording.cancelled, ..digest }
    }

    /// Adds a row, with lateness and compute time of its tick in nanoseconds (for runs in real time).
    pub fn push(&mut self, row: &Row, [lateness_ns, compute_ns]: [u64; 2]) {
        if self.summarizer.rows().is_multiple_of(self.way_step) {
            let point = Point3::from(row.handle.translation.vector);
            self.way.extend(point.iter().all(|c| c.is_finite()).then_some(point));
        }
        self.summarizer.push(row);
        self.first.get_or_insert(*row);
        let force = |r: &Row| r.contact[0].norm_squared();
        let is_finite = row.body.translation.vector.iter().all(|c| c.is_finite());
        if is_finite && self.hardest.as_ref().is_none_or(|h| force(row).total_cmp(&force(h)).is_ge()) {
            self.hardest = Some(*row);
        }
        self.times.push(row.time);
        for curve in &mut self.curves {
            curve.values.push((curve.value)(row));
        }
        self.lateness.push(lateness_ns as f64 * 1e-3);
        self.compute.push(compute_ns as f64 * 1e-3);
    }

    /// What it comes to.
    pub fn summary(&self) -> Summary {
        self.summarizer.summary(self.greatest_angle)
    }

    /// When the fault came that keeps the forces away at the end, seconds.
    pub fn fault_time(&self) -> Option<f64> {
        self.summarizer.fault_time()
    }

    /// Everything over time; with the timing of the ticks for runs in real time.
    pub fn plots(self, in_real_time: bool) -> Plots {
        let mut plots = Plots::new("time [s]");
        let times = plots.thinned_times(self.times);
        let mut curves = self.curves.into_iter();
        for (title, unit, count, clip) in PLOTS {
            let mut plot = Plot::new(title, unit);
            for curve in curves.by_ref().take(count) {
                plot = plot.thinned(curve.label, times, curve.values);
                if curve.label == MAGNITUDE {
                    plot = plot.coloured(DARK);
                }
            }
            plots.add(match clip {
                Some(most) => plot.clipped(most),
                None => plot,
            });
        }
        if in_real_time {
            let late = Plot::new("Lateness of the tick", "us").thinned("lateness", times, self.lateness);
            plots.add(late.clipped(1000.0));
            let compute = Plot::new("Computing the tick", "us");
            plots.add(compute.thinned("computing", times, self.compute));
        }
        plots
    }
}

/// Title, unit, number of curves, and the greatest magnitude that is shown.
const PLOTS: [(&str, &str, usize, Option<f64>); 7] = [
    ("Feedback force to the hand", "N", 4, None),
    ("Feedback torque to the hand", "mN m", 4, None),
    ("Contact force on the body", "N", 4, None),
    ("Penetration (negative: distance, as far as d)", "mm", 1, None),
    ("Coupling deviation", "mm", 1, Some(GREATEST_DEVIATION * 1e3)),
    ("Contacts found and planes used (anticipation included)", "", 2, None),
    ("Age of the contacts", "ms", 1, None),
];
const MAGNITUDE: &str = "magnitude";

/// A series of a plot.
struct Curve {
    label: &'static str,
    value: Box<dyn Fn(&Row) -> f64>,
    values: Thinned,
}

/// Those of [`PLOTS`], in their order.
fn curves(rows: usize) -> Vec<Curve> {
    let curve =
        |label, value: Box<dyn Fn(&Row) -> f64>| Curve { label, value, values: Thinned::values(rows) };
    let vector = |scale: f64, get: fn(&Row) -> Vector3<f64>| {
        let axis = |i: usize| -> Box<dyn Fn(&Row) -> f64> { Box::new(move |r| get(r)[i] * scale) };
        [
            curve("x", axis(0)),
            curve("y", axis(1)),
            curve("z", axis(2)),
            curve(MAGNITUDE, Box::new(move |r| get(r).norm() * scale)),
        ]
    };
    let mut all = Vec::new();
    all.extend(vector(1.0, |r| r.feedback[0]));
    all.extend(vector(1e3, |r| r.feedback[1]));
    all.extend(vector(1.0, |r| r.contact[0]));
    all.push(curve("penetration", Box::new(|r| r.penetration * 1e3)));
    all.push(curve("deviation", Box::new(|r| r.deviation * 1e3)));
    all.push(curve("contacts", Box::new(|r| f64::from(r.contacts))));
    all.push(curve("planes", Box::new(|r| f64::from(r.clusters))));
    all.push(curve("age", Box::new(|r| r.contact_age * 1e3)));
    all
}
