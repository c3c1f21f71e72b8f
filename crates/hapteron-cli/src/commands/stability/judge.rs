//! Whether one scene is stable in a simulated hand.

use hapteron::device::guard::GuardFault;
use hapteron::recording::{GREATEST_ANGLE, GREATEST_DEVIATION};
use hapteron::scene::{Scene, SceneError};
use hapteron::session::VirtualTime;

/// After the motion the hand holds still for this long, seconds ...
const REST: f64 = 1.0;
/// ... and over the last part of it the force must not swing by more than `AT_REST`, seconds.
const LOOK: f64 = 0.5;
/// N rms.
const AT_REST: f64 = 0.05;

/// What became of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It came to rest.
    Stable,
    /// The force still swings while the hand holds still.
    Hums,
    /// The guard saw the force oscillate, and took it away.
    Oscillates,
    /// Another fault, or the body was lost.
    Lost,
}

impl Verdict {
    /// As it stands in the CSV.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Hums => "hums",
            Self::Oscillates => "oscillates",
            Self::Lost => "lost",
        }
    }
}

/// What was measured of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// In one word.
    pub verdict: Verdict,
    /// When a fault came, seconds.
    pub fault_time: Option<f64>,
    /// Of the force to the hand while the hand holds still, N rms.
    pub swing: f64,
    /// Of the force to the hand, N.
    pub greatest_force: f64,
    /// Of the coupling, metres.
    pub greatest_deviation: f64,
}

/// Runs a scene to the end of its motion, and on while the hand holds still.
pub fn judge(scene: &Scene) -> Result<Outcome, SceneError> {
    let mut session = VirtualTime::new(scene)?;
    let end = scene.duration() + REST;
    let ticks = (end / scene.time_step).round() as u64;
    let (mut sum, mut squares, mut n) = (nalgebra::Vector3::zeros(), 0.0, 0.0);
    let mut outcome = Outcome {
        verdict: Verdict::Stable,
        fault_time: None,
        swing: 0.0,
        greatest_force: 0.0,
        greatest_deviation: 0.0,
    };
    for i in 1..=ticks {
        let time = i as f64 * scene.time_step;
        let tick = session.advance();
        let force = tick.command.force;
        outcome.greatest_force = outcome.greatest_force.max(force.norm());
        outcome.greatest_deviation = outcome.greatest_deviation.max(tick.step.deviation);
        let gone = tick.step.deviation >= GREATEST_DEVIATION || tick.step.angle >= GREATEST_ANGLE;
        if tick.flags.no_force() || gone {
            let oscillates = session.guard().and_then(|g| g.fault()) == Some(GuardFault::Oscillation);
            outcome.verdict = if oscillates { Verdict::Oscillates } else { Verdict::Lost };
            outcome.fault_time = Some(time);
            return Ok(outcome);
        }
        if time > end - LOOK {
            sum += force;
            squares += force.norm_squared();
            n += 1.0;
        }
    }
    let mean = sum / f64::max(n, 1.0);
    outcome.swing = f64::max(squares / f64::max(n, 1.0) - mean.norm_squared(), 0.0).sqrt();
    if outcome.swing > AT_REST {
        outcome.verdict = Verdict::Hums;
    }
    Ok(outcome)
}
