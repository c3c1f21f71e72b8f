//! Plots as numbers for the report's script.

use serde::Serialize;

/// Above this many points a series keeps the least and the greatest of each group of neighbours only.
const MOST_POINTS: usize = 20_000;

/// Plots one below the other, over a common axis.
#[derive(Serialize)]
pub struct Plots {
    axis: &'static str,
    times: Vec<Vec<Option<f64>>>,
    plots: Vec<Plot>,
}

/// One of them.
#[derive(Serialize)]
pub struct Plot {
    title: String,
    unit: String,
    series: Vec<Series>,
    marks: Vec<Mark>,
    clip: Option<f64>,
}

#[derive(Serialize)]
struct Series {
    label: String,
    time: usize,
    ys: Vec<Option<f64>>,
    colour: Option<usize>,
}

#[derive(Serialize)]
struct Mark {
    value: f64,
    label: String,
}

impl Plots {
    /// Without plots.
    pub fn new(axis: &'static str) -> Self {
        Self { axis, times: Vec::new(), plots: Vec::new() }
    }

    /// Adds the abscissae of some series; gives the number to name them by.
    pub fn times(&mut self, times: &[f64]) -> Times {
        let step = times.len().div_ceil(MOST_POINTS / 2).max(1);
        let kept = if step == 1 {
            times.iter().map(|&t| short(t)).collect()
        } else {
            // Two points a group, at its beginning and its middle.
            let two = times.chunks(step).flat_map(|c| [short(c[0]), short(c[c.len() / 2])]);
            two.collect()
        };
        self.times.push(kept);
        Times { index: self.times.len() - 1, step }
    }

    /// Adds a plot below the others.
    pub fn add(&mut self, plot: Plot) {
        self.plots.push(plot);
    }
}

/// Names abscissae of [`Plots`].
#[derive(Clone, Copy)]
pub struct Times {
    index: usize,
    step: usize,
}

impl Plot {
    /// Without series.
    pub fn new(title: &str, unit: &str) -> Self {
        Self {
            title: title.to_owned(),
            unit: unit.to_owned(),
            series: Vec::new(),
            marks: Vec::new(),
            clip: None,
        }
    }

    /// Adds a series; what is not finite leaves a gap.
    pub fn series(mut self, label: &str, times: Times, values: &[f64]) -> Self {
        let ys = if times.step == 1 {
            values.iter().map(|&v| short(v)).collect()
        } else {
            values.chunks(times.step).flat_map(extremes).collect()
        };
        self.series.push(Series { label: label.to_owned(), time: times.index, ys, colour: None });
        self
    }

    /// Gives the last series a colour of its own (an index of the script's list).
    pub fn coloured(mut self, colour: usize) -> Self {
        if let Some(series) = self.series.last_mut() {
            series.colour = Some(colour);
        }
        self
    }

    /// Adds a dashed level with a name.
    pub fn mark(mut self, value: f64, label: &str) -> Self {
        self.marks.push(Mark { value, label: label.to_owned() });
        self
    }

    /// Shows no more than this magnitude, so that a run that diverges leaves room for the others.
    pub fn clipped(mut self, magnitude: f64) -> Self {
        self.clip = Some(magnitude);
        self
    }
}

/// Least and greatest, in the order in which they come.
fn extremes(values: &[f64]) -> [Option<f64>; 2] {
    let mut least = 0;
    let mut most = 0;
    for (i, v) in values.iter().enumerate() {
        least = if *v < values[least] { i } else { least };
        most = if *v > values[most] { i } else { most };
    }
    [short(values[least.min(most)]), short(values[least.max(most)])]
}

/// Five significant digits: finer than any screen.
fn short(value: f64) -> Option<f64> {
    if value.is_finite() { format!("{value:.5e}").parse().ok() } else { None }
}
