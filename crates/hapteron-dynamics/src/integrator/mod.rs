//! The five integrators, and the step that a haptic tick makes.

mod backward_euler;
mod elimination;
mod explicit;
mod quasi_static;

pub use backward_euler::{Residual, condensed_solve, dense_solve};

use crate::contact::ContactForce;
use crate::coupling::{Coupling, Handle};
use crate::linearization::Motion;
use crate::mass::RigidBody;
use crate::quaternion::quaternion_rate_matrix;
use crate::state::State;
use crate::status::Status;
use crate::wrench::Wrench;
use nalgebra::{SVector, Vector3};

/// A numerical integration method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Semi-implicit Backward Euler: one linear solve (Eq. 6), and a second one when the first changes which planes push (D8).
    BackwardEuler,
    /// Implicit Backward Euler (Eq. 5) by Newton's method, at most eight solves; what it has then is used.
    BackwardEulerNewton,
    /// Explicit, fourth order.  Section 7.2.
    RungeKutta4,
    /// Explicit, first order.  Section 7.2.
    ForwardEuler,
    /// No inertia and no damping: the linearized balance of forces (Wan and McNeely 2003; D12). The time step plays no part; momenta
    /// are zero afterwards. Needs a coupling with both stiffnesses.
    QuasiStatic,
}

/// All that determines the forces during one step. The handle's sample is that of the step's end, for every method (D7).
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// The body.
    pub body: &'a RigidBody,
    /// The link to the handle.
    pub coupling: &'a Coupling,
    /// The handle at the end of the step.
    pub handle: &'a Handle,
    /// The contacts.
    pub contact: ContactForce<'a>,
    /// The acceleration of gravity, world, m/s^2.
    pub gravity: Vector3<f64>,
}

impl Problem<'_> {
    /// The right side of the equations of motion, f(y): the rates of x (m/s), q (1/s), P (N), L (N m), world.  Eqs. 2 and 4.
    ///
    /// Requires a unit quaternion. Real time: work in proportion to the planes.
    #[must_use]
    pub fn rate(&self, state: &State) -> SVector<f64, 13> {
        let motion = Motion::of(state, self.body);
        let inverse_inertia_b = self.body.inverse_inertia_b();
        let coupling = self.coupling.wrench(self.handle, state, motion.inverse_mass, inverse_inertia_b);
        let contact = self.contact.wrench(state, self.body);
        let sum = coupling + contact;
        let rate = State {
            position: motion.v,
            orientation: quaternion_rate_matrix(&state.orientation) * motion.omega,
            linear_momentum: sum.force + self.gravity * self.body.mass(),
            angular_momentum: sum.torque,
        };
        rate.to_vector()
    }
}

/// The result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// y_i.
    pub state: State,
    /// The coupling's wrench on the body at its centre of mass, at y_i, world, N and N m.  Eq. 12.
    pub coupling: Wrench,
    /// What the device is sent, before scaling: force and torque on the hand at the handle, world, N and N m (D3, D10).
    pub feedback: Wrench,
    /// The contacts' wrench on the body at its centre of mass, at y_i, world, N and N m.  Eq. 21 or 30.
    pub contact: Wrench,
    /// Coupling deviation |x_h - x_c|, metres.
    pub deviation: f64,
    /// Coupling angle |u_c|, radians.
    pub angle: f64,
    /// Anything unusual.
    pub status: Status,
}

/// Angle from which the coupling's turn is reported, radians.
const ANGLE_LIMIT: f64 = 3.0;

/// One step of `dt` seconds from `state` by the given method, and the wrenches at its end.
///
/// Steps 2 to 5 of the haptic thread (section 3.1). Requires a unit quaternion, and keeps it one (D9): with |q| off by e the
/// step is off by a share of about e.
///
/// Never returns a number that is not finite: when one comes in or out, the time step is not positive, or the system is singular, the
/// state stays, all wrenches are zero and the status says so. Real time: bounded work in proportion to the planes, no allocation, no
/// panic (`tests/panic_paths.rs` looks for one in the machine code).
#[must_use]
pub fn step(problem: &Problem<'_>, state: &State, dt: f64, method: Method) -> Step {
    let valid = state.is_finite()
        && state.orientation.norm_squared() > 0.0
        && problem.handle.is_finite()
        && problem.gravity.iter().all(|c| c.is_finite())
        && dt > 0.0
        && dt.is_finite();
    if !valid {
        return failed(state, Status::NON_FINITE);
    }
    let next = match method {
        Method::BackwardEuler => backward_euler::step(problem, state, dt),
        Method::BackwardEulerNewton => backward_euler::newton_step(problem, state, dt),
        Method::RungeKutta4 => Some(explicit::runge_kutta_4(problem, state, dt)),
        Method::ForwardEuler => Some(explicit::forward_euler(problem, state, dt)),
        Method::QuasiStatic => quasi_static::step(problem, state),
    };
    match next {
        Some(next) => finish(problem, state, next),
        None => failed(state, Status::SINGULAR),
    }
}

fn failed(state: &State, status: Status) -> Step {
    let zero = Wrench::zero();
    Step { state: *state, coupling: zero, feedback: zero, contact: zero, deviation: 0.0, angle: 0.0, status }
}

/// Renormalises the quaternion (D9) and evaluates the wrenches at the new state.
fn finish(problem: &Problem<'_>, before: &State, mut state: State) -> Step {
    let length = libm::sqrt(state.orientation.norm_squared());
    if !(length > 0.0 && state.is_finite()) {
        return failed(before, Status::NON_FINITE);
    }
    state.orientation /= length;
    let body = problem.body;
    let coupling =
        problem.coupling.wrench(problem.handle, &state, 1.0 / body.mass(), body.inverse_inertia_b());
    let (feedback, deviation, angle) = problem.coupling.feedback(problem.handle, &state, body);
    let (feedback, limited) = problem.coupling.limited(feedback);
    let contact = problem.contact.wrench(&state, body);
    if !(coupling.is_finite() && feedback.is_finite() && contact.is_finite()) {
        return failed(before, Status::NON_FINITE);
    }
    let mut status = Status::NONE;
    for (bit, set) in [
        (Status::COUPLING_ANGLE_LIMIT, angle > ANGLE_LIMIT),
        (Status::COUPLING_SATURATED, problem.coupling.is_saturated(deviation, angle)),
        (Status::FEEDBACK_LIMITED, limited),
    ] {
        if set {
            status = status.with(bit);
        }
    }
    Step { state, coupling, feedback, contact, deviation, angle, status }
}
