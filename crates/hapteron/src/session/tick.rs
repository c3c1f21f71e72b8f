//! The haptic tick.

use super::{ContactSnapshot, Flags};
use crate::scene::{ContactModel, Scene, handle_at};
use hapteron_device::guard::{Guard, GuardInput};
use hapteron_device::{DeviceCommand, DeviceSample, Scaling};
use hapteron_dynamics::{ContactForce, Coupling, Handle, Method, Problem, RigidBody, State, Step, step};
use nalgebra::Vector3;

/// What stays the same from tick to tick.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// The grasped object.
    pub body: RigidBody,
    /// Between handle and body.
    pub coupling: Coupling,
    /// World, m/s^2.
    pub gravity: Vector3<f64>,
    /// Integration method.
    pub method: Method,
    /// Seconds.
    pub time_step: f64,
    /// Between device and world.
    pub scaling: Scaling,
    /// How contacts are used between two passes.
    pub contact_model: ContactModel,
}

impl Settings {
    /// Those of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self {
            body: scene.body,
            coupling: scene.coupling,
            gravity: scene.gravity,
            method: scene.method,
            time_step: scene.time_step,
            scaling: scene.scaling,
            contact_model: scene.contact.model,
        }
    }
}

/// What a tick hands to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HapticState {
    /// The body.
    pub state: State,
    /// The fault that stopped the session, if one did.
    pub fault: Option<Flags>,
    /// What the command goes through at the end; none where no one feels it.
    pub guard: Option<Guard>,
}

impl HapticState {
    /// A body without a fault, and a command that nothing guards: for replays.
    #[must_use]
    pub fn new(state: State) -> Self {
        Self { state, fault: None, guard: None }
    }

    /// A body without a fault, and a guard before the device.
    #[must_use]
    pub fn guarded(state: State, guard: Guard) -> Self {
        Self { guard: Some(guard), ..Self::new(state) }
    }
}

/// The result of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// For the next tick.
    pub after: HapticState,
    /// The handle in the world.
    pub handle: Handle,
    /// The integration step; its wrenches are zero after a fault.
    pub step: Step,
    /// For the device, in the device's scale.
    pub command: DeviceCommand,
    /// How old the state is that the contacts were found at, seconds.
    pub contact_age: f64,
    /// Anything unusual.
    pub flags: Flags,
}

/// One haptic tick: the step from the last tick to the device sample's time `now` (seconds), and the command for the device.
///
/// Pure: the same arguments give the same bits, and nothing else is read or written. A fault (a number that is not finite, a singular
/// system) latches: from then on the body stays and the command is zero. Section 3.1 of the paper. The command goes through the guard, if
/// there is one, as the last thing; the sample's time and `now` must be of one clock then.
///
/// Real time: no allocation, lock, clock, input or output and no panic; time in proportion to the snapshot's planes, of which there
/// are at most [`super::MAX_PLANES`].
#[must_use]
pub fn tick(
    settings: &Settings,
    before: &HapticState,
    sample: &DeviceSample,
    contacts: &ContactSnapshot,
    now: f64,
) -> Tick {
    let handle = handle_at(&settings.scaling.to_world(sample));
    let contact = match settings.contact_model {
        ContactModel::Planes => ContactForce::Planes(contacts.planes()),
        ContactModel::Linearized => ContactForce::Linearized(contacts.linearized()),
        ContactModel::Held => ContactForce::Held(contacts.linearized()),
    };
    let problem = Problem {
        body: &settings.body,
        coupling: &settings.coupling,
        handle: &handle,
        contact,
        gravity: settings.gravity,
    };
    let mut next = step(&problem, &before.state, settings.time_step, settings.method);
    let mut flags = Flags::from_status(next.status).with(contacts.flags());
    let fault = before.fault.or_else(|| next.status.is_fault().then_some(flags));
    let mut command = settings
        .scaling
        .to_device(&DeviceCommand { force: next.feedback.force, torque: next.feedback.torque });
    if fault.is_some() {
        flags = flags.with(Flags::FAULT_LATCHED);
        command = DeviceCommand::zero();
        next = Step { state: before.state, status: next.status, ..stopped(&before.state) };
    }
    let contact_age = now - contacts.time();
    let mut guard = before.guard;
    if let Some(guard) = &mut guard {
        let sample_age = now - sample.time;
        let simulation_fault = fault.is_some();
        let guarded = guard.pass(&GuardInput {
            command,
            sample: *sample,
            time: now,
            contact_age,
            sample_age,
            simulation_fault,
        });
        command = guarded.command;
        flags = flags.with(Flags::from_guard(guarded.status));
    }
    Tick {
        after: HapticState { state: next.state, fault, guard },
        handle,
        step: next,
        command,
        contact_age,
        flags,
    }
}

/// A step in which nothing moves and nothing pushes.
fn stopped(state: &State) -> Step {
    let zero = hapteron_dynamics::Wrench::zero();
    Step {
        state: *state,
        coupling: zero,
        feedback: zero,
        contact: zero,
        deviation: 0.0,
        angle: 0.0,
        status: hapteron_dynamics::Status::NONE,
    }
}
