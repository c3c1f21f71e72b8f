//! The equations of motion and the integrators as the paper writes them (Eqs. 1 to 11, section 7.2): catches a wrong term in f, in
//! the assembled matrix of Eq. 7, or in an integrator's formula.
#![allow(clippy::unwrap_used)]

mod common;

use common::{METHODS, Random, at_rest, ball, coupling, problem, still_handle};
use hapteron_dynamics::reference::{condensed_solve, dense_solve};
use hapteron_dynamics::{
    ContactForce, Method, Problem, RigidBody, RigidBodyError, State, angular_velocity, skew, step,
};
use nalgebra::{Matrix2, Matrix3, Quaternion, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};

#[test]
fn skew_matrix_is_the_cross_product() {
    let mut random = Random::new(51);
    for _ in 0..100 {
        let (u, v) = (random.vector(2.0), random.vector(2.0));
        assert!((skew(&u) * v - u.cross(&v)).norm() < 1e-15);
    }
}

/// Eq. 3, and its inverse in `State::moving`.
#[test]
fn spin_follows_from_the_angular_momentum() {
    let mut random = Random::new(52);
    for _ in 0..200 {
        let body = random.body();
        let (turn, omega) = (random.turn(3.0), random.vector(10.0));
        let state = State::moving(&body, Vector3::zeros(), &turn, &Vector3::zeros(), &omega);
        let r = turn.to_rotation_matrix().into_inner();
        let l = r * body.inertia_b() * r.transpose() * omega;
        assert!((state.angular_momentum - l).norm() < 1e-12 * l.norm());
        let back = angular_velocity(&state.orientation, &l, body.inverse_inertia_b());
        assert!((back - omega).norm() < 1e-9 * omega.norm());
    }
}

/// Eqs. 2, 4 and 8: f(y) from quaternion products and the sum of the forces.
#[test]
fn rate_is_that_of_newton_and_euler() {
    let mut random = Random::new(53);
    for _ in 0..200 {
        let body = random.body();
        let state = random.state(&body);
        let (coupling, handle) = (random.coupling(true), random.handle(&state));
        let planes = [random.plane(&state), random.plane(&state)];
        let gravity = random.vector(10.0);
        let contact = ContactForce::Planes(&planes);
        let problem = Problem { contact, gravity, ..problem(&body, &coupling, &handle) };
        let rate = State::from_vector(&problem.rate(&state));
        let omega = Quaternion::from_imag(state.angular_velocity(&body));
        let expected = omega * state.unit_quaternion().into_inner() * 0.5;
        let q = Quaternion::new(
            rate.orientation[0],
            rate.orientation[1],
            rate.orientation[2],
            rate.orientation[3],
        );
        assert!((q - expected).norm() < 1e-12 * (1.0 + expected.norm()));
        assert!((rate.position - state.linear_momentum / body.mass()).norm() < 1e-12);
        let inverse = body.inverse_inertia_b();
        let (mut force, mut torque) = (gravity * body.mass(), Vector3::zeros());
        for wrench in planes
            .iter()
            .map(|p| p.wrench(&state, 1.0 / body.mass(), inverse, true))
            .chain([coupling.wrench(&handle, &state, 1.0 / body.mass(), inverse)])
        {
            force += wrench.force;
            torque += wrench.torque;
        }
        assert!((rate.linear_momentum - force).norm() < 1e-10 * (1.0 + force.norm()));
        assert!((rate.angular_momentum - torque).norm() < 1e-10 * (1.0 + torque.norm()));
    }
}

