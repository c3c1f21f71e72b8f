//! The commands, one file each.

pub mod compare;
pub mod demo;
pub mod levels;
pub mod mesh;
pub mod models;
pub mod query;
pub mod reproduce;
pub mod run;
