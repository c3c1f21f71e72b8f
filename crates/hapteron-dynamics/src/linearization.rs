//! The one concept of force: given the state, a wrench and its derivatives.

use crate::mass::RigidBody;
use crate::quaternion::{angular_velocity_derivative, rotation, turn_matrix};
use crate::state::State;
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

/// The derivative of a wrench (force over torque) by the 13 components of the state x, q, P, L.
pub type StateJacobian = SMatrix<f64, 6, 13>;

/// The sum of some forces at a state: wrench at the centre of mass, and its derivatives.
///
/// Forces depend on the state through position and orientation, and through the velocities v and omega. The derivatives are
/// by a displacement with a small turn (rotation vector, world axes), and by (v, omega); [`Linearization::by_state`] turns them into
/// the Jacobian by the state that the paper writes. Contact planes add one product of two six-vectors each this way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearization {
    /// Force over torque at the centre of mass, world axes, N and N m.
    pub wrench: Vector6<f64>,
    /// By displacement (m) and turn (rad).
    pub by_position: Matrix6<f64>,
    /// By linear (m/s) and angular (rad/s) velocity.
    pub by_velocity: Matrix6<f64>,
}

impl Linearization {
    /// No force, to which forces are added. Real time: constant work.
    #[must_use]
    pub fn zero() -> Self {
        Self { wrench: Vector6::zeros(), by_position: Matrix6::zeros(), by_velocity: Matrix6::zeros() }
    }

    /// The Jacobian by the state: the blocks of Eqs. 13 to 20 and 22 to 29, rows F and T, columns x, q, P, L.
    ///
    /// `motion` must be that of the state at which the forces were added. Real time: constant work.
    #[must_use]
    pub fn by_state(&self, motion: &Motion) -> StateJacobian {
        let mut j = StateJacobian::zeros();
        let by_omega = self.by_velocity.fixed_columns::<3>(3);
        let by_turn = self.by_position.fixed_columns::<3>(3) + by_omega * motion.omega_by_turn;
        j.fixed_columns_mut::<3>(0).copy_from(&self.by_position.fixed_columns::<3>(0));
        j.fixed_columns_mut::<4>(3).copy_from(&(by_turn * motion.turn_by_q));
        j.fixed_columns_mut::<3>(7)
            .copy_from(&(self.by_velocity.fixed_columns::<3>(0) * motion.inverse_mass));
        j.fixed_columns_mut::<3>(10).copy_from(&(by_omega * motion.inverse_inertia_w));
        j
    }
}

/// What the forces and the linear systems need to know about a state.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// R, body axes to world axes.
    pub rotation: Matrix3<f64>,
    /// v of the centre of mass, world, m/s.
    pub v: Vector3<f64>,
    /// omega, world axes, rad/s.  Eq. 3.
    pub omega: Vector3<f64>,
    /// 1/m, 1/kg.
    pub inverse_mass: f64,
    /// R M^-1 R^T, world axes, 1/(kg m^2).
    pub inverse_inertia_w: Matrix3<f64>,
    /// The derivative of omega by a turn (rotation vector, world axes), 1/s.  Eq. 11 without its factor G.
    pub omega_by_turn: Matrix3<f64>,
    /// G: the turn for a change of q (rotation vector, world axes).
    pub turn_by_q: nalgebra::Matrix3x4<f64>,
}

impl Motion {
    /// At a state.
    ///
    /// Requires a unit quaternion; its derivatives are wrong in proportion to the deviation of |q| from 1, its values are not.
    /// Never fails. Real time: constant work.
    #[must_use]
    pub fn of(state: &State, body: &RigidBody) -> Self {
        let rotation = rotation(&state.orientation);
        let inverse_inertia_w = rotation * body.inverse_inertia_b() * rotation.transpose();
        let inverse_mass = 1.0 / body.mass();
        let omega = inverse_inertia_w * state.angular_momentum;
        Self {
            rotation,
            v: state.linear_momentum * inverse_mass,
            omega,
            inverse_mass,
            inverse_inertia_w,
            omega_by_turn: angular_velocity_derivative(&omega, &state.angular_momentum, &inverse_inertia_w),
            turn_by_q: turn_matrix(&state.orientation),
        }
    }
}
