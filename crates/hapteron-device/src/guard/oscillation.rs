//! The oscillation detector.
//!
//! A loop that is unstable swings: the force goes from one side to the other and back, again and again, at 8 Hz to half the rate, and
//! feeds the hand energy. What only looks so: an impact rings a few times; the steps of a slow contact thread go to one side only; a texture
//! swings to both sides, but the hand that strokes it pays for it.
//! So on each axis the slow part of the force is taken away, and swings past a threshold on alternating sides are counted; a run of many
//! of them that lasts long enough is an oscillation if, over the run, the device gave the hand energy: more than the threshold's force
//! times 0.1 mm, and more than 10 % of what went to and fro. Swings of four times the threshold are one whatever the energy, if they last half as long again.
//!
//! Not seen: swings below the threshold; a handle that is thrown off a wall and falls back more slowly than 8 times a second; and a handle that nobody holds,
//! which swings at 2 to 5 Hz between the motors' limits. The limits of force, slew, power and speed bound those.

use crate::DeviceCommand;
use nalgebra::Vector3;

/// Slower swings are the hand's own, Hz. Motors at their limit slow an unstable loop down until damping and delay balance, at
/// sqrt(b / (m t_d)): 10 to 12 Hz for hands of 0.1 to 0.5 kg.
const LOWEST: f64 = 8.0;
/// Swings of a run.
const LEAST_SWINGS: u32 = 24;
/// A run lasts at least this long, seconds: an impact is over by then.
const LEAST_TIME: f64 = 0.3;
/// Energy to the hand in a run, as a way that the threshold's force would go, metres: less is what sampling makes of a texture.
const LEAST_WAY: f64 = 1e-4;
/// The same as a share of all energy that went to and fro: a texture that is displayed late makes a little.
const LEAST_SHARE: f64 = 0.1;
/// Swings this many times the threshold are violent.
const VIOLENT: f64 = 4.0;
/// Violent swings are an oscillation after this time, seconds.
const VIOLENT_TIME: f64 = 0.45;

/// A run of swings to alternating sides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Run {
    /// Side of the first swing; 0 before it.
    first: f64,
    /// Side of the last swing.
    side: f64,
    swings: u32,
    /// Since the last swing, seconds.
    since: f64,
    /// Since the first, seconds.
    lasted: f64,
    /// Given to the hand since the first swing, J.
    energy: f64,
    /// Given or taken, J.
    traffic: f64,
}

impl Run {
    /// Takes one value of the fast part; whether with it the run is `LEAST_SWINGS` swings and `least_time` seconds long.
    fn take(&mut self, value: f64, threshold: f64, energy: f64, dt: f64, least_time: f64) -> bool {
        self.since += dt;
        self.lasted += dt;
        self.energy += energy;
        self.traffic += energy.abs();
        if self.since > 0.5 / LOWEST {
            *self = Self::default();
        }
        let side = value.signum();
        if value.abs() > threshold && side != self.side {
            if self.first == 0.0 {
                *self = Self { first: side, ..Self::default() };
            }
            self.side = side;
            self.swings = self.swings.saturating_add(1);
            self.since = 0.0;
        }
        // Energy that a spring holds for a while is not counted where the swing is the same as at the start.
        self.since == 0.0 && side == self.first && self.swings >= LEAST_SWINGS && self.lasted >= least_time
    }
}

/// One for force and torque, three axes each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OscillationDetector {
    before: [Vector3<f64>; 2],
    fast: [Vector3<f64>; 2],
    runs: [[Run; 3]; 2],
    violent: [[Run; 3]; 2],
}

impl OscillationDetector {
    pub fn new() -> Self {
        Self {
            before: [Vector3::zeros(); 2],
            fast: [Vector3::zeros(); 2],
            runs: [[Run::default(); 3]; 2],
            violent: [[Run::default(); 3]; 2],
        }
    }

    /// Takes a command (N, N m) and the energy that went to the hand since the last one (J); whether it oscillates.
    pub fn take(&mut self, command: &DeviceCommand, energy: f64, thresholds: [f64; 2], dt: f64) -> bool {
        let time_constant = 1.0 / (std::f64::consts::TAU * LOWEST);
        let keep = time_constant / (time_constant + dt);
        let mut found = false;
        for (kind, now) in [command.force, command.torque].into_iter().enumerate() {
            self.fast[kind] = (self.fast[kind] + now - self.before[kind]) * keep;
            self.before[kind] = now;
            for axis in 0..3 {
                let value = self.fast[kind][axis];
                let run = &mut self.runs[kind][axis];
                let long = run.take(value, thresholds[kind], energy, dt, LEAST_TIME);
                let feeds = run.energy > thresholds[0] * LEAST_WAY && run.energy > LEAST_SHARE * run.traffic;
                found |= long && feeds;
                let violent = &mut self.violent[kind][axis];
                found |= violent.take(value, VIOLENT * thresholds[kind], energy, dt, VIOLENT_TIME);
            }
        }
        found
    }
}
