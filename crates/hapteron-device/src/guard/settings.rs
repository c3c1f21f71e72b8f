//! The limits of a guard, and where they come from.

use crate::Capabilities;

/// Where nothing else is known of a device, N: what a desktop device pushes with.
const UNKNOWN_FORCE: f64 = 3.0;
/// The same, N m.
const UNKNOWN_TORQUE: f64 = 0.1;
/// From nothing to the greatest force in this time by default, seconds: as fast as a stiff wall of 3 kN/m at 0.5 m/s.
const FULL_SLEW: f64 = 0.005;
/// The greatest force at this speed is the greatest power by default, m/s.
const FULL_POWER_SPEED: f64 = 1.0;
/// Damping of the passivity controller at the most, N s/m: beyond it encoder noise is felt.
const MOST_DAMPING: f64 = 5.0;
/// Where a limit is to limit nothing, in any unit.
const NO_LIMIT: f64 = 1e9;
/// Swings of the force of this share of the greatest count as oscillation, when they feed the hand.
const OSCILLATION_SHARE: f64 = 0.1;

/// What a guard lets through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardSettings {
    /// Nominal time between two passes, seconds.
    pub time_step: f64,
    /// N. 0: the device has no motors for forces.
    pub max_force: f64,
    /// N m. 0: the device has no motors for torques.
    pub max_torque: f64,
    /// Greatest change of force, N/s.
    pub max_slew: f64,
    /// Greatest change of torque, N m/s.
    pub max_torque_slew: f64,
    /// Greatest power that the hand is pushed with, W.
    pub max_power: f64,
    /// A handle that is faster for three ticks is a fault, m/s.
    pub max_speed: f64,
    /// The same for its turning, rad/s.
    pub max_angular_speed: f64,
    /// From no force to the whole force after an engage, a re-arming or staleness, seconds.
    pub ramp_time: f64,
    /// Contacts older than this are not trusted: the force fades away, in the same time again. Seconds.
    pub stale_after: f64,
    /// The same for device samples, seconds.
    pub samples_stale_after: f64,
    /// Swings of the force to either side by more than this are the detector's business, N.
    pub oscillation_force: f64,
    /// The same for the torque, N m.
    pub oscillation_torque: f64,
    /// A command acts so many samples late, 0 to 2: for the energy that is observed.
    pub delay: usize,
    /// Whether time-domain passivity is controlled.
    pub passivity: bool,
    /// Damping of the passivity controller at the most, N s/m.
    pub max_damping: f64,
}

/// A setting that cannot be: its name and value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardError(pub &'static str, pub f64);

impl std::fmt::Display for GuardError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "guard.{} is {}; it must be positive (a force, torque or delay may be 0) and below 1e12, a delay no more than 2",
            self.0, self.1
        )
    }
}

impl std::error::Error for GuardError {}

impl GuardSettings {
    /// The defaults for a device and a tick of `time_step` seconds.
    #[must_use]
    pub fn for_device(device: &Capabilities, time_step: f64) -> Self {
        let known = |limit: f64, unknown: f64| if limit.is_finite() { limit } else { unknown };
        let max_force = if device.drives_force { known(device.peak_force, UNKNOWN_FORCE) } else { 0.0 };
        let max_torque = if device.drives_torque { known(device.peak_torque, UNKNOWN_TORQUE) } else { 0.0 };
        let max_damping = known(device.max_damping, MOST_DAMPING).min(MOST_DAMPING);
        let max_damping = if max_damping > 0.0 { max_damping } else { MOST_DAMPING };
        Self { max_damping, ..Self::within(max_force, max_torque, time_step) }
    }

    /// The defaults for a greatest force (N) and torque (N m).
    #[must_use]
    pub fn within(max_force: f64, max_torque: f64, time_step: f64) -> Self {
        // What is 0 is never passed on, whatever its rate.
        let or_one = |limit: f64| if limit > 0.0 { limit } else { 1.0 };
        let (force, torque) = (or_one(max_force), or_one(max_torque));
        Self {
            time_step,
            max_force,
            max_torque,
            max_slew: force / FULL_SLEW,
            max_torque_slew: torque / FULL_SLEW,
            max_power: force * FULL_POWER_SPEED,
            max_speed: 2.0,
            max_angular_speed: 30.0,
            ramp_time: 0.25,
            stale_after: 0.1,
            samples_stale_after: 0.01,
            oscillation_force: OSCILLATION_SHARE * force,
            oscillation_torque: OSCILLATION_SHARE * torque,
            delay: 0,
            passivity: false,
            max_damping: MOST_DAMPING,
        }
    }

    /// What stays of it where it is switched off on a device with motors: finite numbers, the greatest force and torque, ramps, and fading when
    /// contacts or samples are stale. Slew, power, speed, oscillation and passivity are no longer looked at.
    #[must_use]
    pub fn limits_only(self) -> Self {
        Self {
            max_slew: NO_LIMIT,
            max_torque_slew: NO_LIMIT,
            max_power: NO_LIMIT,
            max_speed: NO_LIMIT,
            max_angular_speed: NO_LIMIT,
            oscillation_force: NO_LIMIT,
            oscillation_torque: NO_LIMIT,
            passivity: false,
            ..self
        }
    }

    /// Each value in its range.
    pub(super) fn check(&self) -> Result<(), GuardError> {
        let positive = [
            ("time_step", self.time_step),
            ("max_slew", self.max_slew),
            ("max_torque_slew", self.max_torque_slew),
            ("max_power", self.max_power),
            ("max_speed", self.max_speed),
            ("max_angular_speed", self.max_angular_speed),
            ("ramp_time", self.ramp_time),
            ("stale_after", self.stale_after),
            ("samples_stale_after", self.samples_stale_after),
            ("oscillation_force", self.oscillation_force),
            ("oscillation_torque", self.oscillation_torque),
            ("max_damping", self.max_damping),
        ];
        // Beyond the upper end squares and products would overflow.
        let wrong = |lowest_is_zero: bool, v: f64| !((v > 0.0 || lowest_is_zero && v == 0.0) && v < 1e12);
        let not_negative = [("max_force", self.max_force), ("max_torque", self.max_torque)];
        let first = positive.iter().find(|(_, v)| wrong(false, *v));
        match first.or_else(|| not_negative.iter().find(|(_, v)| wrong(true, *v))) {
            Some(&(name, value)) => Err(GuardError(name, value)),
            None if self.delay > 2 => Err(GuardError("delay", self.delay as f64)),
            None => Ok(()),
        }
    }
}
