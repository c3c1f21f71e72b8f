//! Virtual time: haptic ticks and contact passes on one deterministic schedule.
//!
//! Tick i happens at t_i = i dt: it takes the device sample of t_i and the newest contacts that are ready by then, and makes y_i from
//! y_(i-1). A contact pass that starts at s looks at the newest state made at or before s, is ready at s + latency, and the next
//! one starts at s + period, or when this one is ready, whichever is later. At equal times the tick comes first. Period and
//! latency may be any fraction of dt. The first pass looks at the starting state and is ready at once: no one grips an object
//! before its contacts are known.
//!
//! With a simulated hand the loop is closed: tick i's command pushes the simulated device from t_i + delay dt on, by default one sample late.

use super::contact_pass::sample_speed;
use super::{ContactPass, ContactSnapshot, HapticState, Settings, Tick, tick};
use crate::recording::{Recording, Row};
use crate::scene::{Scene, SceneError};
use hapteron_device::guard::Guard;
use hapteron_device::simulated::SimulatedDevice;
use hapteron_device::{Device, DeviceSample};

/// Times closer than this are equal, seconds.
const SAME_TIME: f64 = 1e-9;

/// A run of more ticks is refused: its record would not fit into any memory.
const MOST_TICKS: f64 = 1e9;

/// How far a run has come, told from time to time; answering `false` stops it.
pub type Progress<'a> = &'a mut dyn FnMut(f64) -> bool;

/// A session in virtual time.
pub struct VirtualTime<'a> {
    scene: &'a Scene,
    settings: Settings,
    haptic: HapticState,
    /// Where a simulated hand feels the force.
    device: Option<SimulatedDevice>,
    sample: DeviceSample,
    pass: ContactPass,
    /// What ticks use.
    current: ContactSnapshot,
    /// What a pass is making, and when it is ready.
    pending: ContactSnapshot,
    ready: Option<f64>,
    next_start: f64,
    /// Ticks made.
    ticks: u64,
    /// Whether the newest pass looked at the newest state.
    fresh: bool,
}

impl<'a> VirtualTime<'a> {
    /// A session at the start of a scene.
    ///
    /// # Errors
    /// A device or guard that cannot be (a scene that was read has been checked already).
    pub fn new(scene: &'a Scene) -> Result<Self, SceneError> {
        let sample = in_device_scale(scene, &scene.trajectory.sample(0.0, scene.time_step));
        let device = simulated_device(scene, &sample)?;
        let guard = scene.guard.map(Guard::new).transpose().map_err(|e| fault(scene, e.to_string()))?;
        let mut pass = ContactPass::new(scene);
        let mut current = ContactSnapshot::empty(&scene.body, &scene.start);
        pass.run(scene, &scene.start, sample_speed(scene, &sample), 0.0, &mut current);
        Ok(Self {
            scene,
            settings: Settings::of(scene),
            haptic: HapticState { guard, ..HapticState::new(scene.start) },
            device,
            sample,
            pass,
            pending: current.clone(),
            current,
            ready: None,
            next_start: scene.contact.period,
            ticks: 0,
            fresh: false,
        })
    }

    /// Makes the next tick.
    pub fn advance(&mut self) -> Tick {
        self.ticks += 1;
        let dt = self.scene.time_step;
        let now = self.ticks as f64 * dt;
        self.run_passes(now, now - SAME_TIME);
        let goal = in_device_scale(self.scene, &self.scene.trajectory.sample(now, dt));
        self.sample = match &mut self.device {
            Some(device) => {
                device.set_goal(&goal);
                device.advance(dt);
                // Read and write fail only on what the tick never gives.
                DeviceSample { time: now, ..device.read().unwrap_or(self.sample) }
            }
            None => goal,
        };
        let result = tick(&self.settings, &self.haptic, &self.sample, &self.current, now);
        self.haptic = result.after;
        if let Some(device) = &mut self.device {
            let _ = device.write(&result.command);
        }
        self.fresh = false;
        self.run_passes(now - 2.0 * SAME_TIME, now + SAME_TIME);
        result
    }

    /// The simulated device, where there is one: to change the hand, or look at the handle.
    pub fn device(&mut self) -> Option<&mut SimulatedDevice> {
        self.device.as_mut()
    }

