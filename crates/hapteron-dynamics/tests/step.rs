//! Steps as a whole: the condensed system against the full one, analytic motions, invariances, faults.
#![allow(clippy::unwrap_used)]

mod common;

use common::{METHODS, Random, ball, coupling, problem, still_handle};
use hapteron_dynamics::reference::{condensed_solve, dense_solve};
use hapteron_dynamics::{
    ContactForce, ContactPlane, Handle, LinearizedContact, Method, Problem, RigidBody, State, Status, step,
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

#[test]
fn condensed_and_full_system_agree() {
    let mut random = Random::new(11);
    let mut worst: f64 = 0.0;
    for _ in 0..100_000 {
        let body = random.body();
        let state = random.state(&body);
        let handle = random.handle(&state);
        let coupling = random.coupling(false);
        let planes: [ContactPlane; 4] = std::array::from_fn(|_| random.plane(&state));
        let problem =
            Problem { contact: ContactForce::Planes(&planes), ..problem(&body, &coupling, &handle) };
        let condensed = condensed_solve(&problem, &state, 1e-3).unwrap();
        let dense = dense_solve(&problem, &state, 1e-3).unwrap();
        for (start, count) in [(0, 3), (3, 4), (7, 3), (10, 3)] {
            let (a, b) = (condensed.rows(start, count), dense.rows(start, count));
            worst = worst.max((a - b).norm() / b.norm());
        }
    }
    assert!(worst < 1e-9, "relative difference {worst:e}");
}

/// Backward Euler on m x'' = -k x - b x' has a closed form: each step multiplies (x, v) by a fixed matrix.
#[test]
fn backward_euler_follows_its_closed_form_on_an_oscillator() {
    let (mass, k, b, dt) = (0.01, 200.0, 0.5, 1e-3);
    let (body, coupling, handle) = (ball(mass), coupling(k, b, 0.6, 0.01), still_handle());
    let problem = problem(&body, &coupling, &handle);
    let mut state = State::moving(
        &body,
        Vector3::new(0.01, 0.0, 0.0),
        &UnitQuaternion::identity(),
        &Vector3::zeros(),
        &Vector3::zeros(),
    );
    let (mut x, mut v) = (0.01, 0.0);
    for _ in 0..200 {
        state = step(&problem, &state, dt, Method::BackwardEuler).state;
        v = (v - dt * k / mass * x) / (1.0 + dt * b / mass + dt * dt * k / mass);
        x += dt * v;
        assert!((state.position.x - x).abs() < 1e-13, "{} against {x}", state.position.x);
    }
}

#[test]
fn two_springs_come_to_rest_where_their_forces_balance() {
    let (k, wall) = (200.0, 2000.0);
    let (body, coupling) = (ball(0.01), coupling(k, 1.0, 0.6, 0.01));
    let handle = Handle { position: Vector3::new(0.0, 0.0, -0.01), ..still_handle() };
    let tolerance = 5e-4;
    let plane = [ContactPlane::new(Vector3::zeros(), &Vector3::zeros(), -Vector3::z(), wall, 3.0, tolerance)];
    for method in METHODS {
        let problem = Problem { contact: ContactForce::Planes(&plane), ..problem(&body, &coupling, &handle) };
        let mut state = State::moving(
            &body,
            Vector3::zeros(),
            &UnitQuaternion::identity(),
            &Vector3::zeros(),
            &Vector3::zeros(),
        );
        let mut last = step(&problem, &state, 1e-4, method);
        for _ in 0..20_000 {
            last = step(&problem, &state, 1e-4, method);
            state = last.state;
        }
        // k (0.01 - s) = wall (s + d)
        let sink = (k * 0.01 - wall * tolerance) / (k + wall);
        assert!((-state.position.z - sink).abs() < 1e-9, "{method:?}: {} against {sink}", -state.position.z);
        assert!((last.contact.force.z - wall * (sink + tolerance)).abs() < 1e-6);
        assert!((last.feedback.force.z - last.contact.force.z).abs() < 1e-6, "the hand feels the wall");
    }
}

/// A free symmetric top precesses about L at |L| / I_transverse.
#[test]
fn free_top_precesses_at_the_analytic_rate() {
    let (transverse, axial) = (2e-5, 3e-5);
    let body =
        RigidBody::new(0.1, Matrix3::from_diagonal(&Vector3::new(transverse, transverse, axial))).unwrap();
    let (coupling, handle) = (coupling(0.0, 0.0, 0.0, 0.0), still_handle());
    let problem = problem(&body, &coupling, &handle);
    let mut state = State::moving(
        &body,
        Vector3::zeros(),
        &UnitQuaternion::identity(),
        &Vector3::zeros(),
        &Vector3::new(3.0, 0.0, 10.0),
    );
    let l = state.angular_momentum;
    let rate = l.norm() / transverse;
    let (dt, steps) = (1e-4, 10_000);
    let axis = state.unit_quaternion() * Vector3::z();
    for _ in 0..steps {
        state = step(&problem, &state, dt, Method::RungeKutta4).state;
    }
    let about =
        UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_normalize(l), rate * dt * f64::from(steps));
    let error = (state.unit_quaternion() * Vector3::z() - about * axis).norm();
    assert!(error < 1e-9, "{error:e}");
    assert!((state.angular_momentum - l).norm() < 1e-15);
}

