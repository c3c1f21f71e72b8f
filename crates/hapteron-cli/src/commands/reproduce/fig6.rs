//! Fig. 6, sections 6.4 and 7.4: the jaws, and a contact thread slower than the haptic one.

use super::figure::{Curve, Figure, Quantity, Row, curve};
use super::thresholds;
use crate::progress;
use anyhow::Result;
use hapteron::recording::{Recording, Summary};
use hapteron::scene::file::ContactModel;
use hapteron::scenes::jaws;
use rayon::prelude::*;

const SETTING: &str = "The upper jaw (10 g) chews on the lower one for 0.9 s; k_c = 500 N/m, k = 5 kN/m, Backward Euler and a device whose motion counts 0.4 \
(and its force 2.5) are the paper's. Contacts are found at full resolution, so the contact thread's rate, which the paper set by error thresholds of \
2.5 %, 1 % and 0.4 %, is given here: at 500, 200 and 100 Hz a query looks at the body and its contacts are used 2, 5 and 10 ms later. 'Without' holds the last \
force, with its Jacobian in the implicit step only. Not in the paper, and chosen here: tolerance d = 0.5 mm, contact damping half of critical, k_theta = 1.5 N m/rad, \
b_c = 3 N s/m, b_theta = 0.006 N m s/rad, every contact a plane of its own, and the motion. The last rows use the paper's thresholds on contact levels of detail: their force is compared with that of exact contacts, \
and their cost is measured here, on the poses of the exact run, each query after the one before. Unstable means: the rms step of the feedback force from tick to tick in contact is more than 5 \
times that of the same model at 1 kHz; diverging: the feedback force is more than 5 times as well. Penetration counts where surfaces cross; contact begins d before.";

const SHOWN: [Quantity; 3] = [
    Quantity {
        title: "Penetration (negative: distance, as far as d)",
        unit: "mm",
        clip: 3.0,
        mark: Some((0.1, "0.1 mm")),
        value: |r| r.penetration * 1e3,
    },
    Quantity {
        title: "Feedback force to the hand",
        unit: "N",
        clip: 40.0,
        mark: None,
        value: |r| r.feedback[0].norm(),
    },
    Quantity { title: "Contact force", unit: "N", clip: 40.0, mark: None, value: |r| r.contact[0].norm() },
];

/// Contact model with the contact thread's rate in hertz; its latency is its period.
const RUNS: [(ContactModel, f64); 11] = [
    (ContactModel::Held, 1000.0),
    (ContactModel::Held, 500.0),
    (ContactModel::Held, 100.0),
    (ContactModel::Linearized, 1000.0),
    (ContactModel::Linearized, 500.0),
    (ContactModel::Linearized, 200.0),
    (ContactModel::Linearized, 100.0),
    (ContactModel::Planes, 1000.0),
    (ContactModel::Planes, 200.0),
    (ContactModel::Planes, 100.0),
    (ContactModel::Planes, 50.0),
];

/// Runs the experiment.
pub fn run() -> Result<Figure> {
    let bar = progress::bar(RUNS.len() as u64, "Fig. 6");
    let curves = RUNS
        .par_iter()
        .map(|&(model, rate)| {
            let mut scene = jaws();
            scene.contact.model = Some(model);
            scene.contact_thread.period = Some(1.0 / rate);
            scene.contact_thread.latency = Some(1.0 / rate);
            let curve = curve(&label(model, rate), scene);
            bar.inc(1);
            curve
        })
        .collect::<Result<Vec<Curve>>>()?;
    bar.finish_and_clear();
    let mut rows = rows(&Runs(&curves));
    let exact = curves.iter().position(|c| c.label == label(ContactModel::Planes, 1000.0));
    let coarse = thresholds::run(&curves[exact.unwrap_or(0)])?;
    rows.extend(coarse.rows);
    let mut curves = curves;
    let coarse_labels: Vec<String> = coarse.curves.iter().map(|c| c.label.clone()).collect();
    curves.extend(coarse.curves);
    let panel = |title: &str, wanted: ContactModel| {
        let labels = RUNS.iter().filter(|r| r.0 == wanted).map(|&(model, rate)| label(model, rate));
        (title.to_owned(), labels.collect())
    };
    let shown = std::iter::once(label(ContactModel::Planes, 1000.0)).chain(coarse_labels).collect();
    let panels = vec![
        panel("With the linearized contact model (Eq. 30):", ContactModel::Linearized),
        panel("Without it, the last force held:", ContactModel::Held),
        panel(
            "The default, beyond the paper: planes re-evaluated at every tick, known ahead, never pulling:",
            ContactModel::Planes,
        ),
        ("The default with contact levels of detail, at 1 kHz, by error threshold:".to_owned(), shown),
    ];
    let title = "Fig. 6  jaws and a slow contact thread (sections 6.4, 7.4)";
    Ok(Figure { name: "fig6", title, setting: SETTING, rows, curves, shown: &SHOWN, panels })
}

