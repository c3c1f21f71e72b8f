//! The linear loop by itself: matrices written down from the equations, nothing of the crates' code.

use nalgebra::{SMatrix, SVector};

const T: f64 = 1e-3;

/// Device and hand as one mass on a spring and damper.
#[derive(Clone, Copy)]
pub struct Plant {
    pub mass: f64,
    pub damping: f64,
    pub stiffness: f64,
    /// Samples, 0 to 2.
    pub delay: usize,
    /// Share of the new difference in the velocity estimate.
    pub filter: f64,
}

/// What computes the force from position and velocity estimate.
#[derive(Clone, Copy)]
pub enum Virtual {
    /// -(k x + b v).
    Direct { k: f64, b: f64 },
    /// A body of 10 g behind a coupling, against a wall on both sides, by Backward Euler.
    Body { k: f64, b: f64, wall: f64, wall_damping: f64 },
}

type State = SMatrix<f64, 8, 8>;
type Row = SVector<f64, 8>;

/// exp(A T) for [position, velocity, force held].
fn hold(p: &Plant) -> SMatrix<f64, 3, 3> {
    let a = SMatrix::<f64, 3, 3>::new(
        0.0,
        1.0,
        0.0,
        -p.stiffness / p.mass,
        -p.damping / p.mass,
        1.0 / p.mass,
        0.0,
        0.0,
        0.0,
    ) * T;
    let (mut sum, mut term) = (SMatrix::identity(), SMatrix::identity());
    for i in 1..40 {
        term = term * a / f64::from(i);
        sum += term;
    }
    sum
}

/// From one tick to the next: [x, v, x before, v estimate, body x, body v, force of the last tick, of the one before].
fn transition(p: &Plant, virtual_side: &Virtual) -> State {
    let unit = |i: usize| Row::from_fn(|r, _| if r == i { 1.0 } else { 0.0 });
    let (x, v, x_before, estimate) = (unit(0), unit(1), unit(2), unit(3));
    let (body_x, body_v, last, older) = (unit(4), unit(5), unit(6), unit(7));
    let estimate = estimate * (1.0 - p.filter) + (x - x_before) * (p.filter / T);
    let (force, next_x, next_v) = match *virtual_side {
        Virtual::Direct { k, b } => (-(x * k + estimate * b), Row::zeros(), Row::zeros()),
        Virtual::Body { k, b, wall, wall_damping } => {
            let m = 0.01;
            let whole = m / T + T * k + b + T * wall + wall_damping;
            let next_v = (body_v * (m / T) + (x - body_x) * k + estimate * b - body_x * wall) / whole;
            let next_x = body_x + next_v * T;
            (-((x - next_x) * k + (estimate - next_v) * b), next_x, next_v)
        }
    };
    let acting = [force, last, older][p.delay];
    let e = hold(p);
    let moved = |row: usize| x * e[(row, 0)] + v * e[(row, 1)] + acting * e[(row, 2)];
    let rows = [moved(0), moved(1), x, estimate, next_x, next_v, force, last];
    State::from_fn(|r, c| rows[r][c])
}

/// The spectral radius is no more than 1: by squaring the matrix 40 times, a trillion ticks.
pub fn is_stable(p: &Plant, virtual_side: &Virtual) -> bool {
    // In units in which the entries are of one size.
    let scale = [1.0, 1e-2, 1.0, 1e-2, 1.0, 1e-2, 1e-3, 1e-3];
    let mut a = transition(p, virtual_side);
    a = State::from_fn(|r, c| a[(r, c)] * scale[r] / scale[c]);
    let mut log_radius = 0.0;
    let mut power = 1.0;
    for _ in 0..40 {
        let size = a.norm();
        log_radius += size.ln() / power;
        a /= size;
        a *= a;
        power *= 2.0;
    }
    log_radius + a.norm().max(1e-300).ln() / power <= 1e-9
}

/// Where stability is first lost going up, or infinity; `None` when it is not there at the start.
pub fn first_loss(from: f64, to: f64, stable: impl Fn(f64) -> bool) -> Option<f64> {
    if !stable(from) {
        return None;
    }
    let ratio = 1.05;
    let mut a = from;
    while a < to {
        let b = a * ratio;
        if !stable(b) {
            let (mut a, mut b) = (a, b);
            for _ in 0..30 {
                let c = (a * b).sqrt();
                if stable(c) { a = c } else { b = c }
            }
            return Some(a);
        }
        a = b;
    }
    Some(f64::INFINITY)
}
