//! Semi-implicit and implicit Backward Euler (Eqs. 5 to 7), in the 13x13 form of the paper and condensed to 6x6.

use super::Problem;
use super::elimination::solve6;
use crate::contact::{Change, ContactForce, add_planes, signature_at_end};
use crate::linearization::{Linearization, Motion, StateJacobian};
use crate::quaternion::{quaternion_rate_derivative, quaternion_rate_matrix};
use crate::state::State;
use nalgebra::{Matrix4, Matrix6, SMatrix, SVector, Vector3, Vector4, Vector6};

/// Newton's method stops when no component changes by more than this share of its scale.
const NEWTON_TOLERANCE: f64 = 1e-12;
const NEWTON_STEPS: usize = 8;

/// The right side of the linear system: dt f for the semi-implicit step (Eq. 6), what is left of Eq. 5 for Newton's method.
///
/// World axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Rows of x, metres.
    pub position: Vector3<f64>,
    /// Rows of q.
    pub orientation: Vector4<f64>,
    /// Rows of P and L, N s and N m s.
    pub momentum: Vector6<f64>,
}

/// The parts of the Jacobian of f by the state that are not constant.  Eq. 7.
#[derive(Clone, Copy)]
pub(crate) struct System {
    pub motion: Motion,
    pub rate_by_q: Matrix4<f64>,
    /// Q R M^-1 R^T.  Eq. 9.
    pub rate_by_l: SMatrix<f64, 4, 3>,
    pub rate: Vector4<f64>,
    pub wrench: Vector6<f64>,
    pub jacobian: StateJacobian,
    /// Which planes push.
    pub signature: u64,
}

impl System {
    /// At a state; `end` is the change over the step by which planes are judged.
    fn at(problem: &Problem<'_>, state: &State, end: Option<&Change>) -> Self {
        let motion = Motion::of(state, problem.body);
        let mut sum = Linearization::zero();
        problem.coupling.linearize(problem.handle, state, &motion.v, &motion.omega, &mut sum);
        let mut signature = 0;
        if let ContactForce::Planes(planes) = problem.contact {
            signature = add_planes(planes, state, &motion, end, &mut sum);
        }
        let mut wrench = sum.wrench;
        let mut jacobian = sum.by_state(&motion);
        match problem.contact {
            ContactForce::Linearized(model) => {
                wrench += model.wrench_at(state);
                jacobian += model.jacobian_at(state);
            }
            ContactForce::Held(model) => {
                wrench += model.wrench;
                jacobian += model.jacobian_at(state);
            }
            ContactForce::None | ContactForce::Planes(_) => {}
        }
        let weight = problem.gravity * problem.body.mass();
        wrench += Vector6::new(weight.x, weight.y, weight.z, 0.0, 0.0, 0.0);
        let q_matrix = quaternion_rate_matrix(&state.orientation);
        Self {
            rate_by_q: quaternion_rate_derivative(&state.orientation, &motion.omega, &motion.omega_by_turn),
            rate_by_l: q_matrix * motion.inverse_inertia_w,
            rate: q_matrix * motion.omega,
            motion,
            wrench,
            jacobian,
            signature,
        }
    }

    /// dt f.
    fn explicit_residual(&self, dt: f64) -> Residual {
        Residual { position: self.motion.v * dt, orientation: self.rate * dt, momentum: self.wrench * dt }
    }

    /// Solves (I - dt J) dy = residual, condensed to the six momenta (D11); exact.
    fn solve(&self, residual: &Residual, dt: f64) -> Option<SVector<f64, 13>> {
        let s = (Matrix4::identity() - self.rate_by_q * dt).try_inverse()?;
        let by_q: SMatrix<f64, 6, 4> = self.jacobian.fixed_columns::<4>(3).into();
        let free = s * residual.orientation;
        let along = s * self.rate_by_l * dt;
        let to_position = dt * self.motion.inverse_mass;
        let by_x = self.jacobian.fixed_columns::<3>(0);
        let mut a = Matrix6::identity();
        let mut left = a.fixed_columns_mut::<3>(0);
        left -= (by_x * to_position + self.jacobian.fixed_columns::<3>(7)) * dt;
        let mut right = a.fixed_columns_mut::<3>(3);
        right -= (by_q * along + self.jacobian.fixed_columns::<3>(10)) * dt;
        let rhs = residual.momentum + (by_x * residual.position + by_q * free) * dt;
        let momentum = solve6(a, rhs)?;
        let (p, l) = (momentum.fixed_rows::<3>(0), momentum.fixed_rows::<3>(3));
        let mut y = SVector::<f64, 13>::zeros();
        y.fixed_rows_mut::<3>(0).copy_from(&(residual.position + p * to_position));
        y.fixed_rows_mut::<4>(3).copy_from(&(free + along * l));
        y.fixed_rows_mut::<6>(7).copy_from(&momentum);
        Some(y)
    }

