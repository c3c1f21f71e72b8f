//! The commands, one file each.

pub mod bench;
pub mod compare;
pub mod demo;
pub mod devices;
pub mod faults;
pub mod levels;
pub mod live;
pub mod mesh;
pub mod models;
pub mod query;
mod real_time;
pub mod reproduce;
pub mod run;
pub mod stability;
