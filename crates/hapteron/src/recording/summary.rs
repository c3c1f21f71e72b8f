//! What the rows of a run come to, taken one by one: no more memory for a run of hours than for one of seconds.

use super::{GREATEST_ANGLE, GREATEST_DEVIATION, Row};
use nalgebra::Vector3;

/// What a recording comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Seconds.
    pub duration: f64,
    /// No fault, deviation below [`GREATEST_DEVIATION`], angle below [`GREATEST_ANGLE`].
    pub stable: bool,
    /// Of the coupling, metres.
    pub greatest_deviation: f64,
    /// Of the coupling, radians.
    pub greatest_angle: f64,
    /// Of the feedback, N.
    pub greatest_force: f64,
    /// Of the feedback, N m.
    pub greatest_torque: f64,
    /// Metres; not positive when the surfaces never crossed.
    pub greatest_penetration: f64,
    /// Share of the ticks with a contact force.
    pub in_contact: f64,
    /// Most contacts of a query.
    pub most_contacts: u32,
    /// Most planes at once.
    pub most_planes: u32,
    /// Seconds.
    pub greatest_contact_age: f64,
    /// Root mean square of the feedback force's step from tick to tick, N, in contact.
    pub force_roughness: f64,
}

/// Takes the rows of a run in their order.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summarizer {
    rows: u64,
    touching: u64,
    /// The last feedback force, if there was contact.
    before: Option<Vector3<f64>>,
    steps: u64,
    squares: f64,
    last: Option<Row>,
    fault_time: Option<f64>,
    greatest_deviation: f64,
    greatest_force: f64,
    greatest_torque: f64,
    greatest_penetration: Option<f64>,
    most_contacts: u32,
    most_planes: u32,
    greatest_contact_age: f64,
}

impl Summarizer {
    /// Adds a row.
    pub fn push(&mut self, row: &Row) {
        self.rows += 1;
        let touches = norm(&row.contact[0]) > 0.0;
        self.touching += u64::from(touches);
        let force = row.feedback[0];
        if let (Some(before), true) = (self.before, touches) {
            self.steps += 1;
            self.squares += (force - before).norm_squared();
        }
        self.before = touches.then_some(force);
        self.fault_time = row.flags.no_force().then(|| self.fault_time.unwrap_or(row.time));
        self.greatest_deviation = self.greatest_deviation.max(row.deviation);
        self.greatest_force = self.greatest_force.max(norm(&force));
        self.greatest_torque = self.greatest_torque.max(norm(&row.feedback[1]));
        let depth = self.greatest_penetration.unwrap_or(f64::NEG_INFINITY).max(row.penetration);
        self.greatest_penetration = Some(depth);
        self.most_contacts = self.most_contacts.max(row.contacts);
        self.most_planes = self.most_planes.max(row.clusters);
        self.greatest_contact_age = self.greatest_contact_age.max(row.contact_age);
        self.last = Some(*row);
    }

    /// How many there were.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// When the fault came that keeps the forces away at the end, seconds.
    #[must_use]
    pub fn fault_time(&self) -> Option<f64> {
        self.fault_time
    }

    /// What they come to. The greatest coupling angle, radians, is in no row.
    #[must_use]
    pub fn summary(&self, greatest_angle: f64) -> Summary {
        Summary {
            duration: self.last.map_or(0.0, |r| r.time),
            stable: self.fault_time.is_none()
                && self.greatest_deviation < GREATEST_DEVIATION
                && greatest_angle < GREATEST_ANGLE,
            greatest_deviation: self.greatest_deviation,
            greatest_angle,
            greatest_force: self.greatest_force,
            greatest_torque: self.greatest_torque,
            greatest_penetration: self.greatest_penetration.unwrap_or(f64::NEG_INFINITY),
            in_contact: self.touching as f64 / self.rows.max(1) as f64,
            most_contacts: self.most_contacts,
            most_planes: self.most_planes,
            greatest_contact_age: self.greatest_contact_age,
            force_roughness: libm::sqrt(self.squares / self.steps.max(1) as f64),
        }
    }
}

fn norm(v: &Vector3<f64>) -> f64 {
    libm::sqrt(v.norm_squared())
}
