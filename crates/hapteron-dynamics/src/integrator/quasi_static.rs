//! The quasi-static approximation: each step goes to the linearized balance of coupling and contact (Wan and McNeely 2003;
//! section 8.1 of the paper; D12).

use super::Problem;
use super::elimination::solve6;
use crate::contact::{ContactForce, add_planes};
use crate::linearization::{Linearization, Motion};
use crate::quaternion::{exponential, product, quaternion_rate_matrix};
use crate::state::State;
use nalgebra::{Matrix6, Vector3, Vector6};

/// Longest step, metres: the linearization holds only near the planes it was made for.
const LONGEST_STEP: f64 = 1e-3;
/// Largest turn in one step, radians.
const LARGEST_TURN: f64 = 0.05;
/// Added to the stiffness, as a share of the coupling's, so that the balance is unique.
const REGULARISATION: f64 = 1e-6;

/// One step towards the balance. `None` when it is not unique: a coupling without angular (or any) stiffness.
pub(super) fn step(problem: &Problem<'_>, state: &State) -> Option<State> {
    let mut resting = *state;
    resting.linear_momentum = Vector3::zeros();
    resting.angular_momentum = Vector3::zeros();
    let mut handle = *problem.handle;
    handle.linear_velocity = Vector3::zeros();
    handle.angular_velocity = Vector3::zeros();
    let motion = Motion::of(&resting, problem.body);
    let mut sum = Linearization::zero();
    problem.coupling.linearize(&handle, &resting, &motion.v, &motion.omega, &mut sum);
    match problem.contact {
        ContactForce::None => {}
        ContactForce::Planes(planes) => {
            add_planes(planes, &resting, &motion, None, &mut sum);
        }
        ContactForce::Linearized(model) | ContactForce::Held(model) => {
            let j = model.jacobian_at(&resting);
            let held = matches!(problem.contact, ContactForce::Held(_));
            sum.wrench += if held { model.wrench } else { model.wrench_at(&resting) };
            let mut left = sum.by_position.fixed_columns_mut::<3>(0);
            left += j.fixed_columns::<3>(0);
            // A turn changes q by Q times the turn.
            let q_matrix = quaternion_rate_matrix(&resting.orientation);
            let mut right = sum.by_position.fixed_columns_mut::<3>(3);
            right += j.fixed_columns::<4>(3) * q_matrix;
        }
    }
    let weight = problem.gravity * problem.body.mass();
    sum.wrench += Vector6::new(weight.x, weight.y, weight.z, 0.0, 0.0, 0.0);
    let (k, k_turn) = (problem.coupling.linear_stiffness(), problem.coupling.angular_stiffness());
    let regular = Vector6::new(k, k, k, k_turn, k_turn, k_turn) * REGULARISATION;
    let stiffness = Matrix6::from_diagonal(&regular) - sum.by_position;
    let change = solve6(stiffness, sum.wrench)?;
    let shorten = |v: Vector3<f64>, most: f64| {
        let length = libm::sqrt(v.norm_squared());
        if length > most { v * (most / length) } else { v }
    };
    resting.position += shorten(change.fixed_rows::<3>(0).into(), LONGEST_STEP);
    let turn = exponential(&shorten(change.fixed_rows::<3>(3).into(), LARGEST_TURN));
    resting.orientation = product(&turn, &resting.orientation);
    Some(resting)
}
