//! What a session can be told while it runs.

use super::{HapticState, Settings};
use crate::scene::{ContactModel, Scene};
use hapteron_dynamics::{Coupling, CouplingError, Method, RigidBody, RigidBodyError, Spring};
use nalgebra::Vector3;

/// A change, applied between two ticks by [`apply`]; the force that the hand feels goes on without a step (see [`super::grasp`]).
///
/// Its numbers are checked where it is made, so that applying it cannot fail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Springs and dampers of the coupling, at the grasp as it is. Made by [`Command::coupling`].
    SetCoupling(Coupling),
    /// Integration method.
    SetMethod(Method),
    /// How contacts are used between two passes.
    SetContactModel(ContactModel),
    /// Stiffness (N/m) and damping (N s/m) of the contacts of the passes from now on. Made by [`Command::contact`].
    SetContact(ContactLaw),
    /// m/s^2, world.
    SetGravity(Vector3<f64>),
    /// The body with another mass; its velocities stay. Made by [`Command::mass`].
    SetMass(RigidBody),
    /// Goes on after a fault, from where the body stands: the device's workspace is put so that the coupling has no deviation.
    Rearm,
    /// Puts the device's workspace so that the coupling has no deviation.
    Attach,
    /// Grasps where the handle is, or lets go.
    Grasp(bool),
    /// While true the handle moves and the world does not; then it goes on from where it stood.
    Clutch(bool),
    /// While true the body stands still and nothing is felt.
    Pause(bool),
    /// Zero force, and the end.
    Stop,
}

/// Of a contact plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// k, N/m.
    pub stiffness: f64,
    /// b, N s/m.
    pub damping: f64,
}

/// Springs and dampers of a coupling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// k_c, N/m.
    pub linear_stiffness: f64,
    /// b_c, N s/m.
    pub linear_damping: f64,
    /// k_theta, N m/rad.
    pub angular_stiffness: f64,
    /// b_theta, N m s/rad.
    pub angular_damping: f64,
    /// N.
    pub max_force: Option<f64>,
    /// N m.
    pub max_torque: Option<f64>,
}

impl Gains {
    /// Those of a coupling.
    #[must_use]
    pub fn of(coupling: &Coupling) -> Self {
        let ([linear, angular], [linear_damping, angular_damping]) = coupling.springs();
        Self {
            linear_stiffness: linear.stiffness,
            linear_damping,
            angular_stiffness: angular.stiffness,
            angular_damping,
            max_force: linear.limit,
            max_torque: angular.limit,
        }
    }
}

/// A number that a command cannot have.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// Of the coupling.
    #[error("{0}")]
    Coupling(CouplingError),
    /// Of the mass.
    #[error("{0}")]
    Mass(RigidBodyError),
    /// Any other: its name and value.
    #[error("{0} is {1}; it must be finite, and not negative where it is no direction")]
    Number(&'static str, f64),
    /// Too many commands wait for their tick.
    #[error("too many commands at once; send it again a little later")]
    Full,
    /// The session has ended.
    #[error("the session has ended")]
    Ended,
}

impl Command {
    /// Other springs and dampers.
    ///
    /// # Errors
    /// Numbers that no coupling has.
    pub fn coupling(gains: &Gains) -> Result<Self, CommandError> {
        let spring = |stiffness, limit| Spring { stiffness, limit };
        Coupling::new(
            spring(gains.linear_stiffness, gains.max_force),
            gains.linear_damping,
            spring(gains.angular_stiffness, gains.max_torque),
            gains.angular_damping,
            Vector3::zeros(),
            nalgebra::UnitQuaternion::identity(),
        )
        .map(Self::SetCoupling)
        .map_err(CommandError::Coupling)
    }

    /// Another stiffness and damping of contacts.
    ///
    /// # Errors
    /// Numbers that are negative or not finite.
    pub fn contact(stiffness: f64, damping: f64) -> Result<Self, CommandError> {
        for (name, value) in [("contact stiffness", stiffness), ("contact damping", damping)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(CommandError::Number(name, value));
            }
        }
        Ok(Self::SetContact(ContactLaw { stiffness, damping }))
    }

    /// Another acceleration of gravity.
    ///
    /// # Errors
    /// Numbers that are not finite.
    pub fn gravity(gravity: [f64; 3]) -> Result<Self, CommandError> {
        match gravity.into_iter().find(|c| !c.is_finite()) {
            Some(bad) => Err(CommandError::Number("gravity", bad)),
            None => Ok(Self::SetGravity(gravity.into())),
        }
    }

    /// Another mass in kg; the scene's inertia is scaled with it.
    ///
    /// # Errors
    /// A mass that no body has.
    pub fn mass(scene: &Scene, mass: f64) -> Result<Self, CommandError> {
        let inertia = scene.body.inertia_b() * (mass / scene.body.mass());
        RigidBody::new(mass, inertia).map(Self::SetMass).map_err(CommandError::Mass)
    }
}

