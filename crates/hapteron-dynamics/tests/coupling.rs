//! The virtual coupling in cases worked out by hand (Eq. 12, sections 5.1 and 5.3): catches a wrong lever, sign or frame, a
//! damper that creates energy, and a coupling that should have been refused.
#![allow(clippy::unwrap_used)]

mod common;

use common::{METHODS, Random, at_rest, ball, coupling, problem, still_handle};
use hapteron_dynamics::{Coupling, CouplingError, Handle, Method, Spring, State, Status, step};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

fn spring(stiffness: f64) -> Spring {
    Spring { stiffness, limit: None }
}

/// D2: the body is turned, so that R c is not c, and spins in place; only the damper acts.
#[test]
fn damper_acts_on_the_velocity_of_the_coupling_point() {
    let (b, b_turn, spin, arm) = (2.0, 0.01, 3.0, 0.1);
    let body = ball(0.01);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
    let coupling =
        Coupling::new(spring(200.0), b, spring(0.6), b_turn, Vector3::x() * arm, UnitQuaternion::identity())
            .unwrap();
    let state = State::moving(&body, Vector3::zeros(), &turn, &Vector3::zeros(), &(Vector3::z() * spin));
    let handle = Handle { position: Vector3::y() * arm, orientation: turn, ..still_handle() };
    let wrench = coupling.wrench(&handle, &state, 1.0 / body.mass(), body.inverse_inertia_b());
    // The point is at (0, arm, 0) and moves along -x; as printed the force would be along -y.
    assert!((wrench.force - Vector3::x() * (b * spin * arm)).norm() < 1e-14);
    assert!((wrench.torque + Vector3::z() * (b * spin * arm * arm + b_turn * spin)).norm() < 1e-14);
}

/// D2: with ω x c as printed the damper feeds energy in; with ω x (R c) it never does.
#[test]
fn damper_takes_energy_and_the_printed_one_does_not_always() {
    let mut random = Random::new(31);
    let mut printed_creates = 0;
    for _ in 0..1000 {
        let body = random.body();
        let state = random.state(&body);
        let c = random.vector(0.1);
        let coupling =
            Coupling::new(spring(0.0), 2.0, spring(0.0), 0.0, c, UnitQuaternion::identity()).unwrap();
        let wrench = coupling.wrench(&still_handle(), &state, 1.0 / body.mass(), body.inverse_inertia_b());
        let (v, omega) = (state.linear_velocity(&body), state.angular_velocity(&body));
        let power = wrench.force.dot(&v) + wrench.torque.dot(&omega);
        assert!(power <= 1e-12 * wrench.force.norm(), "{power} W");
        let force = -(v + omega.cross(&c)) * 2.0;
        let arm = state.unit_quaternion() * c;
        printed_creates += usize::from(force.dot(&v) + arm.cross(&force).dot(&omega) > 1e-9);
    }
    assert!(printed_creates > 50, "the test would notice the printed form: {printed_creates}");
}

/// u_c in world axes, for any grasp orientation, from no angle at all to just under half a turn; beyond it changes sides.
#[test]
fn angular_spring_turns_the_body_towards_the_handle() {
    let mut random = Random::new(32);
    let body = ball(0.01);
    for angle in [0.0, 1e-12, 1e-7, 1e-5, 1e-3, 0.5, 2.0, 3.1, PI - 1e-9, PI + 0.1] {
        for _ in 0..50 {
            let (grasp, turn) = (random.turn(3.0), random.turn(3.0));
            let axis = nalgebra::Unit::new_normalize(random.vector(1.0));
            let coupling =
                Coupling::new(spring(200.0), 2.0, spring(0.6), 0.01, Vector3::zeros(), grasp).unwrap();
            let zero = Vector3::zeros();
            let state = State::moving(&body, zero, &turn, &zero, &zero);
            let orientation = UnitQuaternion::from_axis_angle(&axis, angle) * turn * grasp;
            let handle = Handle { orientation, ..still_handle() };
            let torque = coupling.wrench(&handle, &state, 1.0 / body.mass(), body.inverse_inertia_b()).torque;
            let felt = if angle > PI { angle - 2.0 * PI } else { angle };
            assert!((torque - axis.into_inner() * (0.6 * felt)).norm() < 1e-13, "{angle}: {torque}");
        }
    }
}

/// Near half a turn the derivative of u_c is large and its direction jumps: the step stays finite, and says where it is.
#[test]
fn step_near_half_a_turn_is_finite_and_flagged() {
    let (body, coupling) = (ball(5e-4), coupling(500.0, 2.0, 1.5, 0.01));
    for angle in [3.01, PI - 1e-6, PI - 1e-15, PI, PI + 1e-6] {
        let orientation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
        let handle = Handle { orientation, ..still_handle() };
        for method in METHODS {
            let result = step(&problem(&body, &coupling, &handle), &at_rest(&body), 1e-6, method);
            assert!(!result.status.is_fault() && result.state.is_finite(), "{method:?} at {angle}");
            assert!(result.angle <= PI + 1e-12);
            let flagged = result.status.contains(Status::COUPLING_ANGLE_LIMIT);
            assert_eq!(flagged, result.angle > 3.0, "{method:?} at {angle}: {}", result.angle);
        }
    }
}