fn label(model: ContactModel, rate: f64) -> String {
    let name = match model {
        ContactModel::Held => "without",
        ContactModel::Linearized => "with",
        ContactModel::Planes => "planes",
    };
    format!("{name} {rate:.0} Hz")
}

struct Runs<'a>(&'a [Curve]);

impl Runs<'_> {
    fn recording(&self, model: ContactModel, rate: f64) -> &Recording {
        let wanted = label(model, rate);
        let found = self.0.iter().find(|c| c.label == wanted);
        &found.unwrap_or(&self.0[0]).recording
    }

    fn read(&self, model: ContactModel, rate: f64) -> Reading {
        let summary = |rate| self.recording(model, rate).summary();
        Reading { run: summary(rate), fast: summary(1000.0) }
    }
}

/// A run and the same at 1 kHz.
struct Reading {
    run: Summary,
    fast: Summary,
}

impl Reading {
    fn unstable(&self) -> bool {
        !self.run.stable || self.run.force_roughness > 5.0 * self.fast.force_roughness
    }

    fn diverging(&self) -> bool {
        self.unstable() && (!self.run.stable || self.run.greatest_force > 5.0 * self.fast.greatest_force)
    }

    fn penetration(&self) -> f64 {
        self.run.greatest_penetration * 1e3
    }

    fn depth(&self) -> String {
        let mm = self.penetration();
        if mm > 0.0 { format!("{mm:.3} mm") } else { format!("none (nearest {:.3} mm)", -mm) }
    }

    fn motion(&self) -> String {
        format!(
            "force to {:.1} N, {:.0} mN steps (1 kHz: {:.1} N, {:.0} mN)",
            self.run.greatest_force,
            self.run.force_roughness * 1e3,
            self.fast.greatest_force,
            self.fast.force_roughness * 1e3
        )
    }
}

fn rows(runs: &Runs<'_>) -> Vec<Row> {
    use ContactModel::{Held, Linearized, Planes};
    let with = |rate| runs.read(Linearized, rate);
    let stable = |what: &str, paper: &str, r: &Reading| Row::new(what, paper, r.motion(), !r.unstable());
    let held_500 = runs.read(Held, 500.0);
    let held_100 = runs.read(Held, 100.0);
    let slowest = runs.read(Planes, 50.0);
    vec![
        Row::new(
            "with the model, 500 Hz: greatest penetration",
            "< 0.1 mm",
            with(500.0).depth(),
            with(500.0).penetration() < 0.1,
        ),
        stable("with the model, 500 Hz", "stable", &with(500.0)),
        stable("with the model, 200 Hz", "stable", &with(200.0)),
        stable("with the model, 100 Hz", "stable", &with(100.0)),
        Row::new("without the model, 500 Hz", "unstable", held_500.motion(), held_500.unstable()),
        Row::new("without the model, 100 Hz", "diverges", held_100.motion(), held_100.diverging()),
        stable("default model, 50 Hz and 20 ms late (beyond the paper)", "(stable)", &slowest),
        Row::new(
            "default model, 50 Hz and 20 ms late: penetration",
            "(< 0.2 mm)",
            slowest.depth(),
            slowest.penetration() < 0.2,
        ),
    ]
}
