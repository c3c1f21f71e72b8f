//! The scenes that come with the library: those of the paper's section 7.

use crate::scene::file::{
    Body, Contact, ContactThread, Coupling, General, Hand, Integrator, Method, Obstacle, SceneFile,
};

/// Inertia of the paper's spoon for one kilogram, about its centre of mass, m^2 (x along it, z up).
pub const SPOON_INERTIA_PER_MASS: [[f64; 3]; 3] =
    [[1.05601e-4, 0.0, -2.75931e-4], [0.0, 3.723482e-3, 0.0], [-2.75931e-4, 0.0, 3.751521e-3]];

/// Where the spoon is held, from its centre of mass, metres.
pub const SPOON_GRIP: [f64; 3] = [0.052258, 0.0, 0.011393];

/// Names of the scenes, as [`builtin`] knows them.
pub const NAMES: [&str; 2] = ["spoon_in_free_space", "spoon_in_cup"];

/// A scene by its name.
#[must_use]
pub fn builtin(name: &str) -> Option<SceneFile> {
    match name {
        "spoon_in_free_space" => Some(spoon_in_free_space(0.01, Method::BackwardEuler)),
        "spoon_in_cup" => Some(spoon_in_cup(0.01, 2e3, Method::BackwardEuler)),
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
        contact_thread: ContactThread { period: Some(1e-3), latency: Some(0.0) },
        hand: Hand { trajectory: Some("builtin:spoon-in-cup".to_owned()), ..Hand::default() },
        ..spoon_in_free_space(mass, method)
    }
}

fn named(name: &str) -> General {
    General { name: Some(name.to_owned()), ..General::default() }
}