/// Applies a command before a tick. Real time: constant work, no allocation, never fails. [`Command::Stop`] is the loop's own matter.
pub fn apply(settings: &mut Settings, haptic: &mut HapticState, command: &Command) {
    let grip = &mut haptic.grip;
    match *command {
        Command::SetCoupling(springs) => {
            let (position, orientation) = settings.coupling.grasp();
            grip.slew_from(&settings.coupling);
            settings.coupling = springs.with_grasp(position, orientation);
        }
        Command::SetMethod(method) => {
            settings.method = method;
            grip.switch();
        }
        Command::SetContactModel(model) => {
            settings.contact_model = model;
            grip.switch();
        }
        Command::SetContact(law) => {
            grip.slew_law_from(&settings.contact_law);
            settings.contact_law = law;
        }
        Command::SetGravity(gravity) => settings.gravity = gravity,
        Command::SetMass(body) => {
            let ratio = body.mass() / settings.body.mass();
            haptic.state.linear_momentum *= ratio;
            haptic.state.angular_momentum *= ratio;
            settings.body = body;
            grip.switch();
        }
        Command::Rearm => {
            let of_guard = haptic.guard.as_ref().is_some_and(|g| g.fault().is_some());
            if haptic.fault.take().is_some() || of_guard {
                haptic.stand_still();
                haptic.grip.attach();
                if let Some(guard) = &mut haptic.guard {
                    guard.rearm();
                }
            }
        }
        Command::Attach => grip.attach(),
        Command::Grasp(held) => grip.wish(held),
        Command::Clutch(pressed) => grip.clutch(pressed),
        Command::Pause(paused) => {
            grip.pause(paused);
            haptic.stand_still();
        }
        Command::Stop => {}
    }
}

const METHODS: [(&str, Method); 5] = [
    ("backward-euler", Method::BackwardEuler),
    ("backward-euler-newton", Method::BackwardEulerNewton),
    ("runge-kutta-4", Method::RungeKutta4),
    ("forward-euler", Method::ForwardEuler),
    ("quasi-static", Method::QuasiStatic),
];
const MODELS: [(&str, ContactModel); 3] = [
    ("planes", ContactModel::Planes),
    ("linearized", ContactModel::Linearized),
    ("held", ContactModel::Held),
];

/// As it stands in a log: a word and numbers that read back to the same bits.
pub(super) fn to_text(command: &Command) -> String {
    let named = |found: Option<&str>| found.unwrap_or_default().to_owned();
    match command {
        Command::SetCoupling(c) => {
            let gains = Gains::of(c);
            let limit = |l: Option<f64>| l.map_or_else(|| "none".to_owned(), |l| l.to_string());
            format!(
                "coupling {} {} {} {} {} {}",
                gains.linear_stiffness,
                gains.linear_damping,
                gains.angular_stiffness,
                gains.angular_damping,
                limit(gains.max_force),
                limit(gains.max_torque)
            )
        }
        Command::SetMethod(m) => {
            format!("method {}", named(METHODS.iter().find(|x| x.1 == *m).map(|x| x.0)))
        }
        Command::SetContactModel(m) => {
            format!("model {}", named(MODELS.iter().find(|x| x.1 == *m).map(|x| x.0)))
        }
        Command::SetContact(law) => format!("contact {} {}", law.stiffness, law.damping),
        Command::SetGravity(g) => format!("gravity {} {} {}", g.x, g.y, g.z),
        Command::SetMass(body) => format!("mass {}", body.mass()),
        Command::Rearm => "rearm".to_owned(),
        Command::Attach => "attach".to_owned(),
        Command::Grasp(on) => format!("grasp {on}"),
        Command::Clutch(on) => format!("clutch {on}"),
        Command::Pause(on) => format!("pause {on}"),
        Command::Stop => "stop".to_owned(),
    }
}

/// What [`to_text`] wrote, for the same scene.
pub(super) fn from_text(text: &str, scene: &Scene) -> Result<Command, String> {
    let unknown = || format!("'{}' is no command", text.chars().take(60).collect::<String>());
    let words: Vec<&str> = text.split(' ').collect();
    let (name, rest) = words.split_first().ok_or_else(unknown)?;
    let number = |i: usize| -> Result<f64, String> {
        rest.get(i).and_then(|w| w.parse().ok()).filter(|x: &f64| x.is_finite()).ok_or_else(unknown)
    };
    let switch = || -> Result<bool, String> { rest.first().and_then(|w| w.parse().ok()).ok_or_else(unknown) };
    let limit = |i: usize| if rest.get(i) == Some(&"none") { Ok(None) } else { number(i).map(Some) };
    let made = match *name {
        "coupling" => Command::coupling(&Gains {
            linear_stiffness: number(0)?,
            linear_damping: number(1)?,
            angular_stiffness: number(2)?,
            angular_damping: number(3)?,
            max_force: limit(4)?,
            max_torque: limit(5)?,
        }),
        "method" => {
            let found = METHODS.iter().find(|m| Some(&m.0) == rest.first());
            return found.map(|m| Command::SetMethod(m.1)).ok_or_else(unknown);
        }
        "model" => {
            let found = MODELS.iter().find(|m| Some(&m.0) == rest.first());
            return found.map(|m| Command::SetContactModel(m.1)).ok_or_else(unknown);
        }
        "contact" => Command::contact(number(0)?, number(1)?),
        "gravity" => Command::gravity([number(0)?, number(1)?, number(2)?]),
        "mass" => Command::mass(scene, number(0)?),
        "rearm" => Ok(Command::Rearm),
        "attach" => Ok(Command::Attach),
        "grasp" => Ok(Command::Grasp(switch()?)),
        "clutch" => Ok(Command::Clutch(switch()?)),
        "pause" => Ok(Command::Pause(switch()?)),
        "stop" => Ok(Command::Stop),
        _ => return Err(unknown()),
    };
    made.map_err(|e| e.to_string())
}
