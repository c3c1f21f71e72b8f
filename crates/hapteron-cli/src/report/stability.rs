//! The report of `stability`.

use super::{Cell, Page};
use crate::commands::stability::{Map, Verdict};

/// `report.html` of a map.
pub fn stability(map: &Map, scene_name: &str, common: &[String], png: Vec<u8>, scene: &str) -> String {
    let stable = map.cells.iter().filter(|c| c.verdict == Verdict::Stable).count();
    let verdict = format!("{stable} of {} stable", map.cells.len());
    let mut page = Page::new("Stability map", Some((&verdict, stable == map.cells.len())));
    let [x, y] = &map.axes;
    page.paragraph(
        &format!("{scene_name} in a simulated hand on a simulated device, in virtual time: {} to the right, {} upward.", x.key, y.key),
        false,
    );
    page.paragraph(
        "The hand makes its motion and then holds still for a second. Green: over the last half second the force swings by less than 0.05 N rms (dark: less than \
         0.01 N). Amber: it swings by more. Red: the guard saw the force oscillate and took it away. Black: another fault, or the coupling deviated by 10 cm or 1.5 rad.",
        true,
    );
    if !common.is_empty() {
        page.paragraph(&format!("Set for all cells: {}.", common.join(", ")), true);
    }
    page.pictures(&[(png, format!("{} over {}", y.key, x.key))]);
    let rows: Vec<Vec<Cell>> = (0..y.values.len())
        .flat_map(|row| (0..x.values.len()).map(move |column| (column, row)))
        .map(|(column, row)| {
            let c = map.at(column, row);
            vec![
                Cell::Text(x.values[column].clone()),
                Cell::Text(y.values[row].clone()),
                Cell::Verdict(c.verdict.name(), c.verdict == Verdict::Stable),
                Cell::Text(c.fault_time.map_or_else(String::new, |t| format!("{t:.3}"))),
                Cell::Text(format!("{:.1}", c.swing * 1e3)),
                Cell::Text(format!("{:.2}", c.greatest_force)),
                Cell::Text(format!("{:.2}", c.greatest_deviation * 1e3)),
            ]
        })
        .collect();
    page.heading("Cells");
    let header = [
        x.key.as_str(),
        &y.key,
        "verdict",
        "fault at, s",
        "swing, mN rms",
        "force up to, N",
        "deviation up to, mm",
    ];
    page.table(&header, &rows);
    page.details("The scene as it was read", scene);
    page.finish()
}
