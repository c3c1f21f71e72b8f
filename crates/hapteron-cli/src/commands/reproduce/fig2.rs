//! Fig. 2, section 7.2: the spoon in free space with three integrators.

use super::figure::{Curve, Figure, Quantity, Row, curve, greatest, is_stable, record};
use crate::progress;
use anyhow::Result;
use hapteron::recording::Recording;
use hapteron::scene::file::Method;
use hapteron::scenes::spoon_in_free_space;

const SETTING: &str = "A spoon of 20 cm follows a hand that moves up to 1.4 m/s for 2.5 s, without touching anything. \
k_c = 200 N/m and k_theta = 0.6 N m/rad are the paper's; b_c = 2 N s/m, b_theta = 0.0166 N m s/rad, the spoon's inertia and the motion \
are not in the paper and are one choice that agrees with its figures. Stable means: no fault, coupling deviation below 10 cm \
and coupling angle below 1.5 rad to the end.";

const SHOWN: [Quantity; 2] = [
    Quantity {
        title: "Coupling deviation",
        unit: "mm",
        clip: 40.0,
        mark: None,
        value: |r| r.deviation * 1e3,
    },
    Quantity {
        title: "Coupling force (feedback to the hand)",
        unit: "N",
        clip: 10.0,
        mark: None,
        value: |r| r.feedback[0].norm(),
    },
];

/// The masses of the sweep with Backward Euler, grams.
const SWEEP: [f64; 12] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 70.0, 100.0, 200.0, 300.0];

/// Runs the experiment.
pub fn run() -> Result<Figure> {
    let bar = progress::bar(4, "Fig. 2");
    let forward = threshold(Method::ForwardEuler, 0.05, 0.3)?;
    bar.inc(1);
    let runge = threshold(Method::RungeKutta4, 0.03, 0.2)?;
    bar.inc(1);
    let mut unstable = Vec::new();
    for grams in SWEEP {
        if !is_stable(spoon_in_free_space(grams * 1e-3, Method::BackwardEuler))? {
            unstable.push(grams);
        }
    }
    bar.inc(1);
    let backward = |grams: f64| record(spoon_in_free_space(grams * 1e-3, Method::BackwardEuler));
    let (heavy, light) = (backward(100.0)?, backward(10.0)?);
    let rows = rows(forward, runge, &unstable, &heavy, &light);
    let curves = curves()?;
    bar.finish_and_clear();
    let title = "Fig. 2  free-space motion (section 7.2)";
    let panels = vec![(String::new(), curves.iter().map(|c| c.label.clone()).collect())];
    Ok(Figure { name: "fig2", title, setting: SETTING, rows, curves, shown: &SHOWN, panels })
}

/// Smallest stable mass in kg by bisection to one part in a thousand, between a mass that is not stable and one that is.
fn threshold(method: Method, mut low: f64, mut high: f64) -> Result<f64> {
    while high / low > 1.001 {
        let middle = (low * high).sqrt();
        if is_stable(spoon_in_free_space(middle, method))? {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok(high)
}

fn rows(forward: f64, runge: f64, unstable: &[f64], heavy: &Recording, light: &Recording) -> Vec<Row> {
    let deviation = |r: &Recording| greatest(r, |row| row.deviation) * 1e3;
    let force = |r: &Recording| greatest(r, |row| row.feedback[0].norm());
    // The paper's masses are whole tens of grams.
    let ten_grams = |mass: f64| (mass * 100.0).ceil() * 10.0;
    let grams = |mass: f64| format!("{:.2} g", mass * 1e3);
    let all = if unstable.is_empty() {
        "stable at all of 0.01 g to 300 g".to_owned()
    } else {
        format!("unstable at {unstable:?} g")
    };
    let slope = (deviation(heavy) / deviation(light)).log10();
    vec![
        Row::new("smallest stable mass, Forward Euler", "100 g", grams(forward), ten_grams(forward) == 100.0),
        Row::new("smallest stable mass, Runge-Kutta IV", "70 g", grams(runge), ten_grams(runge) == 70.0),
        Row::new("Backward Euler", "stable at 1 g", all, unstable.is_empty()),
        Row::new(
            "greatest deviation, 100 g, Backward Euler",
            "17 mm",
            format!("{:.2} mm", deviation(heavy)),
            (deviation(heavy) - 17.0).abs() < 1.0,
        ),
        Row::new(
            "greatest deviation, 10 g, Backward Euler",
            "< 2 mm",
            format!("{:.3} mm", deviation(light)),
            deviation(light) < 2.0,
        ),
        Row::new(
            "deviation against mass",
            "roughly linear",
            format!("grows as mass^{slope:.2} from 10 g to 100 g"),
            (0.75..1.3).contains(&slope),
        ),
        Row::new(
            "greatest coupling force, 100 g",
            "3.5 N",
            format!("{:.2} N", force(heavy)),
            (force(heavy) - 3.5).abs() < 0.2,
        ),
        Row::new(
            "greatest coupling force, 10 g",
            "< 0.5 N",
            format!("{:.3} N", force(light)),
            force(light) < 0.5,
        ),
    ]
}

/// The paper's curves, and its integrators just below their limits.
fn curves() -> Result<Vec<Curve>> {
    let run = |label: &str, grams: f64, method| curve(label, spoon_in_free_space(grams * 1e-3, method));
    Ok(vec![
        run("Forward Euler 100 g", 100.0, Method::ForwardEuler)?,
        run("Runge-Kutta IV 70 g", 70.0, Method::RungeKutta4)?,
        run("Backward Euler 100 g", 100.0, Method::BackwardEuler)?,
        run("Backward Euler 10 g", 10.0, Method::BackwardEuler)?,
        run("Backward Euler 1 g", 1.0, Method::BackwardEuler)?,
    ])
}
