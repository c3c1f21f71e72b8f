//! The threads: what they do when all is well, and when one of them, or the device, is not.
//!
//! Nothing here asserts a time that a busy machine could miss: what is asserted holds however late the threads run.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;
mod recording;
mod rig;
mod sessions;
mod trouble;
