//! Fig. 4, section 7.3: the spoon held inside the handle of the cup.

use super::figure::{Curve, Figure, Quantity, Row, curve, greatest};
use crate::progress;
use anyhow::Result;
use hapteron::recording::Recording;
use hapteron::scene::file::{ContactModel, Method};
use hapteron::scenes::spoon_in_cup;

const SETTING: &str = "The spoon's handle is put through the handle of the cup; for more than 100 ms it slides freely, then it is pressed against the \
cup with about 2 N. k_c = 200 N/m and the three settings are the paper's. Not in the paper, and chosen here: tolerance d = 1 mm (one contact under a push f \
sinks by f/k - d), contact damping half of critical, at most 8 clusters, the linearized contact model with a contact thread as fast as the haptic one, \
the coupling's damping and the spoon's inertia as in Fig. 2. Roughness is the root mean square of the step of the contact force's magnitude from tick to tick.";

const SHOWN: [Quantity; 3] = [
    Quantity {
        title: "Penetration (negative: distance, as far as d)",
        unit: "mm",
        clip: 2.0,
        mark: Some((0.6, "0.6 mm")),
        value: |r| r.penetration * 1e3,
    },
    Quantity {
        title: "Feedback force to the hand",
        unit: "N",
        clip: 10.0,
        mark: None,
        value: |r| r.feedback[0].norm(),
    },
    Quantity { title: "Contact force", unit: "N", clip: 10.0, mark: None, value: |r| r.contact[0].norm() },
];

struct Setting {
    label: &'static str,
    grams: f64,
    stiffness: f64,
    method: Method,
}

const SETTINGS: [Setting; 3] = [
    Setting {
        label: "Runge-Kutta IV 100 g 2 kN/m",
        grams: 100.0,
        stiffness: 2e3,
        method: Method::RungeKutta4,
    },
    Setting {
        label: "Backward Euler 10 g 2 kN/m",
        grams: 10.0,
        stiffness: 2e3,
        method: Method::BackwardEuler,
    },
    Setting {
        label: "Backward Euler 100 g 10 kN/m",
        grams: 100.0,
        stiffness: 1e4,
        method: Method::BackwardEuler,
    },
];

/// What is read off a run.
struct Reading {
    penetration: f64,
    free_time: f64,
    share_in_contact: f64,
    force_free: f64,
    force_in_contact: f64,
    roughness: f64,
}

fn read(recording: &Recording) -> Reading {
    let touching = |r: &hapteron::recording::Row| r.contact[0].norm() > 0.0;
    let first = recording.rows.iter().position(touching).unwrap_or(recording.rows.len());
    let (free, rest) = recording.rows.split_at(first);
    let force =
        |rows: &[hapteron::recording::Row]| rows.iter().map(|r| r.feedback[0].norm()).fold(0.0, f64::max);
    let steps = rest.windows(2).map(|w| (w[1].contact[0].norm() - w[0].contact[0].norm()).powi(2));
    Reading {
        penetration: greatest(recording, |r| r.penetration) * 1e3,
        free_time: free.last().map_or(0.0, |r| r.time * 1e3),
        share_in_contact: rest.iter().filter(|r| touching(r)).count() as f64 / rest.len().max(1) as f64,
        force_free: force(free),
        force_in_contact: force(rest),
        roughness: (steps.sum::<f64>() / rest.len().max(1) as f64).sqrt(),
    }
}

/// Runs the experiment.
pub fn run() -> Result<Figure> {
    let bar = progress::bar(SETTINGS.len() as u64, "Fig. 4");
    let mut curves: Vec<Curve> = Vec::new();
    for s in &SETTINGS {
        let mut scene = spoon_in_cup(s.grams * 1e-3, s.stiffness, s.method);
        scene.contact.model = Some(ContactModel::Linearized);
        curves.push(curve(s.label, scene)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let readings: Vec<Reading> = curves.iter().map(|c| read(&c.recording)).collect();
    let title = "Fig. 4  contact state (section 7.3)";
    let panels = vec![(String::new(), curves.iter().map(|c| c.label.clone()).collect())];
    let rows = rows(&curves, &readings);
    Ok(Figure { name: "fig4", title, setting: SETTING, rows, curves, shown: &SHOWN, panels })
}

fn rows(curves: &[Curve], readings: &[Reading]) -> Vec<Row> {
    let [runge, light, stiff] = readings else { return Vec::new() };
    let depth =
        |mm: f64| if mm > 0.0 { format!("{mm:.3} mm") } else { format!("none (nearest {:.3} mm)", -mm) };
    let softest = runge.penetration.max(light.penetration);
    let free = readings.iter().map(|r| r.free_time).fold(f64::INFINITY, f64::min);
    let held = readings.iter().map(|r| r.share_in_contact).fold(1.0, f64::min);
    let stable = curves.iter().all(|c| c.recording.summary().stable);
    let ratio = |r: &Reading| r.force_free / r.force_in_contact;
    vec![
        Row::new("free motion before contact", "more than 100 ms", format!("{free:.0} ms"), free > 100.0),
        Row::new(
            "in contact from then on",
            "yes",
            format!("{:.1} % of the ticks", held * 100.0),
            held > 0.95,
        ),
        Row::new(
            "finite and held by the coupling, all three",
            "yes",
            (if stable { "yes" } else { "no" }).to_owned(),
            stable,
        ),
        Row::new("greatest penetration at 2 kN/m", "< 0.6 mm", depth(softest), softest < 0.6),
        Row::new(
            "greatest penetration at 10 kN/m",
            "< 0.2 mm",
            depth(stiff.penetration),
            stiff.penetration < 0.2,
        ),
        Row::new(
            "Runge-Kutta IV, 100 g, 2 kN/m",
            "oscillates",
            format!(
                "roughness {:.3} N, {:.1} times that of 10 g",
                runge.roughness,
                runge.roughness / light.roughness
            ),
            runge.roughness > 1.5 * light.roughness,
        ),
        Row::new(
            "Backward Euler, 100 g, 10 kN/m",
            "oscillates",
            format!(
                "roughness {:.3} N, {:.1} times that of 10 g",
                stiff.roughness,
                stiff.roughness / light.roughness
            ),
            stiff.roughness > 1.5 * light.roughness,
        ),
        Row::new(
            "Backward Euler, 10 g, 2 kN/m",
            "remains stable",
            format!("roughness {:.3} N", light.roughness),
            light.roughness < 0.05,
        ),
        Row::new(
            "feedback force at 100 g, free against contact",
            "very similar",
            format!("{:.2} N against {:.2} N", runge.force_free, runge.force_in_contact),
            (0.67..1.5).contains(&ratio(runge)),
        ),
        Row::new(
            "feedback force at 10 g, free against contact",
            "clear distinction",
            format!("{:.2} N against {:.2} N", light.force_free, light.force_in_contact),
            ratio(light) < 0.2,
        ),
    ]
}
