//! Grasp, release and clutch: what the hand holds, how the device's workspace lies in the world, and how the force goes over from one
//! to the next.
//!
//! Whatever is switched, the force that the hand feels goes on from where it was, over [`super::Settings::blend_time`]:
//! - what is felt *anew* (grasp, clutch let go, resume, re-arm) comes with a gain that rises from zero;
//! - what was felt *before* (release, clutch, pause, another integrator or contact model) leaves a difference to the last command that is added and
//!   fades to zero;
//! - another stiffness and damping of coupling or contacts is slewed to, so that the body, which is light, is not thrown either.
//!
//! So a switch changes the command by nothing in its own tick. Everything here is part of [`super::tick()`]: no clock, no allocation.

use super::{ContactLaw, Flags};
use hapteron_device::{DeviceCommand, DeviceSample};
use hapteron_dynamics::{Coupling, Handle, RigidBody, State};
use nalgebra::{UnitQuaternion, Vector3};

/// Where the device's workspace was put by the clutch: positions are moved, and the handle is turned about its own axes, so that a
/// turn of the hand about an axis stays a turn about that axis and torques need no turning back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Index {
    offset: Vector3<f64>,
    turn: UnitQuaternion<f64>,
}

impl Index {
    /// The one that brings a handle (in the world's scale) onto a goal.
    fn between(handle: &Handle, goal: &Handle) -> Self {
        let turn = handle.orientation.inverse() * goal.orientation;
        Self {
            offset: goal.position - handle.position,
            turn: UnitQuaternion::new_normalize(turn.into_inner()),
        }
    }

    fn apply(&self, handle: &Handle) -> Handle {
        Handle {
            position: handle.position + self.offset,
            orientation: handle.orientation * self.turn,
            ..*handle
        }
    }
}

/// The hand's hold of body and world, from tick to tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    held: bool,
    /// Nothing moves and nothing is felt.
    paused: bool,
    /// The grasp that was recorded last; none: that of the scene.
    grasp: Option<(Vector3<f64>, UnitQuaternion<f64>)>,
    index: Option<Index>,
    /// Where the handle stands while the clutch is pressed.
    parked: Option<Handle>,
    /// The clutch as told by command, beside the device's button.
    clutch: bool,
    /// To grasp or let go in the next tick, as told by command.
    wish: Option<bool>,
    /// In the next tick the workspace is to be put where the coupling has no deviation.
    attach: bool,
    /// Something else was switched since the last tick.
    switched: bool,
    /// Of the last tick; one that is down at the start was not pressed.
    buttons: u32,
    /// The last command.
    sent: DeviceCommand,
    /// What is left of the old command: the difference and its share.
    blend: (DeviceCommand, f64),
    /// What is felt anew begins with the next command.
    engaged: bool,
    /// Share of the coupling's feedback that is felt.
    gain: f64,
    /// The coupling that is slewed from, and how far it is.
    slew: Option<(Coupling, f64)>,
    /// The same of the contacts.
    law_slew: Option<(ContactLaw, f64)>,
}

/// Bits of the buttons that grasp and clutch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Buttons {
    /// Each press lets go, or grasps again.
    pub grasp: u32,
    /// While it is down the handle moves and the world does not.
    pub clutch: u32,
}

impl Grip {
    /// The body in the hand as the scene says.
    #[must_use]
    pub fn new() -> Self {
        Self {
            held: true,
            paused: false,
            grasp: None,
            index: None,
            parked: None,
            clutch: false,
            wish: None,
            attach: false,
            switched: false,
            buttons: u32::MAX,
            sent: DeviceCommand::zero(),
            blend: (DeviceCommand::zero(), 0.0),
            engaged: false,
            gain: 1.0,
            slew: None,
            law_slew: None,
        }
    }

    /// Whether the hand holds the body.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// Whether the handle moves without the world.
    #[must_use]
    pub fn is_clutched(&self) -> bool {
        self.parked.is_some()
    }

    /// Whether the body stands still.
    #[must_use]
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// Whether the hand feels the coupling.
    #[must_use]
    pub(super) fn feels(&self) -> bool {
        self.held && !self.paused && self.parked.is_none()
    }

    /// What it is, as bits of a tick.
    pub(super) fn flags(&self) -> Flags {
        let mut flags = Flags::default();
        for (bit, set) in [
            (Flags::RELEASED, !self.held),
            (Flags::CLUTCHED, self.is_clutched()),
            (Flags::PAUSED, self.paused),
        ] {
            if set {
                flags = flags.with(bit);
            }
        }
        flags
    }

    pub(super) fn wish(&mut self, held: bool) {
        self.wish = Some(held);
    }

    pub(super) fn clutch(&mut self, pressed: bool) {
        self.clutch = pressed;
    }

    /// Stops and goes on; goes on from where the body stands.
    pub(super) fn pause(&mut self, paused: bool) {
        self.attach |= self.paused && !paused;
        self.switched |= self.paused != paused;
        self.paused = paused;
    }

    /// From the next tick on the handle stands where the coupling has no deviation.
    pub(super) fn attach(&mut self) {
        self.attach = true;
    }

    /// Something that changes the force is different from the next tick on.
    pub(super) fn switch(&mut self) {
        self.switched = true;
    }

