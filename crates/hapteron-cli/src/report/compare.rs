//! The report of `compare`.

use super::plot::{Plot, Plots};
use super::{Cell, Page};
use hapteron::recording::{Recording, Row};

/// A quantity of both runs.
pub struct Compared {
    /// What it is.
    pub what: &'static str,
    /// Of the first run and of the second.
    pub values: [String; 2],
    /// The second less the first.
    pub difference: String,
}

type Shown<'a> = (&'a str, &'a str, &'a dyn Fn(&Row) -> f64);

/// A report of two runs, the second against the first.
pub fn comparison(names: [&str; 2], runs: [&Recording; 2], table: &[Compared]) -> String {
    let mut page = Page::new(&format!("{} against {}", names[1], names[0]), None);
    let rows: Vec<Vec<Cell>> = table
        .iter()
        .map(|c| {
            let [a, b] = c.values.clone();
            vec![
                Cell::Text(c.what.to_owned()),
                Cell::Text(a),
                Cell::Text(b),
                Cell::Text(c.difference.clone()),
            ]
        })
        .collect();
    page.table(&["quantity", names[0], names[1], "difference"], &rows);
    let mut plots = Plots::new("time [s]");
    let column =
        |run: &Recording, value: &dyn Fn(&Row) -> f64| run.rows.iter().map(value).collect::<Vec<f64>>();
    let times = runs.map(|r| plots.times(&column(r, &|row| row.time)));
    let shown: [Shown<'_>; 6] = [
        ("Feedback force", "N", &|r| r.feedback[0].norm()),
        ("Feedback torque", "mN m", &|r| r.feedback[1].norm() * 1e3),
        ("Contact force", "N", &|r| r.contact[0].norm()),
        ("Penetration", "mm", &|r| r.penetration * 1e3),
        ("Coupling deviation", "mm", &|r| r.deviation * 1e3),
        ("Contacts", "", &|r| f64::from(r.contacts)),
    ];
    for (title, unit, value) in shown {
        let mut plot = Plot::new(title, unit);
        for i in 0..2 {
            plot = plot.series(names[i], times[i], &column(runs[i], value));
        }
        plots.add(plot);
    }
    page.heading("Over time");
    page.plots(&plots);
    page.finish()
}
