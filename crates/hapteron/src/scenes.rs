//! The scenes that come with the library: those of the paper's section 7.

use crate::scene::file::{
    Body, Contact, ContactThread, Coupling, Device, General, Grip, Hand, Integrator, Method, Obstacle,
    SceneFile,
};

/// Inertia of the paper's spoon for one kilogram, about its centre of mass, m^2 (x along it, z up).
pub const SPOON_INERTIA_PER_MASS: [[f64; 3]; 3] =
    [[1.05601e-4, 0.0, -2.75931e-4], [0.0, 3.723482e-3, 0.0], [-2.75931e-4, 0.0, 3.751521e-3]];

/// Where the spoon is held, from its centre of mass, metres.
pub const SPOON_GRIP: [f64; 3] = [0.052258, 0.0, 0.011393];

/// Where the upper jaw is held, mesh frame, metres: over the middle of its arch.
pub const JAW_GRIP: [f64; 3] = [0.0, 0.03, 0.03];

/// How far the jaws are open at the start and the end, metres.
pub const JAW_OPENING: f64 = 0.006;

/// Names of the scenes, as [`builtin`] knows them.
pub const NAMES: [&str; 3] = ["spoon_in_free_space", "spoon_in_cup", "jaws"];

/// A scene by its name.
#[must_use]
pub fn builtin(name: &str) -> Option<SceneFile> {
    match name {
        "spoon_in_free_space" => Some(spoon_in_free_space(0.01, Method::BackwardEuler)),
        "spoon_in_cup" => Some(spoon_in_cup(0.01, 2e3, Method::BackwardEuler)),
        "jaws" => Some(jaws()),
        _ => None,
    }
}

/// Fig. 2: the spoon moved freely, up to 1.4 m/s, for 2.5 s. Mass in kg.
///
/// Coupling stiffness from the paper, damping and inertia as they had to be for its figures.
#[must_use]
pub fn spoon_in_free_space(mass: f64, method: Method) -> SceneFile {
    SceneFile {
        scene: named("spoon in free space"),
        body: Body {
            mesh: "builtin:spoon".to_owned(),
            mass: Some(mass),
            inertia_per_mass: Some(SPOON_INERTIA_PER_MASS),
            center_of_mass: Some([0.0; 3]),
            ..Body::default()
        },
        coupling: Coupling {
            linear_stiffness: Some(200.0),
            linear_damping: Some(2.0),
            angular_stiffness: Some(0.6),
            angular_damping: Some(0.0166),
            grasp_position: Some(SPOON_GRIP),
            ..Coupling::default()
        },
        integrator: Integrator { method: Some(method), time_step: Some(1e-3) },
        hand: Hand { trajectory: Some("builtin:free-space".to_owned()), ..Hand::default() },
        ..SceneFile::default()
    }
}

/// Fig. 4: the spoon's handle put through the handle of the cup and pressed to one side and the other. Mass in kg, contact
/// stiffness in N/m. The tolerance is such that one contact at the push of 2 N sinks no deeper than in the paper. The contact thread is as fast as the haptic one and without delay.
#[must_use]
pub fn spoon_in_cup(mass: f64, stiffness: f64, method: Method) -> SceneFile {
    SceneFile {
        scene: named("spoon in cup"),
        obstacle: vec![Obstacle { mesh: "builtin:cup".to_owned(), ..Obstacle::default() }],
        contact: Contact {
            stiffness: Some(stiffness),
            tolerance: Some(1e-3),
            max_clusters: Some(8),
            ..Contact::default()
        },
        contact_thread: ContactThread { period: Some(1e-3), latency: Some(0.0), ..ContactThread::default() },
        hand: Hand { trajectory: Some("builtin:spoon-in-cup".to_owned()), ..Hand::default() },
        ..spoon_in_free_space(mass, method)
    }
}

/// Fig. 6: the upper jaw chews on the lower one for 0.9 s.
///
/// Mass, stiffnesses and the scale of the device are the paper's; tolerance, damping and angular coupling are not in it. The contact model and
/// the contact thread are the library's defaults.
#[must_use]
pub fn jaws() -> SceneFile {
    SceneFile {
        scene: named("jaws"),
        body: Body {
            mesh: "builtin:upper_jaw".to_owned(),
            mass: Some(0.01),
            position: Some([0.0, 0.0, JAW_OPENING]),
            ..Body::default()
        },
        obstacle: vec![Obstacle { mesh: "builtin:lower_jaw".to_owned(), ..Obstacle::default() }],
        coupling: Coupling {
            linear_stiffness: Some(500.0),
            linear_damping: Some(3.0),
            angular_stiffness: Some(1.5),
            angular_damping: Some(0.006),
            grasp_position: Some(JAW_GRIP),
            ..Coupling::default()
        },
        contact: Contact { stiffness: Some(5e3), tolerance: Some(5e-4), ..Contact::default() },
        device: Device { position_scale: Some(0.4), ..Device::default() },
        hand: Hand { trajectory: Some("builtin:chewing".to_owned()), ..Hand::default() },
        ..SceneFile::default()
    }
}

/// The demonstration: the jaws of [`jaws`] held closed for 10 s by a hand that feels the force and yields to it.
#[must_use]
pub fn demo() -> SceneFile {
    let hand =
        Hand { trajectory: Some("builtin:holding".to_owned()), grip: Some(Grip::Medium), ..Hand::default() };
    SceneFile { scene: named("jaws held in a hand"), hand, ..jaws() }
}

fn named(name: &str) -> General {
    General { name: Some(name.to_owned()), ..General::default() }
}
