//! The output guard: what stands between everything that computes a force and the hand that feels it.
//!
//! It is the last thing that touches a command, knows nothing of meshes or bodies, and trusts nothing: whatever it is given, what it lets through is
//! finite and within the greatest force, torque, slew and power. A [`GuardFault`] takes the force away in two passes, and keeps it away
//! until [`Guard::rearm`]. Plain `Copy` state: no clock, lock, allocation or panic.

mod oscillation;
mod passivity;
mod settings;
mod status;

pub use settings::{GuardError, GuardSettings};
pub use status::{GuardFault, GuardStatus};

use crate::{DeviceCommand, DeviceSample};
use nalgebra::Vector3;
use oscillation::OscillationDetector;
use passivity::PassivityObserver;

/// So many ticks of over-speed in sequence are a fault: one may be a glitch of the encoder.
const FAST_TICKS: u32 = 3;
/// So many ticks without time going on are a fault.
const STILL_TICKS: u32 = 20;
/// Stale contacts or samples are lost after this time, seconds.
const LOST_AFTER: f64 = 1.0;
/// A late tick counts as this many at the most, in slews and ramps.
const LATEST: f64 = 2.0;
/// A pass that comes later than this after the one before begins anew on the ramp, seconds: whoever stopped the program so long (a debugger, a machine that
/// was put to sleep), the hand is somewhere else by now, and the whole force at once would be a blow.
const GAP: f64 = 0.05;
/// Time steps that are no gap, however long they are.
const NO_GAP: f64 = 10.0;
/// Most samples that a device may act late.
const MOST_DELAY: usize = 2;
/// A force below this share of the greatest is none, for the passivity observer.
const IDLE_SHARE: f64 = 0.005;

/// What a pass looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardInput {
    /// What the simulation would send, in the device's scale.
    pub command: DeviceCommand,
    /// What it was made from, in the device's scale.
    pub sample: DeviceSample,
    /// Of the tick, seconds.
    pub time: f64,
    /// How old the contacts are, seconds.
    pub contact_age: f64,
    /// How old the sample is, seconds.
    pub sample_age: f64,
    /// The simulation has stopped with a fault.
    pub simulation_fault: bool,
}

/// What a pass gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guarded {
    /// For the device.
    pub command: DeviceCommand,
    /// What was done to it.
    pub status: GuardStatus,
}

/// A guard with its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard {
    settings: GuardSettings,
    fault: Option<GuardFault>,
    /// The last command that was let through.
    last: DeviceCommand,
    /// The ones before it, newest first.
    older: [DeviceCommand; MOST_DELAY],
    /// Time and sample of the last pass.
    before: Option<(f64, DeviceSample)>,
    /// Share of the force that is let through, 0 to 1.
    gain: f64,
    fast_ticks: u32,
    still_ticks: u32,
    contacts_stale_for: f64,
    samples_stale_for: f64,
    oscillation: OscillationDetector,
    passivity: PassivityObserver,
}

impl Guard {
    /// A guard that ramps its first force up.
    ///
    /// # Errors
    /// A setting that is not positive (force and torque: negative), or 1e12 and more.
    pub fn new(settings: GuardSettings) -> Result<Self, GuardError> {
        settings.check()?;
        Ok(Self {
            settings,
            fault: None,
            last: DeviceCommand::zero(),
            older: [DeviceCommand::zero(); MOST_DELAY],
            before: None,
            gain: 0.0,
            fast_ticks: 0,
            still_ticks: 0,
            contacts_stale_for: 0.0,
            samples_stale_for: 0.0,
            oscillation: OscillationDetector::new(),
            passivity: PassivityObserver::new(),
        })
    }

    /// The limits.
    #[must_use]
    pub fn settings(&self) -> &GuardSettings {
        &self.settings
    }

    /// Why there is no force, if there is none.
    #[must_use]
    pub fn fault(&self) -> Option<GuardFault> {
        self.fault
    }

    /// What the passivity observer has seen go into the virtual side, J; below zero the virtual side made energy.
    #[must_use]
    pub fn observed_energy(&self) -> f64 {
        self.passivity.energy()
    }

    /// Forgets the fault and all else; the force ramps up from zero.
    pub fn rearm(&mut self) {
        if let Ok(fresh) = Self::new(self.settings) {
            *self = Self { last: self.last, ..fresh };
        }
    }

    /// The device's motors were off: nothing was displayed, and the force begins anew on its ramp. A fault stays.
    pub fn interrupted(&mut self) {
        self.gain = 0.0;
        self.last = DeviceCommand::zero();
        self.older = [DeviceCommand::zero(); MOST_DELAY];
    }

