//! Plots of the last seconds, live or paused, with a cursor that shows an instant again.

mod graph;
mod jitter;

use crate::live::history::{History, thinned};
use crate::theme::{Palette, screen};
use crate::view::Colour;
use crate::widgets::Widgets;
use eframe::egui;
use egui::{Color32, RichText, vec2};
use egui_plot::{GridMark, Line, Plot, PlotBounds, VLine};
use graph::{Graph, Series};
use hapteron::recording::Row;
use hapteron::session::real_time::{Distribution, Timing};
use jitter::jitter;
use std::collections::VecDeque;

/// Curves are thinned to so many columns: more than a plot has points across.
const COLUMNS: usize = 300;
/// Between two looks at the rate of contact passes, seconds.
const RATE_STEP: f64 = 0.25;
/// Choices of how much is shown at once, seconds.
const WINDOWS: [f64; 5] = [1.0, 3.0, 10.0, 30.0, 120.0];

/// What is shown, and which time.
pub struct Plots {
    /// In their order.
    pub shown: Vec<Graph>,
    /// How much is shown at once, seconds.
    window: f64,
    /// The end of what is shown while paused.
    paused: Option<f64>,
    /// The instant that is shown again.
    cursor: Option<f64>,
    /// Contact passes a second over time.
    rates: VecDeque<[f64; 2]>,
    counted: (f64, u64),
}

impl Plots {
    /// The most asked-for ones, of the last ten seconds.
    #[must_use]
    pub fn new() -> Self {
        Self {
            shown: vec![Graph::Force, Graph::Deviation, Graph::Penetration, Graph::Jitter],
            window: 10.0,
            paused: None,
            cursor: None,
            rates: VecDeque::new(),
            counted: (0.0, 0),
        }
    }

    /// Forgets times, of a session that is over.
    pub fn restart(&mut self) {
        (self.paused, self.cursor, self.counted) = (None, None, (0.0, 0));
        self.rates.clear();
    }

    /// The instant that is to be shown instead of now.
    #[must_use]
    pub fn cursor(&self) -> Option<f64> {
        self.cursor
    }

    /// Stops at an instant, or goes on.
    pub fn toggle_pause(&mut self, history: &History) {
        self.paused = match self.paused {
            None => history.span().map(|[_, to]| to),
            Some(_) => None,
        };
        self.cursor = self.paused;
    }

    /// Counts contact passes.
    pub fn count(&mut self, time: f64, timing: &Timing) {
        let (before, passes) = self.counted;
        if time - before >= RATE_STEP {
            if before > 0.0 {
                let rate = timing.passes.saturating_sub(passes) as f64 / (time - before);
                self.rates.push_back([time, rate]);
                if self.rates.len() > 2_000 {
                    self.rates.pop_front();
                }
            }
            self.counted = (time, timing.passes);
        }
    }

    /// The row of choices above the plots.
    pub fn header(&mut self, ui: &mut egui::Ui, widgets: &mut Widgets, history: &History) {
        ui.horizontal(|ui| {
            let text = if self.paused.is_some() { "Go live" } else { "Pause" };
            let hint = "Stops the plots, not the scene (P). Then drag in a plot, or the slider, to see an instant again.";
            if widgets.add(ui, "pause", egui::Button::new(text)).on_hover_text(hint).clicked() {
                self.toggle_pause(history);
            }
            egui::ComboBox::from_id_salt("window").width(64.0).selected_text(format!("{} s", self.window)).show_ui(
                ui,
                |ui| {
                    for seconds in WINDOWS {
                        ui.selectable_value(&mut self.window, seconds, format!("{seconds} s"));
                    }
                },
            );
            ui.separator();
            for graph in Graph::ALL {
                let on = self.shown.contains(&graph);
                let label = egui::Button::selectable(on, graph.title().0);
                if widgets.add(ui, graph.title().0, label).on_hover_text(graph.hint()).clicked() {
                    if on {
                        self.shown.retain(|g| *g != graph);
                    } else {
                        self.shown.push(graph);
                        self.shown.sort_by_key(|g| Graph::ALL.iter().position(|a| a == g));
                    }
                }
            }
        });
        if let (Some(_), Some([from, to])) = (self.paused, history.span()) {
            ui.horizontal(|ui| {
                let mut at = self.cursor.unwrap_or(to);
                ui.spacing_mut().slider_width = (ui.available_width() - 150.0).max(80.0);
                let slider = egui::Slider::new(&mut at, from..=to).suffix(" s").fixed_decimals(3);
                if widgets.add(ui, "instant", slider).changed() {
                    self.look_at(at);
                }
            });
        }
    }