/// Eqs. 6 and 7: the system assembled from differences of f, and solved by a general solver.
#[test]
fn step_solves_eq_6_with_the_matrix_of_eq_7() {
    let mut random = Random::new(54);
    let dt = 1e-3;
    for _ in 0..300 {
        let body = RigidBody::new(0.1, Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 2.5e-4))).unwrap();
        let state = State::moving(
            &body,
            random.vector(0.1),
            &random.turn(3.0),
            &random.vector(1.0),
            &random.vector(10.0),
        );
        let (coupling, handle) = (random.coupling(false), random.handle(&state));
        let problem = Problem { gravity: random.vector(10.0), ..problem(&body, &coupling, &handle) };
        let mut j = SMatrix::<f64, 13, 13>::zeros();
        for column in 0..13 {
            let h = if column < 7 { 1e-6 } else { 1e-8 };
            let mut change = SVector::<f64, 13>::zeros();
            change[column] = h;
            let rate = |sign: f64| problem.rate(&State::from_vector(&(state.to_vector() + change * sign)));
            j.set_column(column, &((rate(1.0) - rate(-1.0)) / (2.0 * h)));
        }
        let expected = (SMatrix::identity() - j * dt).lu().solve(&(problem.rate(&state) * dt)).unwrap();
        for found in [condensed_solve(&problem, &state, dt), dense_solve(&problem, &state, dt)] {
            let found = found.unwrap();
            for (start, count) in [(0, 3), (3, 4), (7, 3), (10, 3)] {
                let (a, b) = (found.rows(start, count), expected.rows(start, count));
                assert!((a - b).norm() < 1e-5 * b.norm(), "rows from {start}: {a} for {b}");
            }
        }
    }
}

/// Eq. 5: y_n = y_(n-1) + dt f(y_n), which Newton's method solves and the linearized step only approximates.
#[test]
fn newton_solves_the_implicit_equation() {
    let mut random = Random::new(55);
    let (dt, mut rough) = (1e-3, 0.0_f64);
    for _ in 0..100 {
        let body = RigidBody::new(0.1, Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 2.5e-4))).unwrap();
        let state = State::moving(
            &body,
            random.vector(0.1),
            &random.turn(3.0),
            &random.vector(1.0),
            &random.vector(20.0),
        );
        let (coupling, handle) = (random.coupling(false), random.handle(&state));
        let problem = problem(&body, &coupling, &handle);
        let residual = |method| {
            let after = step(&problem, &state, dt, method).state;
            let mut left = after.to_vector() - problem.rate(&after) * dt;
            // The step ends with a quaternion of length 1 (D9); before that it had the direction of q and another length.
            let q = left.fixed_rows::<4>(3).normalize();
            left.fixed_rows_mut::<4>(3).copy_from(&q);
            let size = step(&problem, &state, dt, method).state.to_vector() - state.to_vector();
            let error = left - state.to_vector();
            [(0, 3), (3, 4), (7, 3), (10, 3)]
                .map(|(start, count)| error.rows(start, count).norm() / size.rows(start, count).norm())
                .into_iter()
                .fold(0.0, f64::max)
        };
        let exact = residual(Method::BackwardEulerNewton);
        assert!(exact < 1e-8, "{exact:e}");
        rough = rough.max(residual(Method::BackwardEuler));
    }
    assert!(rough > 1e-6, "the test tells them apart: {rough:e}");
}

/// On a linear oscillator every method multiplies (x, v) by a polynomial or the inverse of one of dt A: the discrete decay.
#[test]
fn every_integrator_has_its_own_amplification() {
    let (mass, k, b, dt) = (0.1, 200.0, 1.5, 1e-3);
    let (body, coupling, handle) = (ball(mass), coupling(k, b, 0.6, 0.01), still_handle());
    let a = Matrix2::new(0.0, 1.0, -k / mass, -b / mass) * dt;
    let one = Matrix2::identity();
    let implicit = (one - a).try_inverse().unwrap();
    for (method, factor) in [
        (Method::BackwardEuler, implicit),
        (Method::BackwardEulerNewton, implicit),
        (Method::ForwardEuler, one + a),
        (Method::RungeKutta4, one + a + a * a / 2.0 + a * a * a / 6.0 + a * a * a * a / 24.0),
    ] {
        let mut state = at_rest(&body);
        state.position.x = 0.01;
        let mut expected = Vector2::new(0.01, 0.0);
        for _ in 0..300 {
            state = step(&problem(&body, &coupling, &handle), &state, dt, method).state;
            expected = factor * expected;
            assert!((state.position.x - expected.x).abs() < 1e-13, "{method:?}");
            assert!((state.linear_momentum.x - mass * expected.y).abs() < 1e-12, "{method:?}");
        }
    }
}