    /// Lets a command through, as far as it may go.
    ///
    /// The command that comes out is finite, its force and torque are within the limits, and it differs from the one before by no
    /// more than the greatest slew in two time steps, except where a fault or the power limit makes it smaller. Real time: constant
    /// work, no allocation, no panic.
    #[must_use]
    pub fn pass(&mut self, input: &GuardInput) -> Guarded {
        let mut status = GuardStatus::default();
        if self.fault.is_some() {
            return self.stopped(false);
        }
        let finite = finite(&input.command, &input.sample) && input.time.is_finite();
        let mut fault = if !finite {
            Some(GuardFault::NotFinite)
        } else if input.simulation_fault {
            Some(GuardFault::Simulation)
        } else {
            None
        };
        if finite {
            let dt = self.elapsed(input.time);
            fault = fault.or_else(|| self.watch(input, dt, &mut status));
            if fault.is_none() {
                let moved = self.moved(&input.sample);
                let acted = self.acted();
                let to_hand = acted.force.dot(&moved[0]) + acted.torque.dot(&moved[1]);
                let wanted = self.wanted(input, &moved, to_hand, dt, &mut status);
                let command = self.limited(&wanted, &input.sample, dt, &mut status);
                let s = &self.settings;
                let thresholds = [s.oscillation_force, s.oscillation_torque];
                let speed = input.sample.linear_velocity.norm_squared().sqrt() / s.max_speed;
                let turning = input.sample.angular_velocity.norm_squared().sqrt() / s.max_angular_speed;
                if self.oscillation.take(&command, to_hand, speed.max(turning), thresholds, dt) {
                    fault = Some(GuardFault::Oscillation);
                } else if within(&command, s) {
                    self.older = [self.last, self.older[0]];
                    self.last = command;
                } else {
                    fault = Some(GuardFault::NotFinite);
                }
            }
            self.before = Some((input.time, input.sample));
        }
        if fault.is_some() {
            self.fault = fault;
            return self.stopped(true);
        }
        Guarded { command: self.last, status }
    }

    /// Takes the force away: half of it in the pass of the fault, and all in the next.
    fn stopped(&mut self, first: bool) -> Guarded {
        self.last = if first { scaled(&self.last, 0.5) } else { DeviceCommand::zero() };
        let status = self.fault.map_or_else(GuardStatus::default, GuardFault::status);
        Guarded { command: self.last, status }
    }

    /// Seconds since the last pass, as far as they are believed; counts the passes in which time did not go on, and begins anew after a [`GAP`].
    fn elapsed(&mut self, time: f64) -> f64 {
        let step = self.settings.time_step;
        let Some((before, _)) = self.before else {
            return step;
        };
        if time - before > GAP.max(NO_GAP * step) {
            self.gain = 0.0;
        }
        self.still_ticks = if time > before { 0 } else { self.still_ticks + 1 };
        // A clock that stands still must not hold the force where it is: the tick happened all the same.
        if time > before { (time - before).min(LATEST * step) } else { step }
    }

    /// Looks for faults of handle, clock and threads, and moves the share of the force that is let through.
    fn watch(&mut self, input: &GuardInput, dt: f64, status: &mut GuardStatus) -> Option<GuardFault> {
        let s = &self.settings;
        let fast = input.sample.linear_velocity.norm_squared() > s.max_speed * s.max_speed
            || input.sample.angular_velocity.norm_squared() > s.max_angular_speed * s.max_angular_speed;
        self.fast_ticks = if fast { self.fast_ticks + 1 } else { 0 };
        // An age that is no number is no age.
        let contacts_stale = !(input.contact_age <= s.stale_after);
        let samples_stale = !(input.sample_age <= s.samples_stale_after);
        let longer = |stale: bool, by: f64| if stale { by + dt } else { 0.0 };
        self.contacts_stale_for = longer(contacts_stale, self.contacts_stale_for);
        self.samples_stale_for = longer(samples_stale, self.samples_stale_for);
        for (stale, bit) in
            [(contacts_stale, GuardStatus::CONTACTS_STALE), (samples_stale, GuardStatus::SAMPLES_STALE)]
        {
            if stale {
                status.set(bit);
            }
        }
        let rate = match (contacts_stale, samples_stale) {
            (_, true) => -1.0 / s.samples_stale_after,
            (true, false) => -1.0 / s.stale_after,
            (false, false) => 1.0 / s.ramp_time,
        };
        self.gain = (self.gain + rate * dt).clamp(0.0, 1.0);
        if self.gain < 1.0 {
            status.set(GuardStatus::RAMPING);
        }
        let faults = [
            (self.fast_ticks >= FAST_TICKS, GuardFault::OverSpeed),
            (self.still_ticks >= STILL_TICKS, GuardFault::Clock),
            (self.contacts_stale_for > LOST_AFTER, GuardFault::ContactsLost),
            (self.samples_stale_for > LOST_AFTER, GuardFault::SamplesLost),
        ];
        faults.into_iter().find(|f| f.0).map(|f| f.1)
    }