    /// From now on the coupling goes from this one's springs and dampers to those of the settings.
    pub(super) fn slew_from(&mut self, springs: &Coupling) {
        let now = self.slewed(springs);
        self.slew = Some((now, 0.0));
    }

    fn slewed(&self, springs: &Coupling) -> Coupling {
        match &self.slew {
            Some((from, share)) => from.toward(springs, *share),
            None => *springs,
        }
    }

    /// From now on contacts go from this stiffness and damping to those of the settings.
    pub(super) fn slew_law_from(&mut self, law: &ContactLaw) {
        let now = self.contact_law(law);
        self.law_slew = Some((now, 0.0));
    }

    /// What contacts are made with now, when the settings say `wanted`.
    #[must_use]
    pub fn contact_law(&self, wanted: &ContactLaw) -> ContactLaw {
        let Some((from, share)) = &self.law_slew else { return *wanted };
        let mix = |a: f64, b: f64| a + (b - a) * share;
        ContactLaw {
            stiffness: mix(from.stiffness, wanted.stiffness),
            damping: mix(from.damping, wanted.damping),
        }
    }

    /// The coupling as it is now.
    pub(super) fn coupling(&self, springs: &Coupling) -> Coupling {
        let springs = &self.slewed(springs);
        let grasped = match &self.grasp {
            Some((position, orientation)) => springs.with_grasp(*position, *orientation),
            None => *springs,
        };
        if self.held { grasped } else { grasped.released() }
    }

    /// Follows buttons and wishes, and gives the handle in the world. `sample` is in the world's scale, `springs` the scene's coupling.
    ///
    /// Real time: constant work. A sample that is not finite switches nothing.
    pub(super) fn follow(
        &mut self,
        sample: &DeviceSample,
        buttons: Buttons,
        springs: &Coupling,
        state: &State,
        body: &RigidBody,
    ) -> Handle {
        let scaled = crate::scene::handle_at(sample);
        let indexed = |index: &Option<Index>| match index {
            Some(index) => index.apply(&scaled),
            None => scaled,
        };
        if !scaled.is_finite() {
            return scaled;
        }
        let pressed = sample.buttons & !self.buttons;
        self.buttons = sample.buttons;
        let clutched = self.clutch || sample.buttons & buttons.clutch != 0;
        match (self.parked, clutched) {
            (None, true) => {
                let still = Vector3::zeros();
                self.parked =
                    Some(Handle { linear_velocity: still, angular_velocity: still, ..indexed(&self.index) });
                self.switched = true;
            }
            (Some(place), false) => {
                self.index = Some(Index::between(&scaled, &place));
                self.parked = None;
                self.engaged = true;
            }
            _ => {}
        }
        if std::mem::take(&mut self.attach) {
            let goal = self.coupling(springs).without_deviation(state, body);
            self.index = Some(Index::between(&scaled, &goal));
            if let Some(parked) = &mut self.parked {
                *parked = Handle { position: goal.position, orientation: goal.orientation, ..*parked };
            }
            self.engaged = true;
        }
        let handle = self.parked.unwrap_or_else(|| indexed(&self.index));
        let toggled = (pressed & buttons.grasp != 0).then_some(!self.held);
        if let Some(held) = self.wish.take().or(toggled).filter(|held| *held != self.held) {
            self.held = held;
            (self.engaged, self.switched) = (held, true);
            if held {
                self.grasp = Some(springs.grasped(&handle, state).grasp());
            }
        }
        handle
    }

    /// What is sent in place of `command`, so that a switch is not felt as a step. `share` is what a blend loses in a tick.
    ///
    /// Real time: constant work.
    pub(super) fn blended(&mut self, command: DeviceCommand, share: f64) -> DeviceCommand {
        let engaged = std::mem::take(&mut self.engaged);
        if engaged {
            self.gain = 0.0;
        }
        // One by one, so that a gain of 1 leaves every bit as it is.
        let felt = if self.gain < 1.0 {
            DeviceCommand { force: command.force * self.gain, torque: command.torque * self.gain }
        } else {
            command
        };
        if std::mem::take(&mut self.switched) || engaged {
            let difference =
                DeviceCommand { force: self.sent.force - felt.force, torque: self.sent.torque - felt.torque };
            self.blend = (difference, 1.0);
        }
        let (difference, left) = self.blend;
        let mut sent = felt;
        if left > 0.0 {
            sent.force += difference.force * left;
            sent.torque += difference.torque * left;
        }
        self.blend.1 = (left - share).max(0.0);
        self.gain = (self.gain + share).min(1.0);
        if let Some((_, done)) = &mut self.slew {
            *done += share;
        }
        self.slew = self.slew.filter(|(_, done)| *done < 1.0);
        if let Some((_, done)) = &mut self.law_slew {
            *done += share;
        }
        self.law_slew = self.law_slew.filter(|(_, done)| *done < 1.0);
        self.sent = sent;
        sent
    }

    /// After a fault: nothing is sent and nothing is left to fade.
    pub(super) fn silence(&mut self) {
        self.sent = DeviceCommand::zero();
        self.blend.1 = 0.0;
    }
}

impl Default for Grip {
    fn default() -> Self {
        Self::new()
    }
}