#[test]
fn all_methods_converge_to_runge_kutta_with_tiny_steps() {
    let mut random = Random::new(12);
    for _ in 0..20 {
        let body = RigidBody::new(0.1, Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 2.5e-4))).unwrap();
        let coupling = coupling(200.0, 2.0, 0.6, 0.0166);
        let start = State::moving(
            &body,
            Vector3::zeros(),
            &random.turn(1.0),
            &random.vector(0.1),
            &random.vector(5.0),
        );
        let handle =
            Handle { orientation: random.turn(0.5) * start.unit_quaternion(), ..random.handle(&start) };
        let problem = problem(&body, &coupling, &handle);
        let run = |method, dt: f64| {
            let steps = (0.02 / dt).round() as usize;
            (0..steps).fold(start, |s, _| step(&problem, &s, dt, method).state).to_vector()
        };
        let exact = run(Method::RungeKutta4, 1e-5);
        for (method, order) in [
            (Method::BackwardEuler, 1),
            (Method::BackwardEulerNewton, 1),
            (Method::ForwardEuler, 1),
            (Method::RungeKutta4, 4),
        ] {
            let (coarse, fine) = ((run(method, 4e-4) - exact).norm(), (run(method, 2e-4) - exact).norm());
            let ratio = coarse / fine;
            let expected = f64::from(1 << order);
            assert!(ratio > 0.8 * expected && ratio < 1.4 * expected, "{method:?}: {coarse:e} to {fine:e}");
        }
    }
}

#[test]
fn moving_the_world_moves_the_result() {
    let mut random = Random::new(13);
    for _ in 0..200 {
        let body = random.body();
        let state = random.state(&body);
        let handle = random.handle(&state);
        let coupling = random.coupling(true);
        let plane = random.plane(&state);
        let (turn, shift) = (random.turn(3.0), random.vector(0.1));
        let moved_state = State::moving(
            &body,
            turn * state.position + shift,
            &(turn * state.unit_quaternion()),
            &(turn * state.linear_velocity(&body)),
            &(turn * state.angular_velocity(&body)),
        );
        let moved_handle = Handle {
            position: turn * handle.position + shift,
            orientation: turn * handle.orientation,
            linear_velocity: turn * handle.linear_velocity,
            angular_velocity: turn * handle.angular_velocity,
        };
        let normal = turn * plane.normal_w;
        let moved_plane =
            ContactPlane { normal_w: normal, offset: plane.offset + normal.dot(&shift), ..plane };
        for method in METHODS {
            let one =
                Problem { contact: ContactForce::Planes(&[plane]), ..problem(&body, &coupling, &handle) };
            let other = Problem {
                contact: ContactForce::Planes(&[moved_plane]),
                ..problem(&body, &coupling, &moved_handle)
            };
            let (a, b) = (step(&one, &state, 1e-4, method), step(&other, &moved_state, 1e-4, method));
            let there = turn * a.state.position + shift;
            assert!((there - b.state.position).norm() < 1e-8 * (1.0 + there.norm()), "{method:?}");
            let force = turn * a.feedback.force;
            assert!((force - b.feedback.force).norm() < 1e-5 * (1.0 + force.norm()), "{method:?}");
        }
    }
}

/// Catches a place where q enters other than through R(q) and G(q): a sign, or hemispheres mixed in Eq. 30.
#[test]
fn quaternion_and_its_opposite_are_the_same_orientation() {
    let mut random = Random::new(14);
    for _ in 0..200 {
        let body = random.body();
        let state = random.state(&body);
        let handle = random.handle(&state);
        let coupling = random.coupling(false);
        let planes = [random.plane(&state)];
        let model = LinearizedContact::from_planes(&planes, &body, &state);
        let mut opposite = state;
        opposite.orientation = -opposite.orientation;
        for contact in
            [ContactForce::Planes(&planes), ContactForce::Linearized(&model), ContactForce::Held(&model)]
        {
            let problem = Problem { contact, ..problem(&body, &coupling, &handle) };
            for method in METHODS {
                let a = step(&problem, &state, 1e-3, method);
                let b = step(&problem, &opposite, 1e-3, method);
                let apart = (a.state.orientation + b.state.orientation).norm();
                assert!(apart < 1e-10, "{method:?}: the hemisphere is kept, or {apart:e}");
                let force = a.feedback.force;
                assert!((force - b.feedback.force).norm() < 1e-8 * (1.0 + force.norm()), "{method:?}");
            }
        }
    }
}

