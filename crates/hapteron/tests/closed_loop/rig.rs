//! One simulated device against one wall, through the tick that a session runs.

use hapteron::device::guard::Guard;
use hapteron::device::simulated::{DeviceModel, SimulatedDevice, SimulatedSettings, model};
use hapteron::device::{Device, DeviceSample, HandParameters, Scaling};
use hapteron::dynamics::{ContactPlane, Coupling, Method, RigidBody, Spring, State};
use hapteron::scene::ContactModel;
use hapteron::session::grasp::Buttons;
use hapteron::session::{ContactLaw, ContactSnapshot, HapticState, Settings, Tick, tick};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Seconds.
pub const DT: f64 = 1e-3;

/// A handle at rest.
pub fn at(z: f64) -> DeviceSample {
    DeviceSample {
        time: 0.0,
        position: Vector3::z() * z,
        orientation: UnitQuaternion::identity(),
        linear_velocity: Vector3::zeros(),
        angular_velocity: Vector3::zeros(),
        buttons: 0,
    }
}

/// A device that the linear theory knows: mass and viscous friction, neither Coulomb friction nor encoders.
pub fn linear(mass: f64, damping: f64) -> DeviceModel {
    DeviceModel {
        mass,
        damping,
        friction: 0.0,
        angular_friction: 0.0,
        resolution: 0.0,
        angular_resolution: 0.0,
        peak_force: 1e9,
        continuous_force: 1e9,
        ..model("premium-1.5-6dof").unwrap()
    }
}

/// The coupling and the body.
#[derive(Clone, Copy)]
pub struct Tool {
    pub mass: f64,
    pub stiffness: f64,
    pub damping: f64,
}

impl Tool {
    pub fn settings(&self) -> Settings {
        let spring = |stiffness| Spring { stiffness, limit: None };
        let body = RigidBody::new(self.mass, Matrix3::identity() * (self.mass * 4e-4)).unwrap();
        let identity = UnitQuaternion::identity();
        let coupling = Coupling::new(
            spring(self.stiffness),
            self.damping,
            spring(0.3),
            0.003,
            Vector3::zeros(),
            identity,
        );
        Settings {
            body,
            coupling: coupling.unwrap(),
            gravity: Vector3::zeros(),
            method: Method::BackwardEuler,
            time_step: DT,
            scaling: Scaling::new(1.0).unwrap(),
            contact_model: ContactModel::Planes,
            // The walls are made here, not by passes; nothing is switched.
            contact_law: ContactLaw { stiffness: 0.0, damping: 0.0 },
            buttons: Buttons::default(),
            blend_time: 0.1,
        }
    }
}

/// A wall that holds the body at z = 0 from both sides, so that the loop is linear: two planes that always push, with half of stiffness and damping each.
pub fn bilateral(stiffness: f64, damping: f64) -> Vec<ContactPlane> {
    let plane = |side: f64| {
        let n = Vector3::z() * side;
        ContactPlane::new(Vector3::zeros(), &(n * -0.1), n, 0.5 * stiffness, 0.5 * damping, 0.0)
    };
    vec![plane(1.0), plane(-1.0)]
}

/// A floor below z = 0, half critically damped.
pub fn floor(stiffness: f64, mass: f64) -> Vec<ContactPlane> {
    let damping = (stiffness * mass).sqrt();
    vec![ContactPlane::new(Vector3::zeros(), &Vector3::zeros(), -Vector3::z(), stiffness, damping, 5e-4)]
}

/// All of it.
pub struct Rig {
    pub settings: Settings,
    pub haptic: HapticState,
    pub device: SimulatedDevice,
    contacts: ContactSnapshot,
    ticks: u64,
}

