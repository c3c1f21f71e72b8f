//! Time of one step: `cargo bench -p hapteron-dynamics`.
#![allow(clippy::unwrap_used)]

#[path = "../tests/common/mod.rs"]
mod common;

use common::Random;
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

/// With the wrenches at the end, and a second solve where the first changes which planes push (as it does here).
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
