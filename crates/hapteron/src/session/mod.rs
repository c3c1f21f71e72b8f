//! The session: one pure haptic tick, the contact pass, and what runs them.
//!
//! A tick's way: device sample -> scaling -> [`tick`] (coupling, contacts, one integration step) -> scaling -> device command.
//! A pass's way: body state -> exact query -> clusters -> contact planes -> [`ContactSnapshot`]. The pass is the only place where
//! collision and dynamics meet. [`real_time`] runs both on threads of their own, [`VirtualTime`] on one deterministic schedule, and [`replay()`]
//! on the schedule that a session in real time had.

mod command;
mod contact_pass;
mod flags;
pub mod grasp;
pub mod log;
pub mod real_time;
mod replay;
mod thinning;
mod tick;
mod virtual_time;

pub use command::{Command, CommandError, ContactLaw, Gains, apply};
pub use contact_pass::{ContactPass, ContactSnapshot, LevelsInUse, MAX_PLANES, View, handle_speed};
pub use flags::Flags;
pub use replay::replay;
pub use tick::{BLEND_TIME, HapticState, Settings, Tick, tick};
pub use virtual_time::{Progress, VirtualTime, run_virtual, run_virtual_for};
