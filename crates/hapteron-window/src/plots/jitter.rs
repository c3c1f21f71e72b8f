//! The histogram of how late ticks start.

use super::graph::Graph;
use super::{bare_plot, opaque};
use crate::theme::Palette;
use eframe::egui;
use egui_plot::{Bar, BarChart, GridMark, PlotBounds};
use hapteron::session::real_time::Distribution;

/// How many ticks were how late: decades of microseconds across, decades of counts up.
pub fn jitter(ui: &mut egui::Ui, lateness: &Distribution, palette: &Palette) {
    let colour = opaque(palette.body);
    let bars = decades(lateness);
    let tallest = bars.iter().map(|b| b[1]).fold(1.0, f64::max);
    bare_plot(Graph::Jitter)
        .x_axis_formatter(|mark: GridMark, _| time_text(mark.value))
        .y_axis_formatter(|mark: GridMark, _| power_text(mark.value))
        .x_grid_spacer(decade_lines)
        .y_grid_spacer(decade_lines)
        .show(ui, |plot| {
            plot.set_plot_bounds(PlotBounds::from_min_max([-2.0, 0.0], [4.3, 1.08 * tallest + 0.3]));
            let bar = |&[x, y]: &[f64; 2]| Bar::new(x, y).width(0.1).fill(colour).stroke(egui::Stroke::NONE);
            plot.bar_chart(BarChart::new("", bars.iter().map(bar).collect()));
        });
}

/// Grid lines at powers of ten; those of a thousand are the strong ones.
fn decade_lines(input: egui_plot::GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let range = low.ceil() as i64..=high.floor() as i64;
    let step = |n: i64| if n % 3 == 0 { 3.0 } else { 1.0 };
    range.map(|n| GridMark { value: n as f64, step_size: step(n) }).collect()
}

/// Tenths of decades of microseconds with the logarithm of one more than their count, so that a single tick can be seen.
fn decades(lateness: &Distribution) -> Vec<[f64; 2]> {
    let mut counts = std::collections::BTreeMap::new();
    for (ns, count) in lateness.bins() {
        let decade = ((ns.max(10) as f64 * 1e-3).log10() * 10.0).floor() as i64;
        *counts.entry(decade).or_insert(0) += count;
    }
    counts.into_iter().map(|(d, n)| [(d as f64 + 0.5) / 10.0, (n as f64 + 1.0).log10()]).collect()
}

/// A power of ten of ticks.
fn power_text(power: f64) -> String {
    match power.round() as i32 {
        n @ 0..=2 => format!("{:.0}", 10f64.powi(n)),
        n @ 3..=5 => format!("{:.0}k", 10f64.powi(n - 3)),
        n @ 6.. => format!("{:.0}M", 10f64.powi(n - 6)),
        n => format!("{}", 10f64.powi(n)),
    }
}

/// A power of ten of microseconds.
fn time_text(power: f64) -> String {
    match power.round() as i32 {
        n @ 0..=2 => format!("{:.0} µs", 10f64.powi(n)),
        n @ 3..=5 => format!("{:.0} ms", 10f64.powi(n - 3)),
        n @ 6.. => format!("{:.0} s", 10f64.powi(n - 6)),
        n => format!("{:.0} ns", 10f64.powi(n + 3)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0, 2.0, 3.0, 4.0, 6.0].map(power_text), ["1", "100", "1k", "10k", "1M"]);
        assert_eq!([-2.0, 0.0, 3.0, 6.0].map(time_text), ["10 ns", "1 µs", "1 ms", "1 s"]);
    }
}