/// D3: action and reaction at the handle. The lever about the centre of mass is the body's business, not the device's.
#[test]
fn device_gets_the_opposite_of_the_link_without_the_lever() {
    let mut random = Random::new(33);
    for _ in 0..200 {
        let body = random.body();
        let state = random.state(&body);
        let handle = random.handle(&state);
        let c = random.vector(0.1);
        let (k, b, k_turn, b_turn) = (300.0, 2.0, 0.6, 0.02);
        let coupling =
            Coupling::new(spring(k), b, spring(k_turn), b_turn, c, UnitQuaternion::identity()).unwrap();
        let (felt, deviation, angle) = coupling.feedback(&handle, &state, &body);
        let q = state.unit_quaternion();
        let (arm, omega) = (q * c, state.angular_velocity(&body));
        let e = handle.position - state.position - arm;
        let rate = handle.linear_velocity - state.linear_velocity(&body) - omega.cross(&arm);
        let u = (handle.orientation * q.inverse()).scaled_axis();
        let force = e * k + rate * b;
        let torque = u * k_turn + (handle.angular_velocity - omega) * b_turn;
        assert!((felt.force + force).norm() < 1e-11 * (1.0 + force.norm()));
        assert!((felt.torque + torque).norm() < 1e-11 * (1.0 + torque.norm()));
        assert!((deviation - e.norm()).abs() < 1e-14 && (angle - u.norm()).abs() < 1e-12);
        let on_body = coupling.wrench(&handle, &state, 1.0 / body.mass(), body.inverse_inertia_b());
        let lever = arm.cross(&force);
        assert!((on_body.torque - lever - torque).norm() < 1e-11 * (1.0 + lever.norm() + torque.norm()));
    }
}

/// Linear and angular damped oscillator against its solution in continuous time.
#[test]
fn coupling_swings_and_decays_like_a_damped_oscillator() {
    let (mass, k, b, k_turn, b_turn) = (0.1, 200.0, 1.5, 0.05, 2e-5);
    let (body, coupling, handle) = (ball(mass), coupling(k, b, k_turn, b_turn), still_handle());
    let moment = body.inertia_b()[(0, 0)];
    let start = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.3);
    let mut state =
        State::moving(&body, Vector3::new(0.0, 0.01, 0.0), &start, &Vector3::zeros(), &Vector3::zeros());
    let decay = |t: f64, inertia: f64, k: f64, b: f64| {
        let rate = 0.5 * b / inertia;
        let frequency = (k / inertia - rate * rate).sqrt();
        (-rate * t).exp() * ((frequency * t).cos() + rate / frequency * (frequency * t).sin())
    };
    let dt = 1e-4;
    for i in 1..=5000 {
        state = step(&problem(&body, &coupling, &handle), &state, dt, Method::RungeKutta4).state;
        let t = dt * f64::from(i);
        assert!((state.position.y - 0.01 * decay(t, mass, k, b)).abs() < 1e-9, "at {t} s");
        let angle = state.unit_quaternion().scaled_axis().x;
        assert!((angle - 0.3 * decay(t, moment, k_turn, b_turn)).abs() < 1e-6, "at {t} s");
    }
}

#[test]
fn what_is_no_coupling_is_refused() {
    let make = |k: Spring, b: f64, c: Vector3<f64>, q: UnitQuaternion<f64>| {
        Coupling::new(k, b, spring(0.6), 0.01, c, q).unwrap_err()
    };
    let (c, q) = (Vector3::zeros(), UnitQuaternion::identity());
    for bad in [-1.0, -1e-300, f64::NAN, f64::INFINITY] {
        assert!(matches!(make(spring(bad), 1.0, c, q), CouplingError::Negative("linear_stiffness", _)));
        assert!(matches!(make(spring(1.0), bad, c, q), CouplingError::Negative("linear_damping", _)));
        let limited = Spring { stiffness: 1.0, limit: Some(bad) };
        assert!(matches!(make(limited, 1.0, c, q), CouplingError::Limit("max_force", _)));
    }
    let no_force = Spring { stiffness: 1.0, limit: Some(0.0) };
    assert!(matches!(make(no_force, 1.0, c, q), CouplingError::Limit("max_force", _)));
    let nowhere = Vector3::new(0.0, f64::NAN, 0.0);
    assert!(matches!(make(spring(1.0), 1.0, nowhere, q), CouplingError::NotFinite("grasp_position", _)));
    let long = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(2.0, 0.0, 0.0, 0.0));
    assert!(matches!(make(spring(1.0), 1.0, c, long), CouplingError::NotUnit(_)));
    let broken = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    assert!(matches!(make(spring(1.0), 1.0, c, broken), CouplingError::NotFinite("grasp_orientation", _)));
}
