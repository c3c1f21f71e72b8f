//! Stand-ins for haptic devices, with a hand on each: for the tests of the drivers.
//!
//! The dynamic library of this crate has the C symbols of Force Dimension's DHD/DRD and of OpenHaptics' HDAPI; a test copies and loads it, so that
//! each test has a device of its own, and scripts it through `emulator_set` and `emulator_get` ([`control`]). The services (Haply, spacenavd, VRPN)
//! are threads of the test. Behind all of them is one model of a hand that holds a handle ([`HandAndHandle`]).
//!
//! Written after the public descriptions of the interfaces; no vendor's code is in here. What never lives here: anything that the product needs.

pub mod control;
mod dhd;
mod hand;
mod haply;
mod hd;
#[cfg(unix)]
mod spacenav;
mod vrpn;

pub use hand::HandAndHandle;
pub use haply::{Generation, HaplyService, HaplyState};
#[cfg(unix)]
pub use spacenav::Spacenavd;
pub use vrpn::{VrpnServer, VrpnState, vrpn_message, vrpn_pose};
