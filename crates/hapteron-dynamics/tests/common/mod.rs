//! Simple and seeded random bodies, states and forces.
#![allow(dead_code)] // Each test file uses its share.

use hapteron_dynamics::{
    ContactForce, ContactPlane, Coupling, Handle, Method, Problem, RigidBody, Spring, State,
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

pub const METHODS: [Method; 5] = [
    Method::BackwardEuler,
    Method::BackwardEulerNewton,
    Method::RungeKutta4,
    Method::ForwardEuler,
    Method::QuasiStatic,
];

pub fn still_handle() -> Handle {
    Handle {
        position: Vector3::zeros(),
        orientation: UnitQuaternion::identity(),
        linear_velocity: Vector3::zeros(),
        angular_velocity: Vector3::zeros(),
    }
}

pub fn coupling(k: f64, b: f64, k_turn: f64, b_turn: f64) -> Coupling {
    let spring = |stiffness| Spring { stiffness, limit: None };
    Coupling::new(spring(k), b, spring(k_turn), b_turn, Vector3::zeros(), UnitQuaternion::identity()).unwrap()
}

pub fn ball(mass: f64) -> RigidBody {
    RigidBody::new(mass, Matrix3::identity() * (mass * 1e-4)).unwrap()
}

pub fn problem<'a>(body: &'a RigidBody, coupling: &'a Coupling, handle: &'a Handle) -> Problem<'a> {
    Problem { body, coupling, handle, contact: ContactForce::None, gravity: Vector3::zeros() }
}

/// A body at rest at the origin, in the world's orientation.
pub fn at_rest(body: &RigidBody) -> State {
    let zero = Vector3::zeros();
    State::moving(body, zero, &UnitQuaternion::identity(), &zero, &zero)
}

/// The spoon of the paper's Fig. 2 with its coupling; damping and inertia, which the paper leaves out, are chosen to meet its figures.
pub fn spoon(mass: f64) -> (RigidBody, Coupling) {
    let (xx, xz, yy, zz) = (1.05601e-4, -2.75931e-4, 3.723_482e-3, 3.751_521e-3);
    let inertia = Matrix3::new(xx, 0.0, xz, 0.0, yy, 0.0, xz, 0.0, zz) * mass;
    let spring = |stiffness| Spring { stiffness, limit: None };
    let grip = Vector3::new(0.052_258, 0.0, 0.011_393);
    let coupling =
        Coupling::new(spring(200.0), 2.0, spring(0.6), 0.0166, grip, UnitQuaternion::identity()).unwrap();
    (RigidBody::new(mass, inertia).unwrap(), coupling)
}

pub struct Random(SmallRng);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(SmallRng::seed_from_u64(seed))
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    /// Even over the logarithm.
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    pub fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.uniform(-size, size))
    }

    pub fn turn(&mut self, most: f64) -> UnitQuaternion<f64> {
        let axis = nalgebra::Unit::new_normalize(self.vector(1.0) + Vector3::new(1e-3, 0.0, 0.0));
        UnitQuaternion::from_axis_angle(&axis, self.uniform(-most, most))
    }

    /// A body of 0.5 g to 10 kg with moments like those of a box of 1 to 30 cm.
    pub fn body(&mut self) -> RigidBody {
        let mass = self.scale(5e-4, 10.0);
        let s = Vector3::from_fn(|_, _| self.scale(0.01, 0.3)).map(|v| v * v / 12.0);
        let r = self.turn(3.0).to_rotation_matrix().into_inner();
        let moments = Matrix3::from_diagonal(&Vector3::new(s.y + s.z, s.z + s.x, s.x + s.y));
        let inertia = r * moments * r.transpose() * mass;
        RigidBody::new(mass, (inertia + inertia.transpose()) * 0.5).unwrap()
    }

    /// Spins of up to 100 rad/s; every fourth state is turned by almost pi.
    pub fn state(&mut self, body: &RigidBody) -> State {
        let turn = if self.uniform(0.0, 1.0) < 0.25 {
            let axis = nalgebra::Unit::new_normalize(self.vector(1.0) + Vector3::new(0.0, 1e-3, 0.0));
            UnitQuaternion::from_axis_angle(&axis, core::f64::consts::PI - self.scale(1e-6, 0.1))
        } else {
            self.turn(3.1)
        };
        let spin = self.scale(0.01, 100.0);
        State::moving(body, self.vector(0.1), &turn, &self.vector(1.0), &self.vector(spin))
    }

    /// A handle near the body, turned against it by at most 2.9 rad.
    pub fn handle(&mut self, state: &State) -> Handle {
        Handle {
            position: state.position + self.vector(0.05),
            orientation: self.turn(2.0) * state.unit_quaternion(),
            linear_velocity: self.vector(1.0),
            angular_velocity: self.vector(10.0),
        }
    }

    pub fn coupling(&mut self, saturating: bool) -> Coupling {
        let linear =
            Spring { stiffness: self.scale(10.0, 1e4), limit: saturating.then(|| self.scale(0.5, 50.0)) };
        let angular =
            Spring { stiffness: self.scale(0.01, 10.0), limit: saturating.then(|| self.scale(0.01, 1.0)) };
        let (b, b_turn) = (self.scale(0.1, 20.0), self.scale(1e-3, 0.1));
        // Coupling frames far from the body's, so that the angle is not small.
        Coupling::new(linear, b, angular, b_turn, self.vector(0.1), self.turn(0.9)).unwrap()
    }

    pub fn plane(&mut self, state: &State) -> ContactPlane {
        let point = self.vector(0.1);
        let normal = self.vector(1.0).normalize();
        let on_plane = state.position + state.unit_quaternion() * point + self.vector(1e-3);
        let stiffness = self.scale(100.0, 1e5);
        ContactPlane::new(point, &on_plane, normal, stiffness, self.scale(0.1, 100.0), 5e-4)
    }
}
