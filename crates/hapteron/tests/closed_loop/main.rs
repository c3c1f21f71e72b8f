//! The closed loop: hand, device, delay, encoder, guard and tick together.
#![allow(clippy::unwrap_used)]

mod behaviour;
mod detector;
mod grip_map;
mod prediction;
mod rig;
mod theory;
