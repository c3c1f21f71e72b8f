//! Stability at rest from the eigenvalues of one step's Jacobian: catches a change of the damping, the lever or the
//! integrators that moves the masses from which the methods of section 7.2 are stable.
#![allow(clippy::unwrap_used)]

mod common;

use common::{at_rest, problem, spoon, still_handle};
use hapteron_dynamics::{
    ContactForce, ContactPlane, Coupling, Handle, LinearizedContact, Method, Problem, RigidBody, State, step,
};
use nalgebra::{SMatrix, SVector, Vector3};

const STEP: f64 = 1e-3;

/// The spoon of the given mass (kg), held without deviation by a handle that stays.
fn held_spoon(mass: f64) -> (RigidBody, Coupling, Handle, State) {
    let (body, coupling) = spoon(mass);
    let handle = Handle { position: Vector3::new(0.052_258, 0.0, 0.011_393), ..still_handle() };
    let state = at_rest(&body);
    (body, coupling, handle, state)
}

/// The largest modulus of an eigenvalue of d(step)/dy at a state at rest, by central differences.
///
/// Every component is counted in units of its own size, which does not change the eigenvalues.
fn spectral_radius(problem: &Problem<'_>, state: &State, method: Method) -> f64 {
    let least = problem.body.inertia_b().symmetric_eigenvalues().min();
    let (p, l) = (problem.body.mass(), least);
    let unit =
        SVector::<f64, 13>::from_column_slice(&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, p, p, p, l, l, l]) * 1e-5;
    let after = |y: SVector<f64, 13>| step(problem, &State::from_vector(&y), STEP, method).state.to_vector();
    let mut j = SMatrix::<f64, 13, 13>::zeros();
    for column in 0..13 {
        let mut change = SVector::<f64, 13>::zeros();
        change[column] = unit[column];
        let y = state.to_vector();
        let slope = (after(y + change) - after(y - change)).component_div(&unit) * 0.5;
        j.set_column(column, &slope);
    }
    j.complex_eigenvalues().iter().map(|e| e.re.hypot(e.im)).fold(0.0, f64::max)
}

/// The smallest stable mass in grams, by bisection between an unstable and a stable one.
fn smallest_stable_mass(method: Method) -> f64 {
    let radius = |grams: f64| {
        let (body, coupling, handle, state) = held_spoon(grams * 1e-3);
        spectral_radius(&problem(&body, &coupling, &handle), &state, method)
    };
    let (mut low, mut high) = (20.0, 300.0);
    assert!(radius(low) > 1.0 && radius(high) < 1.0);
    while high - low > 1e-4 {
        let middle = 0.5 * (low + high);
        if radius(middle) < 1.0 { high = middle } else { low = middle }
    }
    high
}

#[test]
fn explicit_methods_are_stable_from_the_masses_of_fig_2() {
    for (method, expected) in [(Method::ForwardEuler, 96.70), (Method::RungeKutta4, 69.80)] {
        let mass = smallest_stable_mass(method);
        assert!((mass - expected).abs() < 0.01, "{method:?}: {mass} g");
    }
}

#[test]
fn backward_euler_is_stable_at_any_mass() {
    for method in [Method::BackwardEuler, Method::BackwardEulerNewton] {
        for grams in [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0] {
            let (body, coupling, handle, state) = held_spoon(grams * 1e-3);
            let radius = spectral_radius(&problem(&body, &coupling, &handle), &state, method);
            assert!(radius < 1.0, "{method:?} at {grams} g: {radius}");
        }
    }
}

/// Touching one, two and three walls of up to 1 MN/m, by Eq. 30: the implicit step stays stable, the explicit ones do not.
#[test]
fn backward_euler_is_stable_against_any_wall() {
    for grams in [0.5, 10.0, 100.0] {
        for stiffness in [1e3, 1e4, 1e5, 1e6] {
            let (body, coupling, handle, state) = held_spoon(grams * 1e-3);
            let damping = 0.5 * (stiffness * body.mass()).sqrt();
            let wall = |point: Vector3<f64>, normal: Vector3<f64>| {
                // Just inside, so that it pushes next to nothing and the body is at rest.
                ContactPlane::new(point, &point, normal, stiffness, damping, 1e-12)
            };
            let walls = [
                wall(Vector3::new(-0.1, 0.0, 0.0), -Vector3::z()),
                wall(Vector3::new(0.0, 0.02, 0.0), Vector3::y()),
                wall(Vector3::new(0.05, -0.02, 0.0), Vector3::new(0.6, -0.8, 0.0)),
            ];
            for count in 1..=walls.len() {
                // Linear to both sides, so that the small changes do not end the contact.
                let model = LinearizedContact::from_planes(&walls[..count], &body, &state);
                let contact = ContactForce::Linearized(&model);
                let problem = Problem { contact, ..problem(&body, &coupling, &handle) };
                let radius = spectral_radius(&problem, &state, Method::BackwardEuler);
                assert!(radius < 1.0, "{grams} g, {count} walls of {stiffness} N/m: {radius}");
                if stiffness >= 1e6 {
                    assert!(spectral_radius(&problem, &state, Method::RungeKutta4) > 1.0);
                    assert!(spectral_radius(&problem, &state, Method::ForwardEuler) > 1.0);
                }
            }
        }
    }
}
