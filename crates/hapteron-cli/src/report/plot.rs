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
        let mut thinned = Thinned::times(times.len());
        times.iter().for_each(|&t| thinned.push(t));
        self.thinned_times(thinned)
    }

    /// The same of values that were thinned as they came.
    pub fn thinned_times(&mut self, times: Thinned) -> Times {
        let step = times.step;
        self.times.push(times.finish());
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
    pub fn series(self, label: &str, times: Times, values: &[f64]) -> Self {
        let mut thinned = Thinned { step: times.step, ..Thinned::values(0) };
        values.iter().for_each(|&v| thinned.push(v));
        self.thinned(label, times, thinned)
    }

    /// The same of values that were thinned as they came, as many as `times`.
    pub fn thinned(mut self, label: &str, times: Times, values: Thinned) -> Self {
        let ys = values.finish();
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

/// Values of a series as they come: where there are too many, two of each group of neighbours are kept.
pub struct Thinned {
    step: usize,
    group: Vec<f64>,
    pick: fn(&[f64]) -> [f64; 2],
    kept: Vec<Option<f64>>,
}

impl Thinned {
    /// So many ordinates; the least and the greatest of a group are kept.
    pub fn values(count: usize) -> Self {
        Self::new(count, extremes)
    }

    /// So many abscissae; the first and the middle of a group are kept.
    pub fn times(count: usize) -> Self {
        Self::new(count, |group| [group[0], group[group.len() / 2]])
    }

    fn new(count: usize, pick: fn(&[f64]) -> [f64; 2]) -> Self {
        Self { step: count.div_ceil(MOST_POINTS / 2).max(1), group: Vec::new(), pick, kept: Vec::new() }
    }

    /// Adds one.
    pub fn push(&mut self, value: f64) {
        if self.step == 1 {
            self.kept.push(short(value));
            return;
        }
        self.group.push(value);
        if self.group.len() == self.step {
            self.close();
        }
    }

    fn close(&mut self) {
        if !self.group.is_empty() {
            self.kept.extend((self.pick)(&self.group).map(short));
            self.group.clear();
        }
    }

    fn finish(mut self) -> Vec<Option<f64>> {
        self.close();
        self.kept
    }
}

/// Least and greatest, in the order in which they come.
fn extremes(values: &[f64]) -> [f64; 2] {
    let mut least = 0;
    let mut most = 0;
    for (i, v) in values.iter().enumerate() {
        least = if *v < values[least] { i } else { least };
        most = if *v > values[most] { i } else { most };
    }
    [values[least.min(most)], values[least.max(most)]]
}

/// Five significant digits: finer than any screen.
fn short(value: f64) -> Option<f64> {
    if value.is_finite() { format!("{value:.5e}").parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a peak that is lost where a long run is thinned, a plot with more points than a browser bears, or a point that stands at another time.
    #[test]
    fn a_long_series_keeps_its_peaks_in_few_points() {
        for count in [1usize, 19_999, 20_000, 20_001, 123_457, 3_600_001] {
            let mut plots = Plots::new("time [s]");
            let mut times = Thinned::times(count);
            let mut values = Thinned::values(count);
            let peak = count * 2 / 3;
            for i in 0..count {
                times.push(i as f64);
                values.push(if i == peak { -7.0 } else { 0.25 });
            }
            let times = plots.thinned_times(times);
            let plot = Plot::new("", "").thinned("", times, values);
            let (xs, ys) = (&plots.times[0], &plot.series[0].ys);
            assert!(xs.len() == ys.len() && ys.len() <= MOST_POINTS + 2, "{count}: {} points", ys.len());
            let at: Vec<f64> = (0..ys.len()).filter(|&i| ys[i] == Some(-7.0)).filter_map(|i| xs[i]).collect();
            assert!(!at.is_empty(), "{count}: the peak is gone");
            assert!(
                at.iter().all(|x| (x - peak as f64).abs() <= times.step as f64 + 20.0),
                "{count}: {at:?}"
            );
        }
    }
}
