//! Every Jacobian against automatic differentiation and against central differences: catches a wrong sign, lever or index
//! in Eqs. 9 to 11, 13 to 20 and 22 to 29.
#![allow(clippy::unwrap_used)]

mod common;

use common::Random;
use hapteron_dynamics::{
    ContactPlane, Linearization, LinearizedContact, Motion, RigidBody, State, angular_velocity,
    quaternion_rate_derivative, quaternion_rate_matrix, rotation, rotation_derivative,
};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector4};
use num_dual::{DualNum, DualSVec64};

type Dual = DualSVec64<13>;
const SAMPLES: usize = 400;

fn dual_matrix(m: &Matrix3<f64>) -> Matrix3<Dual> {
    m.map(Dual::from)
}

/// Exact Jacobian of a function of the state.
fn automatic<const N: usize>(
    state: &State,
    f: impl Fn(&State<Dual>) -> SVector<Dual, N>,
) -> SMatrix<f64, N, 13> {
    let (_, j) = num_dual::jacobian(|y: SVector<Dual, 13>| f(&State::from_vector(&y)), &state.to_vector());
    j
}

/// Jacobian by central differences, with a step in proportion to each block's size.
fn differences<const N: usize>(
    state: &State,
    body: &RigidBody,
    f: impl Fn(&State) -> SVector<f64, N>,
) -> SMatrix<f64, N, 13> {
    let inertia = body.inertia_b().symmetric_eigenvalues().min();
    let mut j = SMatrix::<f64, N, 13>::zeros();
    for column in 0..13 {
        let h = match column {
            0..3 => 1e-6,
            3..7 => 1e-6,
            7..10 => 1e-5 * body.mass(),
            _ => 1e-4 * inertia,
        };
        let mut y = state.to_vector();
        y[column] += h;
        let above = f(&State::from_vector(&y));
        y[column] -= 2.0 * h;
        let below = f(&State::from_vector(&y));
        j.set_column(column, &((above - below) / (2.0 * h)));
    }
    j
}

/// Greatest error of any block (x, q, P, L), relative to the size of the block.
fn block_error<const N: usize>(a: &SMatrix<f64, N, 13>, b: &SMatrix<f64, N, 13>) -> f64 {
    let block = |start: usize, count: usize| {
        let (a, b) = (a.columns(start, count), b.columns(start, count));
        let size = b.norm().max(1e-9);
        (a - b).norm() / size
    };
    block(0, 3).max(block(3, 4)).max(block(7, 3)).max(block(10, 3))
}

fn judge<const N: usize>(
    name: &str,
    analytic: &SMatrix<f64, N, 13>,
    exact: &SMatrix<f64, N, 13>,
    finite: &SMatrix<f64, N, 13>,
) {
    let (error, rough) = (block_error(analytic, exact), block_error(analytic, finite));
    assert!(error < 1e-9, "{name}: {error:e} from automatic differentiation");
    assert!(rough < 2e-4, "{name}: {rough:e} from central differences");
    assert!(analytic != finite, "{name}: compared with itself");
}

#[test]
fn rotation_and_its_rate_have_the_derivatives_of_eqs_8_to_11() {
    let mut random = Random::new(1);
    for _ in 0..SAMPLES {
        let body = random.body();
        let state = random.state(&body);
        let inverse = dual_matrix(body.inverse_inertia_b());
        let motion = Motion::of(&state, &body);

        let by_rotation =
            automatic::<9>(&state, |s| SVector::from_iterator(rotation(&s.orientation).iter().copied()));
        for i in 0..4 {
            let expected = Matrix3::from_iterator(by_rotation.column(3 + i).iter().copied());
            assert!((rotation_derivative(&state.orientation, i) - expected).norm() < 1e-13);
        }

        let spin = |s: &State<Dual>| angular_velocity(&s.orientation, &s.angular_momentum, &inverse);
        let mut omega = SMatrix::<f64, 3, 13>::zeros();
        omega.fixed_columns_mut::<4>(3).copy_from(&(motion.omega_by_turn * motion.turn_by_q));
        omega.fixed_columns_mut::<3>(10).copy_from(&motion.inverse_inertia_w);
        let spin_f64 =
            |s: &State| angular_velocity(&s.orientation, &s.angular_momentum, body.inverse_inertia_b());
        judge("Eq. 11", &omega, &automatic(&state, spin), &differences(&state, &body, spin_f64));

        let rate = |s: &State<Dual>| -> Vector4<Dual> { quaternion_rate_matrix(&s.orientation) * spin(s) };
        let rate_f64 = |s: &State| -> Vector4<f64> { quaternion_rate_matrix(&s.orientation) * spin_f64(s) };
        let mut by_state = SMatrix::<f64, 4, 13>::zeros();
        let by_q = quaternion_rate_derivative(&state.orientation, &motion.omega, &motion.omega_by_turn);
        by_state.fixed_columns_mut::<4>(3).copy_from(&by_q);
        let by_l = quaternion_rate_matrix(&state.orientation) * motion.inverse_inertia_w;
        by_state.fixed_columns_mut::<3>(10).copy_from(&by_l);
        judge("Eqs. 9, 10", &by_state, &automatic(&state, rate), &differences(&state, &body, rate_f64));
    }
}