    /// The command that the device held since the last pass.
    fn acted(&self) -> DeviceCommand {
        match self.settings.delay.checked_sub(1) {
            None => self.last,
            Some(i) => self.older.get(i).copied().unwrap_or(self.last),
        }
    }

    /// How far the handle went and turned since the last pass.
    fn moved(&self, sample: &DeviceSample) -> [Vector3<f64>; 2] {
        match &self.before {
            Some((_, before)) => [sample.position - before.position, small_turn(before, sample)],
            None => [Vector3::zeros(); 2],
        }
    }

    /// The command with ramp and passivity controller, before limits.
    fn wanted(
        &mut self,
        input: &GuardInput,
        moved: &[Vector3<f64>; 2],
        to_hand: f64,
        dt: f64,
        status: &mut GuardStatus,
    ) -> DeviceCommand {
        let s = &self.settings;
        let idle = self.last.force.norm_squared() <= (IDLE_SHARE * s.max_force).powi(2)
            && self.last.torque.norm_squared() <= (IDLE_SHARE * s.max_torque).powi(2);
        self.passivity.take(to_hand, idle, dt);
        let mut command = input.command;
        if s.max_torque == 0.0 && command.torque != Vector3::zeros() {
            status.set(GuardStatus::TORQUE_UNDELIVERED);
            command.torque = Vector3::zeros();
        }
        if s.passivity {
            let (damped, any) = self.passivity.control(&command, moved, s.max_damping, dt);
            if any {
                status.set(GuardStatus::DAMPED);
            }
            command = damped;
        }
        scaled(&command, self.gain)
    }

    /// The command within force and torque, slew and power.
    fn limited(
        &self,
        wanted: &DeviceCommand,
        sample: &DeviceSample,
        dt: f64,
        status: &mut GuardStatus,
    ) -> DeviceCommand {
        let s = &self.settings;
        let mut command = *wanted;
        let share = share_within(&command, s.max_force, s.max_torque);
        if share < 1.0 {
            status.set(GuardStatus::LIMITED);
            command = scaled(&command, share);
        }
        let change = DeviceCommand {
            force: command.force - self.last.force,
            torque: command.torque - self.last.torque,
        };
        let share = share_within(&change, s.max_slew * dt, s.max_torque_slew * dt);
        if share < 1.0 {
            status.set(GuardStatus::SLEWED);
            command = DeviceCommand {
                force: self.last.force + change.force * share,
                torque: self.last.torque + change.torque * share,
            };
        }
        let power = command.force.dot(&sample.linear_velocity) + command.torque.dot(&sample.angular_velocity);
        if power > s.max_power {
            status.set(GuardStatus::POWER_LIMITED);
            command = scaled(&command, s.max_power / power);
        }
        // The last bit that rounding added.
        scaled(&command, share_within(&command, s.max_force, s.max_torque))
    }
}

/// One factor for force and torque, so that the wrench keeps its direction and its line of action.
fn share_within(command: &DeviceCommand, force: f64, torque: f64) -> f64 {
    let share = |v: &Vector3<f64>, most: f64| {
        let length = v.norm_squared().sqrt();
        // A hair less, so that rounding never ends beyond the limit.
        if length > most { most * (1.0 - 1e-15) / length } else { 1.0 }
    };
    share(&command.force, force).min(share(&command.torque, torque))
}

fn scaled(command: &DeviceCommand, by: f64) -> DeviceCommand {
    DeviceCommand { force: command.force * by, torque: command.torque * by }
}

/// Whether everything is a number small enough to be squared.
fn finite(command: &DeviceCommand, sample: &DeviceSample) -> bool {
    let vectors = [
        &command.force,
        &command.torque,
        &sample.position,
        &sample.linear_velocity,
        &sample.angular_velocity,
    ];
    vectors.iter().all(|v| v.norm_squared().is_finite())
        && sample.orientation.coords.norm_squared().is_finite()
}

/// The last look: finite and within the limits.
fn within(command: &DeviceCommand, s: &GuardSettings) -> bool {
    let ok = |v: &Vector3<f64>, most: f64| v.norm_squared() <= most * most * (1.0 + 1e-12);
    ok(&command.force, s.max_force) && ok(&command.torque, s.max_torque)
}

/// The turn from one sample to the next, for turns that are small: twice the vector part.
fn small_turn(before: &DeviceSample, after: &DeviceSample) -> Vector3<f64> {
    let turn = after.orientation.into_inner() * before.orientation.into_inner().conjugate();
    let sign = if turn.w < 0.0 { -2.0 } else { 2.0 };
    turn.imag() * sign
}
