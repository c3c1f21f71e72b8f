//! The haptic tick.

use super::command::ContactLaw;
use super::grasp::{Buttons, Grip};
use super::{ContactSnapshot, Flags};
use crate::scene::{ContactModel, Scene};
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
    /// For the passes; what it makes of contacts is in the snapshot.
    pub contact_law: ContactLaw,
    /// Those of the device that grasp and clutch.
    pub buttons: Buttons,
    /// How long the force takes from what it was to what it is after a switch, seconds.
    pub blend_time: f64,
}

/// [`Settings::blend_time`] unless it is set otherwise, seconds: longer than a hand's reflex would notice as a blow, shorter than it waits.
pub const BLEND_TIME: f64 = 0.05;

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
            contact_law: ContactLaw { stiffness: scene.contact.stiffness, damping: scene.contact.damping },
            buttons: scene.buttons,
            blend_time: BLEND_TIME,
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
    /// What the hand holds, and where its workspace lies in the world.
    pub grip: Grip,
    /// What the command goes through at the end; none where no one feels it.
    pub guard: Option<Guard>,
}

impl HapticState {
    /// A body without a fault, and a command that nothing guards: for replays.
    #[must_use]
    pub fn new(state: State) -> Self {
        Self { state, fault: None, grip: Grip::new(), guard: None }
    }

    /// A body without a fault, and a guard before the device.
    #[must_use]
    pub fn guarded(state: State, guard: Guard) -> Self {
        Self { guard: Some(guard), ..Self::new(state) }
    }

    /// The device displayed nothing of late: what it is given from now on begins at zero.
    pub fn interrupted(&mut self) {
        if let Some(guard) = &mut self.guard {
            guard.interrupted();
        }
    }

    /// Takes the body's momentum away.
    pub fn stand_still(&mut self) {
        self.state.linear_momentum = Vector3::zeros();
        self.state.angular_momentum = Vector3::zeros();
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
    /// The same before the guard, which has also left out what the device has no motors for.
    pub wanted: DeviceCommand,
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
    let mut grip = before.grip;
    let scaled = settings.scaling.to_world(sample);
    let handle = grip.follow(&scaled, settings.buttons, &settings.coupling, &before.state, &settings.body);
    let coupling = grip.coupling(&settings.coupling);
    let mut next = if stands_still(settings, &grip) {
        stopped(&before.state)
    } else {
        let contact = contact_force(settings, contacts);
        let problem = Problem {
            body: &settings.body,
            coupling: &coupling,
            handle: &handle,
            contact,
            gravity: settings.gravity,
        };
        step(&problem, &before.state, settings.time_step, settings.method)
    };
    if !grip.is_held() {
        // An open hand has no deviation from anything.
        (next.deviation, next.angle) = (0.0, 0.0);
    }
    let mut flags = Flags::from_status(next.status).with(contacts.flags()).with(grip.flags());
    let fault = before.fault.or_else(|| next.status.is_fault().then_some(flags));
    let feedback = DeviceCommand { force: next.feedback.force, torque: next.feedback.torque };
    let felt = if grip.feels() { settings.scaling.to_device(&feedback) } else { DeviceCommand::zero() };
    let mut command = grip.blended(felt, settings.time_step / settings.blend_time);
    if fault.is_some() {
        flags = flags.with(Flags::FAULT_LATCHED);
        command = DeviceCommand::zero();
        grip.silence();
        next = Step { state: before.state, status: next.status, ..stopped(&before.state) };
    }
    let contact_age = now - contacts.time();
    let wanted = command;
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
        after: HapticState { state: next.state, fault, grip, guard },
        handle,
        step: next,
        command,
        wanted,
        contact_age,
        flags,
    }
}

/// Whether there is nothing to integrate: while paused, and without a coupling by the quasi-static method, which balances one.
fn stands_still(settings: &Settings, grip: &Grip) -> bool {
    grip.is_paused() || (!grip.is_held() && settings.method == Method::QuasiStatic)
}

fn contact_force<'a>(settings: &Settings, contacts: &'a ContactSnapshot) -> ContactForce<'a> {
    match settings.contact_model {
        // Just switched: the snapshot was made for planes.
        ContactModel::Linearized | ContactModel::Held if !contacts.is_linearized() => {
            ContactForce::Planes(contacts.planes())
        }
        ContactModel::Planes => ContactForce::Planes(contacts.planes()),
        ContactModel::Linearized => ContactForce::Linearized(contacts.linearized()),
        ContactModel::Held => ContactForce::Held(contacts.linearized()),
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