/// Coupled to a still handle the energy never rises, whatever the stiffness: an implicit step is passive.
#[test]
fn backward_euler_never_adds_energy() {
    let mut random = Random::new(15);
    for _ in 0..50 {
        let body = random.body();
        let (k, b) = (random.scale(10.0, 1e5), random.scale(1e-3, 10.0));
        let (coupling, handle) = (coupling(k, b, 0.0, 1e-4), still_handle());
        let problem = problem(&body, &coupling, &handle);
        let mut state = State::moving(
            &body,
            random.vector(0.01),
            &UnitQuaternion::identity(),
            &random.vector(1.0),
            &Vector3::zeros(),
        );
        let energy = |s: &State| {
            0.5 * s.linear_momentum.norm_squared() / body.mass() + 0.5 * k * s.position.norm_squared()
        };
        let mut before = energy(&state);
        for _ in 0..200 {
            state = step(&problem, &state, 1e-3, Method::BackwardEuler).state;
            let after = energy(&state);
            assert!(after <= before * (1.0 + 1e-12) + 1e-18);
            before = after;
        }
    }
}

#[test]
fn free_spin_has_the_known_energy_drift() {
    let body = RigidBody::new(0.1, Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 2.5e-4))).unwrap();
    let (coupling, handle) = (coupling(0.0, 0.0, 0.0, 0.0), still_handle());
    let problem = problem(&body, &coupling, &handle);
    let start = State::moving(
        &body,
        Vector3::zeros(),
        &UnitQuaternion::identity(),
        &Vector3::zeros(),
        &Vector3::new(4.0, 8.0, 4.5),
    );
    let energy = |s: &State| s.angular_momentum.dot(&s.angular_velocity(&body));
    let drift = |method| {
        let end = (0..1000).fold(start, |s, _| step(&problem, &s, 1e-3, method).state);
        energy(&end) / energy(&start) - 1.0
    };
    assert!(drift(Method::RungeKutta4).abs() < 1e-10, "{:e}", drift(Method::RungeKutta4));
    let (backward, forward) = (drift(Method::BackwardEuler), drift(Method::ForwardEuler));
    assert!(backward < 0.0 && backward > -0.05, "{backward}");
    assert!(forward > 0.0 && forward < 0.05, "{forward}");
}

#[test]
fn faults_keep_the_state_and_send_nothing() {
    let (body, coupling) = (ball(0.01), coupling(200.0, 2.0, 0.6, 0.01));
    let good =
        State::moving(&body, Vector3::zeros(), &UnitQuaternion::identity(), &Vector3::x(), &Vector3::zeros());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for method in METHODS {
            let mut handle = still_handle();
            handle.position.y = bad;
            let result = step(&problem(&body, &coupling, &handle), &good, 1e-3, method);
            assert!(result.status.contains(Status::NON_FINITE) && result.status.is_fault());
            assert_eq!(result.state, good);
            assert_eq!(result.feedback.to_vector().norm(), 0.0);

            let handle = still_handle();
            let plane = [ContactPlane::new(
                Vector3::zeros(),
                &Vector3::new(bad, 0.0, 0.0),
                Vector3::x(),
                1e3,
                1.0,
                1e-3,
            )];
            let contact = ContactForce::Planes(&plane);
            let result =
                step(&Problem { contact, ..problem(&body, &coupling, &handle) }, &good, 1e-3, method);
            assert!(result.state.is_finite() && result.feedback.is_finite() && result.contact.is_finite());

            let result = step(&problem(&body, &coupling, &handle), &good, bad, method);
            assert!(result.status.is_fault());
        }
        let mut state = good;
        state.angular_momentum.z = bad;
        let handle = still_handle();
        assert!(
            step(&problem(&body, &coupling, &handle), &state, 1e-3, Method::BackwardEuler).status.is_fault()
        );
    }
}

/// Forward Euler diverges and says so instead of returning an infinite force.
#[test]
fn divergence_ends_in_a_fault_and_not_in_a_force() {
    let (body, coupling) = (ball(1e-4), coupling(1e6, 0.0, 10.0, 0.0));
    let handle = Handle { position: Vector3::new(0.01, 0.0, 0.0), ..still_handle() };
    let problem = problem(&body, &coupling, &handle);
    let mut state = State::moving(
        &body,
        Vector3::zeros(),
        &UnitQuaternion::identity(),
        &Vector3::zeros(),
        &Vector3::zeros(),
    );
    let mut faulted = false;
    for _ in 0..2000 {
        let result = step(&problem, &state, 1e-3, Method::ForwardEuler);
        assert!(result.feedback.is_finite());
        faulted |= result.status.is_fault();
        state = result.state;
    }
    assert!(faulted);
}