    /// Moves the cursor, and what is shown so that it is in it.
    fn look_at(&mut self, time: f64) {
        self.cursor = Some(time);
        let end = self.paused.unwrap_or(time);
        let end = end.max(time).min(time + self.window);
        self.paused = Some(end);
    }

    /// The plots, side by side.
    pub fn show(&mut self, ui: &mut egui::Ui, history: &History, timing: &Timing) {
        let count = self.shown.len();
        if count == 0 {
            ui.centered_and_justified(|ui| ui.weak("Choose above what is plotted."));
            return;
        }
        let end = self.paused.or(history.span().map(|[_, to]| to)).unwrap_or(0.0);
        let range = [end - self.window, end];
        let spacing = ui.spacing().item_spacing.x;
        let width = ((ui.available_width() - spacing * (count as f32 - 1.0)) / count as f32).max(40.0);
        let height = ui.available_height();
        let shown = self.shown.clone();
        ui.horizontal(|ui| {
            for graph in shown {
                ui.allocate_ui(vec2(width, height), |ui| {
                    ui.set_min_size(vec2(width, height));
                    ui.vertical(|ui| self.graph(ui, graph, history, timing, range));
                });
            }
        });
    }

    fn graph(
        &mut self,
        ui: &mut egui::Ui,
        graph: Graph,
        history: &History,
        timing: &Timing,
        range: [f64; 2],
    ) {
        let palette = Palette::of(ui);
        let at = self.cursor.and_then(|t| history.at(t)).or(history.newest());
        title(ui, graph, at, palette, self.rates.back(), &timing.lateness);
        if graph == Graph::Jitter {
            jitter(ui, &timing.lateness, palette);
            return;
        }
        let curves: Vec<(Vec<[f64; 2]>, &str, Color32)> = if graph == Graph::Rate {
            let points = self.rates.iter().filter(|p| p[0] >= range[0] && p[0] <= range[1]);
            vec![(points.copied().collect(), "", screen(palette.body))]
        } else {
            let curve = |s: &Series| {
                let points = thinned(history.between(range[0], range[1]), range, COLUMNS, s.value);
                (points, s.name, opaque((s.colour)(palette)))
            };
            graph.series().iter().map(curve).collect()
        };
        let [low, high] = span(curves.iter().flat_map(|c| &c.0), graph);
        let cursor = self.cursor;
        let response = bare_plot(graph).show(ui, |plot| {
            plot.set_plot_bounds(PlotBounds::from_min_max([range[0], low], [range[1], high]));
            for (points, name, colour) in curves {
                plot.line(Line::new(name, points).color(colour).width(1.4));
            }
            if let Some(time) = cursor {
                plot.vline(VLine::new("", time).color(screen(palette.text)).width(1.0));
            }
        });
        let pointed = response.response.is_pointer_button_down_on();
        if let Some(place) = response.response.interact_pointer_pos().filter(|_| pointed) {
            let time = response.transform.value_from_position(place).x;
            if let Some([from, to]) = history.span() {
                self.paused.get_or_insert(range[1]);
                self.look_at(time.clamp(from, to));
            }
        }
    }
}

impl Default for Plots {
    fn default() -> Self {
        Self::new()
    }
}

fn opaque([r, g, b, _]: Colour) -> Color32 {
    Color32::from_rgb(r, g, b)
}

/// A plot that is neither dragged nor zoomed: the time is chosen for all of them.
fn bare_plot(graph: Graph) -> Plot<'static> {
    Plot::new(("plot", graph.title().0))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_double_click_reset(false)
        .show_x(false)
        .show_y(false)
        .set_margin_fraction(vec2(0.0, 0.0))
        .y_axis_min_width(34.0)
        .x_axis_formatter(|mark: GridMark, _| format!("{} s", short(mark.value)))
        .y_axis_formatter(|mark: GridMark, _| short(mark.value))
        .x_grid_spacer(|input| marks(input.bounds))
        .y_grid_spacer(|input| marks(input.bounds))
}

/// Grid lines at round steps, few enough that their numbers have room, and at least two however great a peak is.
fn marks((low, high): (f64, f64)) -> Vec<GridMark> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return Vec::new();
    }
    let ten = 10.0_f64.powf((span / 4.0).log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].map(|n| n * ten).into_iter().find(|s| span / s <= 4.0).unwrap_or(10.0 * ten);
    let range = (low / step).ceil() as i64..=(high / step).floor() as i64;
    range.map(|n| GridMark { value: n as f64 * step, step_size: step }).collect()
}

