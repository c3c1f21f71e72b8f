//! The report of a run.

use super::digest::Digest;
use super::picture;
use super::timing;
use super::{Cell, Page};
use crate::commands::faults::Fault;
use anyhow::Result;
use hapteron::scene::{ContactModel, Scene};
use hapteron::session::real_time::{End, Grants, ON_TIME_NS, Timing};

/// A session in real time, beside its recording.
pub struct Live {
    /// Why it ended.
    pub end: End,
    /// What the system granted.
    pub grants: Grants,
    /// Histograms and counts.
    pub timing: Timing,
    /// Ticks and passes that the files do not hold, because the disk was too slow or full.
    pub unrecorded: u64,
    /// Why the recording ended before the session, if it did.
    pub trouble: Option<String>,
    /// Of the device.
    pub device: String,
    /// What took the force away.
    pub faults: Vec<Fault>,
}

/// By which clock a run went.
pub enum Time {
    /// The deterministic schedule, or that of an earlier session; computed in `wall` seconds.
    Virtual { wall: f64, replayed: bool },
    /// The machine's.
    Real(Box<Live>),
}

impl Time {
    /// For people.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Virtual { replayed: false, .. } => "virtual time",
            Self::Virtual { replayed: true, .. } => "virtual time (a session made again)",
            Self::Real(_) => "real time",
        }
    }
}

/// A run to be reported.
pub struct Outcome<'a> {
    pub scene: &'a Scene,
    pub digest: Digest,
    pub time: Time,
}

/// `report.html` of a run. `notes` are said at its top.
pub fn run(outcome: Outcome<'_>, notes: &[String]) -> Result<String> {
    let Outcome { scene, digest, time } = outcome;
    let summary = digest.summary();
    let verdict = if summary.stable { "stable" } else { "not stable" };
    let mut page = Page::new(scene.name(), Some((verdict, summary.stable)));
    page.paragraph(&what_was_run(scene, &digest, &time), true);
    for note in notes {
        page.paragraph(note, false);
    }
    let pace = match &time {
        Time::Virtual { wall, .. } => {
            (format!("{:.2} x", summary.duration / wall.max(1e-9)), "real time, computed")
        }
        Time::Real(live) => {
            let share = live.timing.lateness.share_up_to(ON_TIME_NS) * 100.0;
            (format!("{share:.2} %"), "of the ticks at most 50 us late")
        }
    };
    let depth = summary.greatest_penetration * 1e3;
    let penetration = if depth > 0.0 { format!("{depth:.3} mm") } else { "none".to_owned() };
    page.tiles(&[
        (format!("{:.2} N", summary.greatest_force), "greatest feedback force"),
        (format!("{:.1} mN m", summary.greatest_torque * 1e3), "greatest feedback torque"),
        (penetration, "greatest penetration"),
        (format!("{:.2} mm", summary.greatest_deviation * 1e3), "greatest coupling deviation"),
        (format!("{:.0} %", summary.in_contact * 100.0), "of the time in contact"),
        (format!("{} on {}", summary.most_contacts, summary.most_planes), "most contacts on planes"),
        (format!("{:.0} mN", summary.force_roughness * 1e3), "rms force step a tick, in contact"),
        pace,
    ]);
    page.pictures(&picture::of_run(scene, &digest)?);
    page.heading("Over time");
    page.plots(&digest.plots(matches!(time, Time::Real(_))));
    if let Time::Real(live) = &time {
        timing::section(&mut page, live);
    }
    page.heading("Setting");
    page.table(&["quantity", "value"], &setting(scene));
    page.details("scene.toml: every value of this run", &scene.to_toml()?);
    let again = match time {
        Time::Virtual { replayed: false, .. } => "hapteron run scene.toml --virtual-time",
        Time::Virtual { .. } | Time::Real(_) => "hapteron run scene.toml --replay device.csv",
    };
    page.paragraph(
        &format!("Repeat it bit for bit with: {again} (in this folder). The numbers behind the plots are in run.csv."),
        true,
    );
    Ok(page.finish())
}

fn what_was_run(scene: &Scene, digest: &Digest, time: &Time) -> String {
    let triangles = |mesh: &hapteron::collision::mesh::TriMesh| mesh.triangles().len();
    let obstacles: usize = scene.obstacles.iter().map(|o| triangles(&o.model.mesh)).sum();
    let hand = match time {
        Time::Real(live) => format!("a device ({})", live.device),
        Time::Virtual { replayed: true, .. } => "the device's recorded motion".to_owned(),
        Time::Virtual { .. } if scene.hand.is_some() => "a simulated hand that feels the force".to_owned(),
        Time::Virtual { .. } => "a recorded motion".to_owned(),
    };
    let mut text = format!(
        "{:.3} s in {} at {:.0} Hz: a body of {:.3} g and {} triangles, held by {hand}, against {obstacles} triangles.",
        digest.summary().duration,
        time.name(),
        1.0 / scene.time_step,
        scene.body.mass() * 1e3,
        triangles(&scene.model.mesh),
    );
    if let Some(time) = digest.fault_time() {
        text.push_str(&format!(" A fault took the force away at {time:.3} s, for good."));
    }
    match time {
        Time::Real(live) if !live.end.is_regular() => {
            text.push_str(&format!(" It ended early: {}.", live.end));
        }
        _ if digest.cancelled => text.push_str(" Ended by Ctrl-C."),
        _ => {}
    }
    text
}

fn setting(scene: &Scene) -> Vec<Vec<Cell>> {
    let row = |what: &str, value: String| vec![Cell::Text(what.to_owned()), Cell::Text(value)];
    let c = &scene.contact;
    let model = match c.model {
        ContactModel::Planes => "planes, re-evaluated at every tick, never pulling",
        ContactModel::Linearized => "linearized at the contacts' state (Eq. 30)",
        ContactModel::Held => "held between updates",
    };
    let clusters = match c.max_clusters {
        0 => "every contact a plane of its own".to_owned(),
        n => format!("at most {n} clusters"),
    };
    let scale = scene.file.device.position_scale.unwrap_or(1.0);
    let coupling = &scene.file.coupling;
    let of = |value: Option<f64>| value.unwrap_or(0.0);
    vec![
        row("integrator", format!("{:?}, {} ms", scene.method, scene.time_step * 1e3)),
        row(
            "coupling",
            format!(
                "{} N/m, {} N s/m; {} N m/rad, {} N m s/rad",
                of(coupling.linear_stiffness),
                of(coupling.linear_damping),
                of(coupling.angular_stiffness),
                of(coupling.angular_damping)
            ),
        ),
        row(
            "contact",
            format!(
                "{} N/m, {:.3} N s/m, from a distance of d = {} mm",
                c.stiffness,
                c.damping,
                c.tolerance * 1e3
            ),
        ),
        row("contact model", format!("{model}; {clusters}")),
        row(
            "device",
            format!(
                "its motion counts {scale}; force to the hand times {:.4}, torque times {:.4}",
                1.0 / scale,
                1.0 / (scale * scale)
            ),
        ),
        row("contact thread", format!("every {} ms, {} ms late", c.period * 1e3, c.latency * 1e3)),
    ]
}
