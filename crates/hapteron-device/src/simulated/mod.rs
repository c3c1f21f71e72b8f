//! Devices that are computed: a handle with mass, friction, encoders and motors, and the hand that holds it.
//!
//! They close the loop without hardware, in virtual time (deterministic: the seed decides everything random) and in real time.

mod catalogue;
mod device;
mod handle;
mod random;

pub use catalogue::{CATALOGUE, DEFAULT_MODEL, DeviceModel, model};
pub use device::{MOST_DELAY, SimulatedDevice, SimulatedError, SimulatedSettings};
pub use random::Random;