    /// The guard, where there is one: to see its fault, or re-arm it.
    pub fn guard(&mut self) -> Option<&mut Guard> {
        self.haptic.guard.as_mut()
    }

    /// The snapshot that the next tick would use now.
    #[must_use]
    pub fn contacts(&self) -> &ContactSnapshot {
        &self.current
    }

    /// Signed distance of the surfaces at the newest state, metres; infinite when nothing is closer than the tolerance.
    pub fn min_distance(&mut self) -> f64 {
        if self.fresh && self.scene.contact.detail.is_exact() {
            // The pass under way looks at this very state.
            return self.pending.min_distance();
        }
        self.pass.measure(self.scene, &self.haptic.state)
    }

    /// Publishes what is ready by `ready_by` and starts passes that are due before `start_before`.
    fn run_passes(&mut self, ready_by: f64, start_before: f64) {
        loop {
            if let Some(ready) = self.ready {
                if ready > ready_by + SAME_TIME {
                    return;
                }
                std::mem::swap(&mut self.current, &mut self.pending);
                self.ready = None;
            }
            if self.next_start > start_before {
                return;
            }
            let stamp = self.newest_time(start_before);
            let speed = sample_speed(self.scene, &self.sample);
            self.pass.run(self.scene, &self.haptic.state, speed, stamp, &mut self.pending);
            self.fresh = true;
            let ready = self.next_start + self.scene.contact.latency;
            self.ready = Some(ready);
            self.next_start = (self.next_start + self.scene.contact.period).max(ready);
        }
    }

    /// When the newest state was made; `before` tells whether the tick of this instant is done.
    fn newest_time(&self, before: f64) -> f64 {
        let now = self.ticks as f64 * self.scene.time_step;
        if before >= now { now } else { now - self.scene.time_step }
    }
}

fn fault(scene: &Scene, problem: String) -> SceneError {
    SceneError { file: scene.name().to_owned(), line: None, key: None, problem }
}

/// The scene's device in the scene's hand, switched on.
pub(super) fn simulated_device(
    scene: &Scene,
    start: &DeviceSample,
) -> Result<Option<SimulatedDevice>, SceneError> {
    if scene.hand.is_none() {
        return Ok(None);
    }
    let mut device = SimulatedDevice::new(scene.simulated, start).map_err(|e| fault(scene, e.to_string()))?;
    device.set_force_enabled(true).map_err(|e| fault(scene, e.to_string()))?;
    Ok(Some(device))
}

/// Trajectories are in the world's scale; the device is in its own.
fn in_device_scale(scene: &Scene, sample: &DeviceSample) -> DeviceSample {
    scene.scaling.from_world(sample)
}

/// Runs a scene from its start to the end of its motion.
///
/// The same scene gives the same bits, on every run and in every build. `progress` is told the share that is done (0 to 1), about a
/// hundred times; when it answers `false` the run ends there and the recording holds what was made.
///
/// # Errors
/// As [`VirtualTime::new`].
pub fn run_virtual(scene: &Scene, progress: Progress<'_>) -> Result<Recording, SceneError> {
    run_virtual_for(scene, scene.duration(), progress)
}

/// As [`run_virtual`], for so many seconds; after its end the motion stands still.
///
/// # Errors
/// As [`VirtualTime::new`].
pub fn run_virtual_for(
    scene: &Scene,
    duration: f64,
    progress: Progress<'_>,
) -> Result<Recording, SceneError> {
    if !(duration / scene.time_step <= MOST_TICKS) {
        let text = format!(
            "{duration} s are more than a billion steps of {} s; end earlier (--duration)",
            scene.time_step
        );
        return Err(fault(scene, text));
    }
    let mut session = VirtualTime::new(scene)?;
    let ticks = (duration / scene.time_step + SAME_TIME / scene.time_step).floor() as u64;
    let mut recording = Recording::new();
    recording.rows.reserve(ticks.min(10_000_000) as usize);
    let report_every = (ticks / 100).max(1);
    for i in 1..=ticks {
        let result = session.advance();
        let distance = session.min_distance();
        let penetration = (-distance).max(-scene.contact.tolerance);
        recording.push(
            Row::new(scene, i as f64 * scene.time_step, &result, penetration, &session.current),
            &result,
        );
        if i % report_every == 0 && !progress(i as f64 / ticks as f64) {
            recording.cancelled = true;
            break;
        }
    }
    Ok(recording)
}
