//! The quasi-static approximation: each step goes to the linearized balance of coupling and contact (Wan and McNeely 2003;
//! section 8.1 of the paper; D12).

use super::Problem;
use super::elimination::solve6;
use crate::contact::{Change, ContactForce, add_planes, signature_at_end};
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
///
/// As in an implicit step, planes count when they push at its end: after a first solve the set is judged again, once (D8).
pub(super) fn step(problem: &Problem<'_>, state: &State) -> Option<State> {
    let mut resting = *state;
    resting.linear_momentum = Vector3::zeros();
    resting.angular_momentum = Vector3::zeros();
    let motion = Motion::of(&resting, problem.body);
    let (mut change, signature) = balance(problem, &resting, &motion, None)?;
    if let ContactForce::Planes(planes) = problem.contact {
        let end = Change { position: change, velocity: Vector6::zeros() };
        if signature_at_end(planes, &resting, &motion, &end) != signature {
            (change, _) = balance(problem, &resting, &motion, Some(&end))?;
        }
    }
    resting.position += change.fixed_rows::<3>(0);
    resting.orientation = product(&exponential(&change.fixed_rows::<3>(3).into()), &resting.orientation);
    Some(resting)
}

/// The displacement and turn to the linearized balance, shortened, and the signature of the planes that count.
fn balance(
    problem: &Problem<'_>,
    resting: &State,
    motion: &Motion,
    end: Option<&Change>,
) -> Option<(Vector6<f64>, u64)> {
    let mut handle = *problem.handle;
    handle.linear_velocity = Vector3::zeros();
    handle.angular_velocity = Vector3::zeros();
    let mut sum = Linearization::zero();
    let mut signature = 0;
    problem.coupling.linearize(&handle, resting, &motion.v, &motion.omega, &mut sum);
    match problem.contact {
        ContactForce::None => {}
        ContactForce::Planes(planes) => signature = add_planes(planes, resting, motion, end, &mut sum),
        ContactForce::Linearized(model) | ContactForce::Held(model) => {
            let j = model.jacobian_at(resting);
            let held = matches!(problem.contact, ContactForce::Held(_));
            sum.wrench += if held { model.wrench } else { model.wrench_at(resting) };
            let mut left = sum.by_position.fixed_columns_mut::<3>(0);
            left += j.fixed_columns::<3>(0);
            // A turn changes q by Q times the turn.
            let mut right = sum.by_position.fixed_columns_mut::<3>(3);
            right += j.fixed_columns::<4>(3) * quaternion_rate_matrix(&resting.orientation);
        }
    }
    let weight = problem.gravity * problem.body.mass();
    sum.wrench += Vector6::new(weight.x, weight.y, weight.z, 0.0, 0.0, 0.0);
    let (k, k_turn) = (problem.coupling.linear_stiffness(), problem.coupling.angular_stiffness());
    let regular = Vector6::new(k, k, k, k_turn, k_turn, k_turn) * REGULARISATION;
    let stiffness = Matrix6::from_diagonal(&regular) - sum.by_position;
    let change = solve6(stiffness, sum.wrench)?;
    // One factor for both: shortened apart, displacement and turn would drive the contact points into their planes.
    let within = |rows: usize, most: f64| {
        let length = libm::sqrt(change.fixed_rows::<3>(rows).norm_squared());
        if length > most { most / length } else { 1.0 }
    };
    Some((change * within(0, LONGEST_STEP).min(within(3, LARGEST_TURN)), signature))
}
