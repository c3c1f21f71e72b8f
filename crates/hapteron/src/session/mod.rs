//! The session: one pure haptic tick, the contact pass, and what runs them.
//!
//! A tick's way: device sample -> scaling -> [`tick`] (coupling, contacts, one integration step) -> scaling -> device command.
//! A pass's way: body state -> exact query -> clusters -> contact planes -> [`ContactSnapshot`]. The pass is the only place where
//! collision and dynamics meet. [`VirtualTime`] runs both on one deterministic schedule.

mod contact_pass;
mod flags;
mod thinning;
mod tick;
mod virtual_time;

pub use contact_pass::{ContactPass, ContactSnapshot, MAX_PLANES};
pub use flags::Flags;
pub use tick::{HapticState, Settings, Tick, tick};
pub use virtual_time::{Progress, VirtualTime, run_virtual};
