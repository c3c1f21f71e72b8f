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
//! A handle that nobody holds, between walls of 1 to 3 kN/m, ends up thrown to and fro by all the motors' force 1.8 to 1.9 times a second. By force and energy
//! alone it looks like a hand that shakes what is held fast, but no hand goes so fast against such a force: 1.4 to 1.6 m/s.
//!
//! Not seen: swings below 3 % of the greatest force, or slower than 2 Hz where they are not thrown; slow ones that push to one side only (a handle thrown off
//! a wall that falls back); and faint ones that feed the hand little. The limits of force, slew, power and speed bound those.

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
    /// Between two swings the handle goes as fast as this share of the greatest speed, at least once.
    speed: f64,
}

/// Hz. Motors at their limit slow an unstable loop down until damping and delay balance, at sqrt(b / (m t_d)): 10 to 12 Hz for hands of 0.1 to 0.5 kg.
const FAST: [f64; 2] = [8.0, f64::INFINITY];
/// The same for a handle that nobody holds, Hz. Ridges of a texture come faster.
const SLOW: [f64; 2] = [2.0, 15.0];
/// Hz, for one that is thrown to and fro.
const THROWN: [f64; 2] = [1.0, 15.0];
const KINDS: [Kind; 5] = [
    // Usual ones. An impact is over by then; a texture that is displayed late makes a little energy.
    Kind { between: FAST, fast_part: true, size: 1.0, swings: 24, time: 0.3, share: Some(0.1), speed: 0.0 },
    // Violent ones.
    Kind { between: FAST, fast_part: true, size: 4.0, swings: 24, time: 0.45, share: None, speed: 0.0 },
    // Faint ones.
    Kind { between: FAST, fast_part: true, size: 0.3, swings: 24, time: 1.0, share: Some(0.1), speed: 0.0 },
    // Slow ones: a handle that nobody holds loses 1 or 2 % to its friction in each swing, and gets no more.
    Kind { between: SLOW, fast_part: false, size: 0.6, swings: 9, time: 1.0, share: Some(0.005), speed: 0.0 },
    // A handle that is thrown to and fro.
    Kind {
        between: THROWN,
        fast_part: false,
        size: 8.0,
        swings: 7,
        time: 1.0,
        share: Some(0.005),
        speed: 0.5,
    },
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
    /// The greatest since the last swing, as a share of the greatest allowed.
    speed: f64,
}

/// What a run looks at besides the force on its axis.
struct Motion {
    /// Given to the hand since the last command, J.
    energy: f64,
    /// Of the handle, as a share of the greatest allowed.
    speed: f64,
    dt: f64,
}

impl Run {
    /// Takes one value of the fast part; whether with it the run is an oscillation. `force` is the threshold of the force.
    fn take(&mut self, kind: &Kind, value: f64, threshold: f64, force: f64, motion: &Motion) -> bool {
        self.since += motion.dt;
        self.lasted += motion.dt;
        self.energy += motion.energy;
        self.traffic += motion.energy.abs();
        self.speed = self.speed.max(motion.speed);
        let [slowest, fastest] = kind.between;
        if self.since > 0.5 / slowest {
            *self = Self::default();
        }
        let side = value.signum();
        if value.abs() > threshold * kind.size && side != self.side {
            if self.first == 0.0 || self.since < 0.5 / fastest || self.speed < kind.speed {
                *self = Self { first: side, ..Self::default() };
            }
            self.side = side;
            self.swings = self.swings.saturating_add(1);
            (self.since, self.speed) = (0.0, 0.0);
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

    /// Takes a command (N, N m), the energy that went to the hand since the last one (J), and the handle's speed as a share of the greatest allowed; whether it
    /// oscillates. Thresholds are those of force and torque.
    pub fn take(
        &mut self,
        command: &DeviceCommand,
        energy: f64,
        speed: f64,
        thresholds: [f64; 2],
        dt: f64,
    ) -> bool {
        let motion = Motion { energy, speed, dt };
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
                    found |= run.take(kind, value, thresholds[what], thresholds[0], &motion);
                }
            }
        }
        found
    }
}
