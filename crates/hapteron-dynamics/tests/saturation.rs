//! The saturating coupling (section 5.3.1): catches a kink or an overshoot of the curve, a force that differs between the two
//! places that compute it, and a device that is sent more than its limit.
#![allow(clippy::unwrap_used)]

mod common;

use common::{METHODS, Random, at_rest, ball, problem, still_handle};
use hapteron_dynamics::{
    ContactForce, ContactPlane, Coupling, Handle, Method, Problem, Spring, Status, step,
};
use nalgebra::{UnitQuaternion, Vector3};

fn saturating(k: f64, b: f64, limit: f64) -> Coupling {
    let (linear, angular) =
        (Spring { stiffness: k, limit: Some(limit) }, Spring { stiffness: 0.6, limit: Some(0.1) });
    Coupling::new(linear, b, angular, 0.01, Vector3::zeros(), UnitQuaternion::identity()).unwrap()
}

#[test]
fn curve_is_linear_then_bends_smoothly_and_monotonically_to_its_limit() {
    let mut random = Random::new(21);
    for _ in 0..200 {
        let (k, limit) = (random.scale(1.0, 1e5), random.scale(0.1, 100.0));
        let spring = Spring { stiffness: k, limit: Some(limit) };
        let start = 0.5 * limit / k;
        let end = start + limit / k;
        for (s, force, slope) in [
            (0.0, 0.0, k),
            (0.3 * start, 0.3 * k * start, k),
            (start, 0.5 * limit, k),
            (end, limit, 0.0),
            (1e3 * end, limit, 0.0),
        ] {
            // From both sides of the joints.
            for side in [s * (1.0 - 1e-9), s * (1.0 + 1e-9)] {
                let at = spring.at(side);
                assert!((at.force - force).abs() < 1e-7 * limit, "force at {s}");
                assert!((at.slope - slope).abs() < 1e-7 * k, "slope at {s}");
            }
        }
        let points: Vec<f64> = (0..=1000).map(|i| 1.2 * end * f64::from(i) / 1000.0).collect();
        for pair in points.windows(2) {
            let (a, b) = (spring.at(pair[0]), spring.at(pair[1]));
            assert!(b.force >= a.force - 1e-12 * limit, "monotone");
            assert!(b.slope <= a.slope + 1e-12 * k && b.slope >= -1e-12 * k, "concave");
            let rise = (b.force - a.force) / (pair[1] - pair[0]);
            assert!((rise - 0.5 * (a.slope + b.slope)).abs() < 2e-3 * k, "the slope is the derivative");
        }
    }
}

/// `Coupling::wrench` has its own curve, that can be differentiated automatically; it must be that of `Spring::at`.
#[test]
fn coupling_pulls_with_the_force_of_the_curve() {
    let mut random = Random::new(22);
    for _ in 0..500 {
        let (k, limit) = (random.scale(1.0, 1e5), random.scale(0.1, 100.0));
        let coupling = saturating(k, 0.0, limit);
        let body = ball(0.01);
        let s = random.uniform(0.0, 2.0) * limit / k;
        let direction = random.vector(1.0).normalize();
        let handle = Handle { position: direction * s, ..still_handle() };
        let wrench = coupling.wrench(&handle, &at_rest(&body), 1.0 / body.mass(), body.inverse_inertia_b());
        let expected = Spring { stiffness: k, limit: Some(limit) }.at(s).force;
        assert!((wrench.force - direction * expected).norm() < 1e-12 * limit);
    }
}

#[test]
fn damping_fades_with_the_slope_but_not_below_a_fifth() {
    let coupling = saturating(200.0, 2.0, 4.0);
    let body = ball(0.01);
    // Linear to 0.01 m, saturated from 0.03 m.
    for (deviation, share) in [(0.005, 1.0), (0.01, 1.0), (0.02, 0.5), (0.025, 0.25), (0.03, 0.2), (1.0, 0.2)]
    {
        let handle = Handle { position: Vector3::x() * deviation, ..still_handle() };
        let mut state = at_rest(&body);
        let force =
            |state: &_| coupling.wrench(&handle, state, 1.0 / body.mass(), body.inverse_inertia_b()).force;
        let still = force(&state);
        state.linear_momentum = Vector3::y() * body.mass();
        let damping = still.y - force(&state).y;
        assert!((damping - 2.0 * share).abs() < 1e-9, "{damping} at {deviation} m");
    }
}

/// The purpose of section 5.3.1: pushing further does not sink the body further.
#[test]
fn saturated_push_sinks_by_the_limit_however_far_the_hand_goes() {
    let (limit, wall) = (3.0, 2000.0);
    let (body, coupling) = (ball(0.01), saturating(200.0, 1.0, limit));
    let plane = [ContactPlane::new(Vector3::zeros(), &Vector3::zeros(), -Vector3::z(), wall, 3.0, 0.0)];
    for push in [0.03, 0.1, 1.0] {
        let handle = Handle { position: Vector3::new(0.0, 0.0, -push), ..still_handle() };
        let problem = Problem { contact: ContactForce::Planes(&plane), ..problem(&body, &coupling, &handle) };
        let mut result = step(&problem, &at_rest(&body), 1e-3, Method::BackwardEuler);
        for _ in 0..2000 {
            result = step(&problem, &result.state, 1e-3, Method::BackwardEuler);
        }
        let sink = -result.state.position.z;
        assert!((sink - limit / wall).abs() < 1e-8, "pushed by {push}: {sink}");
        assert!((result.feedback.force.z - limit).abs() < 1e-6);
        assert!(result.status.contains(Status::COUPLING_SATURATED));
    }
}

#[test]
fn device_is_never_sent_more_than_the_limits() {
    let mut random = Random::new(23);
    let mut limited = 0;
    for _ in 0..500 {
        let body = random.body();
        let state = random.state(&body);
        let coupling = saturating(random.scale(10.0, 1e4), 20.0, 4.0);
        let handle = random.handle(&state);
        for method in METHODS {
            let result = step(&problem(&body, &coupling, &handle), &state, 1e-3, method);
            let (force, torque) = (result.feedback.force.norm(), result.feedback.torque.norm());
            assert!(force <= 4.0 * (1.0 + 1e-12) && torque <= 0.1 * (1.0 + 1e-12));
            let (raw, _, _) = coupling.feedback(&handle, &result.state, &body);
            let over = raw.force.norm() > 4.0 || raw.torque.norm() > 0.1;
            assert_eq!(result.status.contains(Status::FEEDBACK_LIMITED), over && !result.status.is_fault());
            limited += usize::from(over);
        }
    }
    assert!(limited > 100, "the test reaches the limits");
}

#[test]
fn spring_without_stiffness_is_not_saturated() {
    let spring = Spring { stiffness: 0.0, limit: Some(1.0) };
    assert_eq!(spring.at(5.0).force, 0.0);
    assert!(!spring.is_saturated(5.0));
    assert!(!Spring { stiffness: 10.0, limit: None }.is_saturated(1e9));
}
