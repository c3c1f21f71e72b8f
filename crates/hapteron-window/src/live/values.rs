//! The parameters that may change while a scene runs.

use hapteron::dynamics::{Method, RigidBody};
use hapteron::scene::{ContactModel, Scene, file};
use hapteron::session::{Command, CommandError, Gains};
use nalgebra::Vector3;

/// All of them, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values {
    /// kg.
    pub mass: f64,
    /// Springs and dampers between handle and body.
    pub gains: Gains,
    /// Of contact planes, N/m.
    pub contact_stiffness: f64,
    /// Of contact planes, N s/m.
    pub contact_damping: f64,
    /// m/s^2, world.
    pub gravity: [f64; 3],
    /// Integration.
    pub method: Method,
    /// How contacts are used between two passes.
    pub contact_model: ContactModel,
}

/// Integrators with what people call them, and how one knows them.
pub const METHODS: [(Method, &str, &str); 5] = [
    (
        Method::BackwardEuler,
        "Backward Euler",
        "Implicit, one linear solve. The paper's method: light bodies and stiff contact stay stable.",
    ),
    (Method::BackwardEulerNewton, "Backward Euler, Newton", "Fully implicit: up to eight solves a tick."),
    (
        Method::RungeKutta4,
        "Runge-Kutta IV",
        "Explicit, fourth order. Unstable for light bodies on a stiff coupling: try a mass below 30 g.",
    ),
    (Method::ForwardEuler, "Forward Euler", "Explicit, first order. Unstable sooner still."),
    (Method::QuasiStatic, "Quasi-static", "No inertia: coupling and contacts in balance at every tick."),
];

/// Contact models with what people call them, and how one knows them.
pub const MODELS: [(ContactModel, &str, &str); 3] = [
    (ContactModel::Planes, "Planes", "Contact planes are evaluated anew at every tick and never pull."),
    (
        ContactModel::Linearized,
        "Linearized (Eq. 30)",
        "The last contact force, extrapolated by its Jacobian: the paper's model.",
    ),
    (
        ContactModel::Held,
        "Held",
        "The last contact force stays until the next contact pass: stiff contact buzzes.",
    ),
];

impl Values {
    /// Those of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let coupling = &scene.file.coupling;
        let (linear_stiffness, angular_stiffness) =
            (scene.coupling.linear_stiffness(), scene.coupling.angular_stiffness());
        Self {
            mass: scene.body.mass(),
            gains: Gains {
                linear_stiffness,
                linear_damping: coupling.linear_damping.unwrap_or_default(),
                angular_stiffness,
                angular_damping: coupling.angular_damping.unwrap_or_default(),
                max_force: coupling.max_force,
                max_torque: coupling.max_torque,
            },
            contact_stiffness: scene.contact.stiffness,
            contact_damping: scene.contact.damping,
            gravity: scene.gravity.into(),
            method: scene.method,
            contact_model: scene.contact.model,
        }
    }

    /// What has to be told to a session that runs with `before`, for a scene.
    pub fn commands(&self, before: &Self, scene: &Scene) -> Vec<Result<Command, CommandError>> {
        let mut commands = Vec::new();
        if self.gains != before.gains {
            commands.push(Command::coupling(&self.gains));
        }
        let contact = |v: &Self| (v.contact_stiffness, v.contact_damping);
        if contact(self) != contact(before) {
            commands.push(Command::contact(self.contact_stiffness, self.contact_damping));
        }
        if self.mass != before.mass {
            commands.push(Command::mass(scene, self.mass));
        }
        if self.gravity != before.gravity {
            commands.push(Command::gravity(self.gravity));
        }
        if self.method != before.method {
            commands.push(Ok(Command::SetMethod(self.method)));
        }
        if self.contact_model != before.contact_model {
            commands.push(Ok(Command::SetContactModel(self.contact_model)));
        }
        commands
    }

    /// A scene that starts with these values, and its file with them written in.
    ///
    /// # Errors
    /// Numbers that no coupling or body has.
    pub fn applied_to(&self, scene: &Scene) -> Result<Scene, CommandError> {
        let mut changed = scene.clone();
        if let Command::SetCoupling(springs) = Command::coupling(&self.gains)? {
            let (position, orientation) = scene.coupling.grasp();
            changed.coupling = springs.with_grasp(position, orientation);
        }
        let inertia = scene.body.inertia_b() * (self.mass / scene.body.mass());
        changed.body = RigidBody::new(self.mass, inertia).map_err(CommandError::Mass)?;
        let ratio = self.mass / scene.body.mass();
        changed.start.linear_momentum *= ratio;
        changed.start.angular_momentum *= ratio;
        changed.contact.stiffness = self.contact_stiffness;
        changed.contact.damping = self.contact_damping;
        changed.contact.model = self.contact_model;
        changed.gravity = Vector3::from(self.gravity);
        changed.method = self.method;
        let rows = inertia;
        let f = &mut changed.file;
        f.body.mass = Some(self.mass);
        f.body.inertia = Some(std::array::from_fn(|r| std::array::from_fn(|c| rows[(r, c)])));
        f.coupling.linear_stiffness = Some(self.gains.linear_stiffness);
        f.coupling.linear_damping = Some(self.gains.linear_damping);
        f.coupling.angular_stiffness = Some(self.gains.angular_stiffness);
        f.coupling.angular_damping = Some(self.gains.angular_damping);
        f.coupling.max_force = self.gains.max_force;
        f.coupling.max_torque = self.gains.max_torque;
        f.contact.stiffness = Some(self.contact_stiffness);
        f.contact.damping = Some(self.contact_damping);
        f.contact.model = Some(self.contact_model);
        f.scene.gravity = Some(self.gravity);
        f.integrator.method = Some(in_file(self.method));
        Ok(changed)
    }
}

