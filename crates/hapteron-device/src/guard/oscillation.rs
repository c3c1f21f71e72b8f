//! The oscillation detector.
//!
//! A loop that is unstable swings: the force goes from one side to the other and back, again and again, and feeds the hand energy. What only looks
//! so: an impact rings a few times; the steps of a slow contact thread go to one side only; a texture swings to both sides, but the hand
//! that strokes it pays for it, and so does one that knocks or shakes.
//! So on each axis the slow part of the force is taken away, and swings past a threshold on alternating sides are counted; a run of many of them that
//! lasts long enough is an oscillation if, over the run, the device gave the hand energy: more than the swings' force times 0.1 mm, and
//! more than a share of what went to and fro. Several [`Kind`]s of swings are looked for at once: usual ones, faint, slow and violent ones. Violent ones are
//! an oscillation whatever the energy.
//!
//! Not seen: swings below 3 % of the greatest force, or slower than 2 Hz; slow ones that push to one side only (a handle thrown off a wall that falls back);
//! faint ones that feed the hand little; and slow ones at the motors' limit from which the power limit takes the energy, as of a handle that nobody holds between walls
//! of 1.5 to 3 kN/m, until it is faster than `max_speed`. The limits of force, slew, power and speed bound those. A hand that shakes something between two
//! walls with all the motors' force looks the same, so that they cannot be told from it by the force.

use crate::DeviceCommand;
use nalgebra::Vector3;

/// Energy to the hand in a run, as a way that a force of the threshold would go, metres: less is what sampling makes of a texture.
const LEAST_WAY: f64 = 1e-4;

/// What makes an oscillation.
struct Kind {
    /// Slower and faster swings are not looked for, Hz.
    between: [f64; 2],
    /// Of the force without its slow part; else of the force as it is, which must push to both sides then.
    fast_part: bool,
    /// Swings past so many times the threshold count.
    size: f64,
    /// So many of them in a run.
    swings: u32,
    /// It lasts so long, seconds.
    time: f64,
    /// Energy to the hand as a share of all that went to and fro; none: whatever the energy.
    share: Option<f64>,
}

/// Hz. Motors at their limit slow an unstable loop down until damping and delay balance, at sqrt(b / (m t_d)): 10 to 12 Hz for hands of 0.1 to 0.5 kg.
const FAST: [f64; 2] = [8.0, f64::INFINITY];
/// The same for a handle that nobody holds, Hz. Ridges of a texture come faster.
const SLOW: [f64; 2] = [2.0, 15.0];
const KINDS: [Kind; 4] = [
    // Usual ones. An impact is over by then; a texture that is displayed late makes a little energy.
    Kind { between: FAST, fast_part: true, size: 1.0, swings: 24, time: 0.3, share: Some(0.1) },
    // Violent ones.
    Kind { between: FAST, fast_part: true, size: 4.0, swings: 24, time: 0.45, share: None },
    // Faint ones.
    Kind { between: FAST, fast_part: true, size: 0.3, swings: 24, time: 1.0, share: Some(0.1) },
    // Slow ones: a handle that nobody holds loses 1 or 2 % to its friction in each swing, and gets no more.
    Kind { between: SLOW, fast_part: false, size: 0.6, swings: 9, time: 1.0, share: Some(0.005) },
];

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
    /// Takes one value of the fast part; whether with it the run is an oscillation. `force` is the threshold of the force.
    fn take(&mut self, kind: &Kind, value: f64, threshold: f64, force: f64, energy: f64, dt: f64) -> bool {
        self.since += dt;
        self.lasted += dt;
        self.energy += energy;
        self.traffic += energy.abs();
        let [slowest, fastest] = kind.between;
        if self.since > 0.5 / slowest {
            *self = Self::default();
        }
        let side = value.signum();
        if value.abs() > threshold * kind.size && side != self.side {
            if self.first == 0.0 || self.since < 0.5 / fastest {
                *self = Self { first: side, ..Self::default() };
            }
            self.side = side;
            self.swings = self.swings.saturating_add(1);
            self.since = 0.0;
        }
        // Energy that a spring holds for a while is not counted where the swing is the same as at the start.
        let long =
            self.since == 0.0 && side == self.first && self.swings >= kind.swings && self.lasted >= kind.time;
        let feeds =
            |share: f64| self.energy > kind.size * force * LEAST_WAY && self.energy > share * self.traffic;
        long && kind.share.is_none_or(feeds)
    }
}

/// One for force and torque, three axes each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OscillationDetector {
    before: [Vector3<f64>; 2],
    /// The command without its slow part.
    fast: [Vector3<f64>; 2],
    runs: [[[Run; 3]; 2]; KINDS.len()],
}

impl OscillationDetector {
    pub fn new() -> Self {
        Self {
            before: [Vector3::zeros(); 2],
            fast: [Vector3::zeros(); 2],
            runs: [[[Run::default(); 3]; 2]; KINDS.len()],
        }
    }

    /// Takes a command (N, N m) and the energy that went to the hand since the last one (J); whether it oscillates. Thresholds are those of force and torque.
    pub fn take(&mut self, command: &DeviceCommand, energy: f64, thresholds: [f64; 2], dt: f64) -> bool {
        let now = [command.force, command.torque];
        let time_constant = 1.0 / (std::f64::consts::TAU * FAST[0]);
        let keep = time_constant / (time_constant + dt);
        for what in 0..2 {
            self.fast[what] = (self.fast[what] + now[what] - self.before[what]) * keep;
        }
        self.before = now;
        let mut found = false;
        for (kind, runs) in KINDS.iter().zip(&mut self.runs) {
            for what in 0..2 {
                for axis in 0..3 {
                    let value = if kind.fast_part { self.fast[what][axis] } else { now[what][axis] };
                    let run = &mut runs[what][axis];
                    found |= run.take(kind, value, thresholds[what], thresholds[0], energy, dt);
                }
            }
        }
        found
    }
}