/// A number with no more digits than it needs.
fn short(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// From the least to the greatest value, with a margin, and no narrower than the graph's least span.
fn span<'a>(points: impl Iterator<Item = &'a [f64; 2]>, graph: Graph) -> [f64; 2] {
    let mut low = 0.0_f64;
    let mut high = 0.0_f64;
    for [_, y] in points {
        low = low.min(*y);
        high = high.max(*y);
    }
    let missing = graph.least_span() - (high - low);
    if missing > 0.0 {
        high += missing;
    }
    let margin = 0.06 * (high - low);
    [if low < 0.0 { low - margin } else { low - 0.3 * margin }, high + margin]
}

/// Name, unit, and the values at the cursor or now.
fn title(
    ui: &mut egui::Ui,
    graph: Graph,
    row: Option<&Row>,
    palette: &Palette,
    rate: Option<&[f64; 2]>,
    lateness: &Distribution,
) {
    let (name, unit) = graph.title();
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        ui.label(RichText::new(name).strong()).on_hover_text(graph.hint());
        match graph {
            Graph::Jitter => {
                let micro = |share: f64| lateness.quantile_ns(share) as f64 * 1e-3;
                if lateness.count > 0 {
                    let text = format!("p50 {:.0}  p99 {:.0} µs late", micro(0.5), micro(0.99));
                    ui.label(RichText::new(text).small());
                }
            }
            Graph::Rate => {
                let text = rate.map_or_else(|| "–".to_owned(), |r| format!("{:.0}", r[1]));
                ui.label(RichText::new(format!("{text} {unit}")).color(screen(palette.body)));
            }
            _ => {
                for series in graph.series() {
                    let text = row.map_or_else(|| "–".to_owned(), |r| reading((series.value)(r), graph));
                    let text = format!("{} {text}", series.name);
                    ui.label(
                        RichText::new(text.trim_start()).color(opaque((series.colour)(palette))).small(),
                    );
                }
                ui.label(RichText::new(unit).small());
            }
        }
    });
}

/// A value with the digits that its graph can vouch for.
fn reading(value: f64, graph: Graph) -> String {
    match graph {
        Graph::Contacts => format!("{value:.0}"),
        Graph::Torque | Graph::Age => format!("{value:.1}"),
        Graph::Penetration => format!("{value:.3}"),
        _ => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::history::KEPT;
    use crate::live::history::tests::row;

    /// Would catch a paused plot that loses the cursor, or runs on.
    #[test]
    fn a_paused_plot_stands_and_follows_its_cursor() {
        let mut history = History::keeping(KEPT);
        for i in 0..60_000u64 {
            history.push(i, row(i as f64 * 1e-3, 0.0));
        }
        let mut plots = Plots::new();
        assert_eq!(plots.cursor(), None);
        plots.toggle_pause(&history);
        assert!((plots.cursor().unwrap() - 59.999).abs() < 1e-9);
        plots.look_at(20.0);
        let end = plots.paused.unwrap();
        assert!(end - plots.window <= 20.0 && 20.0 <= end, "{end}");
        plots.toggle_pause(&history);
        assert_eq!((plots.cursor(), plots.paused), (None, None));
    }

    /// Would catch an axis that makes noise look like a force, or cuts off a peak.
    #[test]
    fn axes_hold_all_values_and_do_not_magnify_noise() {
        let [low, high] = span([[0.0, 1e-4], [1.0, 2e-4]].iter(), Graph::Force);
        assert!(low <= 0.0 && high >= 0.5);
        let [low, high] = span([[0.0, -0.4], [1.0, 3.0]].iter(), Graph::Penetration);
        assert!(low < -0.4 && high > 3.0);
    }

    /// Would catch an axis that loses its numbers when a peak widens it, or is full of them.
    #[test]
    fn every_axis_has_a_few_round_marks() {
        for exponent in -30..30 {
            for mantissa in [1.0, 1.9, 2.0, 3.3, 5.0, 7.7, 9.99] {
                let high = mantissa * 10.0_f64.powi(exponent) / 7.0;
                let marks = marks((-0.02 * high, 1.06 * high));
                assert!((2..=5).contains(&marks.len()), "{high}: {}", marks.len());
                assert!(marks.iter().all(|m| m.value >= -0.02 * high && m.value <= 1.06 * high));
            }
        }
        assert!(marks((1.0, 1.0)).is_empty() && marks((0.0, f64::NAN)).is_empty());
    }

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.0, 0.25, -0.0001, 12.5].map(short);
        assert_eq!(texts, ["0", "1", "0.25", "0", "12.5"]);
    }
}