    /// The same by Gaussian elimination of the whole matrix of Eq. 6.
    fn solve_dense(&self, residual: &Residual, dt: f64) -> Option<SVector<f64, 13>> {
        let mut j = SMatrix::<f64, 13, 13>::zeros();
        j.fixed_view_mut::<3, 3>(0, 7).fill_diagonal(self.motion.inverse_mass);
        j.fixed_view_mut::<4, 4>(3, 3).copy_from(&self.rate_by_q);
        j.fixed_view_mut::<4, 3>(3, 10).copy_from(&self.rate_by_l);
        j.fixed_view_mut::<6, 13>(7, 0).copy_from(&self.jacobian);
        let mut rhs = SVector::<f64, 13>::zeros();
        rhs.fixed_rows_mut::<3>(0).copy_from(&residual.position);
        rhs.fixed_rows_mut::<4>(3).copy_from(&residual.orientation);
        rhs.fixed_rows_mut::<6>(7).copy_from(&residual.momentum);
        (SMatrix::identity() - j * dt).lu().solve(&rhs)
    }

    /// What a change of the state means for a plane.
    fn change(&self, dy: &SVector<f64, 13>) -> Change {
        let turn = self.motion.turn_by_q * dy.fixed_rows::<4>(3);
        let v = dy.fixed_rows::<3>(7) * self.motion.inverse_mass;
        let omega = self.motion.omega_by_turn * turn + self.motion.inverse_inertia_w * dy.fixed_rows::<3>(10);
        let mut change = Change { position: Vector6::zeros(), velocity: Vector6::zeros() };
        change.position.fixed_rows_mut::<3>(0).copy_from(&dy.fixed_rows::<3>(0));
        change.position.fixed_rows_mut::<3>(3).copy_from(&turn);
        change.velocity.fixed_rows_mut::<3>(0).copy_from(&v);
        change.velocity.fixed_rows_mut::<3>(3).copy_from(&omega);
        change
    }
}

/// One linearized step.  Eq. 6. Planes count when they push at its end: after a first solve the set is judged again, once (D8).
pub(super) fn step(problem: &Problem<'_>, state: &State, dt: f64) -> Option<State> {
    let system = System::at(problem, state, None);
    let mut dy = system.solve(&system.explicit_residual(dt), dt)?;
    if let ContactForce::Planes(planes) = problem.contact {
        let end = system.change(&dy);
        if signature_at_end(planes, state, &system.motion, &end) != system.signature {
            let again = System::at(problem, state, Some(&end));
            dy = again.solve(&again.explicit_residual(dt), dt)?;
        }
    }
    Some(State::from_vector(&(state.to_vector() + dy)))
}

/// Backward Euler by Newton's method.  Eq. 5.
pub(super) fn newton_step(problem: &Problem<'_>, state: &State, dt: f64) -> Option<State> {
    let start = state.to_vector();
    let mut y = start;
    for iteration in 0..NEWTON_STEPS {
        let system = System::at(problem, &State::from_vector(&y), None);
        let explicit = system.explicit_residual(dt);
        let left = y - start;
        let momentum: Vector6<f64> = left.fixed_rows::<6>(7).into();
        let residual = Residual {
            position: explicit.position - left.fixed_rows::<3>(0),
            orientation: explicit.orientation - left.fixed_rows::<4>(3),
            momentum: explicit.momentum - momentum,
        };
        let dy = system.solve(&residual, dt)?;
        y += dy;
        let small = dy.iter().zip(y.iter()).all(|(d, v)| d.abs() <= NEWTON_TOLERANCE * (v.abs() + 1e-6));
        if iteration > 0 && small {
            break;
        }
    }
    Some(State::from_vector(&y))
}

/// The increment (x, q, P, L) of the semi-implicit step from the condensed system.  Eq. 6 by D11.
///
/// One solve, with the planes that push at `state`; the quaternion is not yet renormalised. `None` when the system is singular.
/// Real time: work in proportion to the planes.
#[must_use]
pub fn condensed_solve(problem: &Problem<'_>, state: &State, dt: f64) -> Option<SVector<f64, 13>> {
    let system = System::at(problem, state, None);
    system.solve(&system.explicit_residual(dt), dt)
}

/// The increment (x, q, P, L) of the semi-implicit step from the 13x13 system.  Eq. 6 as printed.
///
/// What [`condensed_solve`] is tested against. `None` when the system is singular. Not real time.
#[must_use]
pub fn dense_solve(problem: &Problem<'_>, state: &State, dt: f64) -> Option<SVector<f64, 13>> {
    let system = System::at(problem, state, None);
    system.solve_dense(&system.explicit_residual(dt), dt)
}
