//! The explicit methods that the paper compares with (section 7.2).

use super::Problem;
use crate::state::State;

pub(super) fn forward_euler(problem: &Problem<'_>, state: &State, dt: f64) -> State {
    State::from_vector(&(state.to_vector() + problem.rate(state) * dt))
}

pub(super) fn runge_kutta_4(problem: &Problem<'_>, state: &State, dt: f64) -> State {
    let y = state.to_vector();
    let rate = |dy| problem.rate(&State::from_vector(&(y + dy)));
    let k1 = problem.rate(state);
    let k2 = rate(k1 * (0.5 * dt));
    let k3 = rate(k2 * (0.5 * dt));
    let k4 = rate(k3 * dt);
    State::from_vector(&(y + (k1 + (k2 + k3) * 2.0 + k4) * (dt / 6.0)))
}
