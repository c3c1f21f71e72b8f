//! The report of `reproduce`.

use super::plot::{Plot, Plots};
use super::{Cell, Page};
use crate::commands::reproduce::figure::{Curve, Figure, Quantity};

/// `report.html` of experiments.
pub fn reproduction(figures: &[Figure]) -> String {
    let rows = || figures.iter().flat_map(|f| &f.rows);
    let (all, holding) = (rows().count(), rows().filter(|r| r.holds).count());
    let verdict = format!("{holding} of {all} rows hold");
    let mut page = Page::new("The paper's experiments", Some((&verdict, all == holding)));
    page.paragraph(
        "M. A. Otaduy and M. C. Lin, Stable and Responsive Six-Degree-of-Freedom Haptic Manipulation Using Implicit Integration, World Haptics 2005, \
         section 7, repeated in virtual time: same input, same bits. A row holds when the paper's statement is true of the run here; where the paper \
         shows an instability, it holds when the run shows it too.",
        true,
    );
    for figure in figures {
        page.heading(figure.title);
        page.paragraph(figure.setting, true);
        let rows: Vec<Vec<Cell>> = figure
            .rows
            .iter()
            .map(|row| {
                let verdict = if row.holds { "holds" } else { "does not hold" };
                vec![
                    Cell::Text(row.what.clone()),
                    Cell::Text(row.paper.clone()),
                    Cell::Text(row.measured.clone()),
                    Cell::Verdict(verdict, row.holds),
                ]
            })
            .collect();
        page.table(&["what", "paper", "here", ""], &rows);
        for (title, chosen) in &figure.panels {
            if !title.is_empty() {
                page.paragraph(title, false);
            }
            let curves: Vec<&Curve> = figure.curves.iter().filter(|c| chosen.contains(&c.label)).collect();
            page.plots(&plots(&curves, figure.shown));
        }
    }
    page.finish()
}

fn plots(curves: &[&Curve], shown: &[Quantity]) -> Plots {
    let mut plots = Plots::new("time [s]");
    let times: Vec<_> = curves
        .iter()
        .map(|c| plots.times(&c.recording.rows.iter().map(|r| r.time).collect::<Vec<f64>>()))
        .collect();
    for quantity in shown {
        let mut plot = Plot::new(quantity.title, quantity.unit).clipped(quantity.clip);
        for (curve, &times) in curves.iter().zip(&times) {
            let values: Vec<f64> = curve.recording.rows.iter().map(|r| (quantity.value)(r)).collect();
            plot = plot.series(&curve.label, times, &values);
        }
        if let Some((level, label)) = quantity.mark {
            plot = plot.mark(level, label);
        }
        plots.add(plot);
    }
    plots
}