#[test]
fn coupling_has_the_derivatives_of_eqs_13_to_20() {
    let mut random = Random::new(2);
    for sample in 0..SAMPLES {
        let body = random.body();
        let state = random.state(&body);
        let handle = random.handle(&state);
        let coupling = random.coupling(sample % 2 == 1);
        let motion = Motion::of(&state, &body);
        let mut sum = Linearization::zero();
        coupling.linearize(&handle, &state, &motion.v, &motion.omega, &mut sum);
        let inverse = dual_matrix(body.inverse_inertia_b());
        let mass = Dual::from(body.mass()).recip();
        let exact = automatic(&state, |s| coupling.wrench(&handle, s, mass, &inverse).to_vector());
        let value =
            |s: &State| coupling.wrench(&handle, s, 1.0 / body.mass(), body.inverse_inertia_b()).to_vector();
        let finite = differences(&state, &body, value);
        assert!((sum.wrench - value(&state)).norm() < 1e-11 * (1.0 + value(&state).norm()));
        judge("coupling", &sum.by_state(&motion), &exact, &finite);
    }
}

#[test]
fn contact_plane_has_the_derivatives_of_eqs_22_to_29() {
    let mut random = Random::new(3);
    let mut active = 0;
    while active < SAMPLES {
        let body = random.body();
        let state = random.state(&body);
        let plane = random.plane(&state);
        let model = LinearizedContact::from_planes(&[plane], &body, &state);
        if model.jacobian.norm() == 0.0 {
            continue;
        }
        active += 1;
        let inverse = dual_matrix(body.inverse_inertia_b());
        let mass = Dual::from(body.mass()).recip();
        let exact = automatic(&state, |s| plane.wrench(s, mass, &inverse, false).to_vector());
        let value =
            |s: &State| plane.wrench(s, 1.0 / body.mass(), body.inverse_inertia_b(), false).to_vector();
        let finite = differences(&state, &body, value);
        assert!((model.wrench - value(&state)).norm() < 1e-11 * (1.0 + value(&state).norm()));
        judge("contact", &model.jacobian, &exact, &finite);
    }
}

#[test]
fn eq_30_is_tangent_to_the_planes_in_either_hemisphere() {
    let mut random = Random::new(4);
    for _ in 0..SAMPLES {
        let body = random.body();
        let state = random.state(&body);
        let planes: Vec<ContactPlane> = (0..5).map(|_| random.plane(&state)).collect();
        let model = LinearizedContact::from_planes(&planes, &body, &state);
        let mut near = state;
        near.position += random.vector(1e-7);
        near.linear_momentum += random.vector(1e-7) * body.mass();
        let predicted = model.wrench_at(&near);
        near.orientation = -near.orientation;
        let flipped = model.wrench_at(&near);
        assert!((predicted - flipped).norm() <= 1e-9 * predicted.norm(), "hemispheres were mixed");
        let pushing = |s: &State| {
            planes
                .iter()
                .filter(|p| {
                    p.wrench(&state, 1.0 / body.mass(), body.inverse_inertia_b(), true).force
                        != Vector3::zeros()
                })
                .map(|p| p.wrench(s, 1.0 / body.mass(), body.inverse_inertia_b(), false).to_vector())
                .sum::<nalgebra::Vector6<f64>>()
        };
        near.orientation = -near.orientation;
        let expected = pushing(&near);
        assert!((predicted - expected).norm() <= 1e-6 * (1.0 + expected.norm()));
    }
}