/// As it stands in scene files.
fn in_file(method: Method) -> file::Method {
    match method {
        Method::BackwardEuler => file::Method::BackwardEuler,
        Method::BackwardEulerNewton => file::Method::BackwardEulerNewton,
        Method::RungeKutta4 => file::Method::RungeKutta4,
        Method::ForwardEuler => file::Method::ForwardEuler,
        Method::QuasiStatic => file::Method::QuasiStatic,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapteron::scenes;

    fn scene() -> Scene {
        Scene::from_file(scenes::builtin("spoon_in_cup").unwrap()).unwrap()
    }

    /// Would catch a slider that changes nothing, or one that changes what was not touched.
    #[test]
    fn only_what_has_changed_is_told() {
        let scene = scene();
        let before = Values::of(&scene);
        assert!(before.commands(&before, &scene).is_empty());
        let after = Values { mass: 0.05, method: Method::RungeKutta4, ..before };
        let commands: Vec<Command> =
            after.commands(&before, &scene).into_iter().collect::<Result<_, _>>().unwrap();
        assert!(
            matches!(commands[..], [Command::SetMass(b), Command::SetMethod(Method::RungeKutta4)] if b.mass() == 0.05)
        );
    }

    /// Would catch a saved scene that is not the one that ran: it is read again and must be the same.
    #[test]
    fn a_saved_scene_has_the_values_that_ran() {
        let scene = scene();
        let mut values = Values::of(&scene);
        values.mass = 0.037;
        values.gains.linear_stiffness = 321.0;
        values.gains.max_force = Some(7.0);
        values.contact_stiffness = 1234.0;
        values.gravity = [0.0, 0.0, -9.81];
        values.method = Method::QuasiStatic;
        values.contact_model = ContactModel::Held;
        let changed = values.applied_to(&scene).unwrap();
        let text = changed.to_toml().unwrap();
        let again = Scene::parse(&text, "again", std::path::Path::new("."), &Default::default()).unwrap();
        assert_eq!(Values::of(&again), values);
        assert_eq!(again.coupling, changed.coupling);
        assert!((again.body.inertia_b() - changed.body.inertia_b()).amax() < 1e-15);
    }
}