impl Rig {
    pub fn new(tool: Tool, device: SimulatedSettings, planes: Vec<ContactPlane>, start: f64) -> Self {
        let settings = tool.settings();
        let zero = Vector3::zeros();
        let state =
            State::moving(&settings.body, Vector3::z() * start, &UnitQuaternion::identity(), &zero, &zero);
        // A wall that stays where it is does not get old.
        let contacts = ContactSnapshot::of_planes(&planes, &settings.body, &state, 1e9);
        let mut device = SimulatedDevice::new(device, &at(start)).unwrap();
        device.set_force_enabled(true).unwrap();
        Self { settings, haptic: HapticState::new(state), device, contacts, ticks: 0 }
    }

    pub fn guarded(mut self, guard: Guard) -> Self {
        self.haptic.guard = Some(guard);
        self
    }

    pub fn time(&self) -> f64 {
        self.ticks as f64 * DT
    }

    /// One tick, with the hand on its way to `goal` (z and its velocity).
    pub fn advance(&mut self, goal: f64, velocity: f64) -> Tick {
        self.ticks += 1;
        let now = self.time();
        self.device.set_goal(&DeviceSample {
            time: now,
            linear_velocity: Vector3::z() * velocity,
            ..at(goal)
        });
        self.device.advance(DT);
        let sample = self.device.read().unwrap();
        let sample = DeviceSample { time: now, ..sample };
        let result = tick(&self.settings, &self.haptic, &sample, &self.contacts, now);
        self.haptic = result.after;
        let _ = self.device.write(&result.command);
        result
    }
}

/// Whether a linear loop dies out after a push: its greatest excursion in a window against that in the one before.
pub fn dies_out(mut excursion: impl FnMut(u32) -> f64) -> bool {
    const WINDOW: u32 = 3000;
    let mut window = |from: u32| {
        (from..from + WINDOW).fold(0.0, |most: f64, i| {
            let x = excursion(i).abs();
            // Pushed by micrometres, a loop that comes this far will not come back; its motors may have reached their limit.
            if x < 0.1 { most.max(x) } else { f64::INFINITY }
        })
    };
    let (_, before, after) = (window(0), window(WINDOW), window(2 * WINDOW));
    after.is_finite() && after < before.max(1e-12)
}

/// Whether the loop of a 10 g body at a linear wall dies out.
pub fn linear_loop_dies_out(tool: Tool, device: SimulatedSettings, wall: (f64, f64)) -> bool {
    let mut rig = Rig::new(tool, device, bilateral(wall.0, wall.1), 0.0);
    // A push by the hand's goal would need a hand; the body is struck instead.
    rig.haptic.state.linear_momentum = Vector3::z() * (0.01 * tool.mass);
    dies_out(|_| {
        rig.advance(0.0, 0.0);
        rig.device.position().z
    })
}

/// Whether a wall that is rendered without a body dies out: force = -(k x + b v) of the sample.
pub fn direct_loop_dies_out(device: SimulatedSettings, k: f64, b: f64) -> bool {
    let mut device = SimulatedDevice::new(device, &at(0.0)).unwrap();
    device.set_force_enabled(true).unwrap();
    dies_out(|i| {
        let sample = device.read().unwrap();
        let kick = if i == 0 { 1.0 } else { 0.0 };
        let force = kick - k * sample.position.z - b * sample.linear_velocity.z;
        let _ = device.write(&hapteron::device::DeviceCommand {
            force: Vector3::z() * force,
            torque: Vector3::zeros(),
        });
        device.set_goal(&DeviceSample { time: sample.time + DT, ..at(0.0) });
        device.advance(DT);
        device.position().z
    })
}

/// The largest value that is stable, between two, to 1 %; `None` when even the lower one is not, infinite when the upper one is.
pub fn largest(low: f64, high: f64, stable: impl Fn(f64) -> bool) -> Option<f64> {
    if !stable(low) {
        return None;
    }
    if stable(high) {
        return Some(f64::INFINITY);
    }
    let (mut a, mut b) = (low, high);
    while b / a > 1.01 {
        let c = (a * b).sqrt();
        if stable(c) { a = c } else { b = c }
    }
    Some(a)
}

/// The usual device with a hand.
pub fn premium(hand: HandParameters) -> SimulatedSettings {
    SimulatedSettings::new(model("premium-1.5-6dof").unwrap(), hand)
}