/// D9: the length of q stays 1 to round-off over 20,000 fast steps, and its hemisphere does not change within one.
#[test]
fn quaternion_stays_a_unit_and_in_its_hemisphere() {
    let (body, coupling, handle) = (ball(0.01), coupling(0.0, 0.0, 0.6, 0.0), still_handle());
    let problem = problem(&body, &coupling, &handle);
    for method in METHODS {
        let spin = Vector3::new(30.0, 40.0, -20.0);
        let zero = Vector3::zeros();
        let mut state = State::moving(&body, zero, &UnitQuaternion::identity(), &zero, &spin);
        for _ in 0..20_000 {
            let Some(next) = Some(step(&problem, &state, 1e-3, method)).filter(|s| !s.status.is_fault())
            else {
                break;
            };
            assert!((next.state.orientation.norm() - 1.0).abs() < 1e-15);
            assert!(next.state.orientation.dot(&state.orientation) > 0.0, "{method:?}: flipped");
            state = next.state;
        }
    }
}

/// A time step that is none, or a quaternion of length 0, is a fault and not a number.
#[test]
fn impossible_time_steps_and_orientations_are_faults() {
    let (body, coupling, handle) = (ball(0.01), coupling(200.0, 2.0, 0.6, 0.01), still_handle());
    let problem = problem(&body, &coupling, &handle);
    for method in METHODS {
        for dt in [0.0, -0.0, -1e-3, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let result = step(&problem, &at_rest(&body), dt, method);
            assert!(result.status.is_fault() && result.state == at_rest(&body), "{method:?} with {dt}");
        }
        let mut nowhere = at_rest(&body);
        nowhere.orientation.fill(0.0);
        assert!(step(&problem, &nowhere, 1e-3, method).status.is_fault());
        for dt in [f64::MIN_POSITIVE, 1e-12, 1.0, 1e6] {
            let result = step(&problem, &at_rest(&body), dt, method);
            assert!(result.state.is_finite() && result.feedback.is_finite(), "{method:?} with {dt}");
        }
    }
}

/// What is no body: also a NaN, which would keep the search for the principal moments from ending.
#[test]
fn what_is_no_body_is_refused() {
    let good = Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 2.5e-4));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-320] {
        assert!(matches!(RigidBody::new(bad, good), Err(RigidBodyError::Mass(_))), "{bad}");
    }
    for bad in [f64::NAN, f64::INFINITY] {
        for place in [(0, 0), (1, 2), (2, 2)] {
            let mut inertia = good;
            inertia[place] = bad;
            assert_eq!(RigidBody::new(0.1, inertia), Err(RigidBodyError::Asymmetric));
        }
    }
    let flat = Matrix3::from_diagonal(&Vector3::new(0.0, 1e-4, 1e-4));
    assert!(matches!(RigidBody::new(0.1, flat), Err(RigidBodyError::NotPositive(_))));
    assert!(matches!(RigidBody::new(0.1, Matrix3::zeros()), Err(RigidBodyError::NotPositive(_))));
    let impossible = Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 3e-4));
    assert_eq!(RigidBody::new(0.1, impossible), Err(RigidBodyError::Triangle));
    let mut skewed = good;
    skewed[(0, 1)] = 1e-5;
    assert_eq!(RigidBody::new(0.1, skewed), Err(RigidBodyError::Asymmetric));
    // Very small and very large bodies are bodies.
    for size in [1e-150, 1e-12, 1e12, 1e150] {
        let body = RigidBody::new(0.1, good * size).unwrap();
        assert!((body.inertia_b() * body.inverse_inertia_b() - Matrix3::identity()).norm() < 1e-9);
    }
}
