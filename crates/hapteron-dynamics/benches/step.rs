//! Time of one step: `cargo bench -p hapteron-dynamics`.
#![allow(clippy::unwrap_used)]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Random, at_rest, spoon, still_handle};
use divan::{Bencher, black_box};
use hapteron_dynamics::reference::{condensed_solve, dense_solve};
use hapteron_dynamics::{
    ContactForce, ContactPlane, Coupling, Handle, Method, Problem, RigidBody, State, step,
};
use nalgebra::Vector3;

fn main() {
    divan::main();
}

struct Case {
    body: RigidBody,
    state: State,
    handle: Handle,
    coupling: Coupling,
    planes: Vec<ContactPlane>,
}

impl Case {
    /// `planes` planes, half of which push.
    fn new(planes: usize) -> Self {
        let mut random = Random::new(7);
        let body = random.body();
        let state = random.state(&body);
        let handle = random.handle(&state);
        let coupling = random.coupling(false);
        let planes = (0..planes).map(|_| random.plane(&state)).collect();
        Self { body, state, handle, coupling, planes }
    }

    /// At rest on eight planes, so that the same planes push at both ends of a step.
    fn settled() -> Self {
        let (body, coupling) = spoon(0.01);
        let mut state = at_rest(&body);
        let handle = Handle { position: Vector3::new(0.052_258, 0.0, 0.001_393), ..still_handle() };
        let planes = (0..8).map(|i| {
            let point = Vector3::new(0.05 - 0.015 * f64::from(i), if i % 2 == 0 { 0.01 } else { -0.01 }, 0.0);
            ContactPlane::new(point, &point, -Vector3::z(), 5e3, 3.0, 5e-4)
        });
        let planes: Vec<ContactPlane> = planes.collect();
        for _ in 0..2000 {
            let contact = ContactForce::Planes(&planes);
            let problem = Problem { contact, ..common::problem(&body, &coupling, &handle) };
            state = step(&problem, &state, 1e-3, Method::BackwardEuler).state;
        }
        Self { body, state, handle, coupling, planes }
    }

    fn problem(&self) -> Problem<'_> {
        Problem {
            body: &self.body,
            coupling: &self.coupling,
            handle: &self.handle,
            contact: ContactForce::Planes(&self.planes),
            gravity: Vector3::zeros(),
        }
    }
}

#[divan::bench(args = [0, 8, 64, 1000, 4000], sample_count = 1000, sample_size = 20)]
fn condensed_step(bencher: Bencher<'_, '_>, planes: usize) {
    let case = Case::new(planes);
    bencher.bench_local(|| condensed_solve(&case.problem(), black_box(&case.state), 1e-3));
}

#[divan::bench(args = [0, 8], sample_count = 1000, sample_size = 20)]
fn dense_13x13_step(bencher: Bencher<'_, '_>, planes: usize) {
    let case = Case::new(planes);
    bencher.bench_local(|| dense_solve(&case.problem(), black_box(&case.state), 1e-3));
}

/// A hard case: random planes, of which others push at the end than at the start, so that Backward Euler solves twice.
#[divan::bench(args = [
    Method::BackwardEuler,
    Method::BackwardEulerNewton,
    Method::RungeKutta4,
    Method::ForwardEuler,
    Method::QuasiStatic,
], sample_count = 1000, sample_size = 20)]
fn whole_step_with_8_planes(bencher: Bencher<'_, '_>, method: Method) {
    let case = Case::new(8);
    bencher.bench_local(|| step(&case.problem(), black_box(&case.state), 1e-3, method));
}

/// The usual case: a body that rests on its planes. With the wrenches at the end of the step.
#[divan::bench(args = [
    Method::BackwardEuler,
    Method::BackwardEulerNewton,
    Method::RungeKutta4,
    Method::ForwardEuler,
    Method::QuasiStatic,
], sample_count = 1000, sample_size = 20)]
fn whole_step_at_rest_on_8_planes(bencher: Bencher<'_, '_>, method: Method) {
    let case = Case::settled();
    bencher.bench_local(|| step(&case.problem(), black_box(&case.state), 1e-3, method));
}
