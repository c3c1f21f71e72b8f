//! Dynamics of a rigid body that a hand holds through a virtual coupling, pressed against contact planes.
//!
//! Here live the state of the body, the forces on it with their Jacobians, and the integrators: the mathematics of
//! Otaduy and Lin, "Stable and Responsive Six-Degree-of-Freedom Haptic Manipulation Using Implicit Integration" (World
//! Haptics 2005), "the paper", with its equation numbers. `docs/equations.md` lists every equation with its function, its test
//! and its deviation from print (D1, D2, ...).
//!
//! What never lives here: meshes and collision detection, devices, files, clocks, threads, memory allocation. Everything is
//! plain arithmetic of bounded time on `f64`, without a panic, and so may be called from a haptic thread.
//!
//! Checked: `cargo build -p hapteron-dynamics --target thumbv7em-none-eabihf` (after `rustup target add` of it) builds where there is
//! no std; `cargo test -p hapteron-dynamics --test panic_paths -- --ignored` looks for a panic or an allocation in the machine code.
//!
//! Frames: W world, B body (at its centre of mass), C coupling, H handle. A suffix names the frame in which a vector
//! is expressed. SI units and radians. State order x, q (w, x, y, z), P, L.
#![no_std]
#![forbid(unsafe_code)]

mod contact;
mod coupling;
mod integrator;
mod linearization;
mod mass;
mod quaternion;
mod saturation;
mod state;
mod status;
mod wrench;

pub use contact::{ContactForce, ContactPlane, LinearizedContact};
pub use coupling::{Coupling, CouplingError, Handle};
pub use integrator::{Method, Problem, Step, step};
pub use linearization::{Linearization, Motion, StateJacobian};
pub use mass::{RigidBody, RigidBodyError};
pub use quaternion::{
    angular_velocity, angular_velocity_derivative, quaternion_rate_derivative, quaternion_rate_matrix,
    rotation, rotation_derivative, skew, turn_matrix,
};
pub use saturation::{Spring, SpringForce};
pub use state::State;
pub use status::Status;
pub use wrench::Wrench;

/// What a test needs to look at from outside and a caller does not: the two linear systems of one step.
pub mod reference {
    pub use crate::integrator::{Residual, condensed_solve, dense_solve};
}
