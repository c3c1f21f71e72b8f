//! Meshes, and where two of them touch.
//!
//! Here live triangle meshes (reading, checking, mass properties), the frozen query structure of a mesh ([`Surface`]), the
//! exact query for contacts between two of them ([`query()`]) and the clusters that stand for many contacts. What
//! never lives here: forces, states, time, threads. All of it belongs to the contact thread or to set-up; nothing here is
//! meant for the haptic thread.

pub mod clod;
pub mod cluster;
mod contact;
pub mod mesh;
mod query;
mod surface;
mod vector;

pub use contact::Contact;
pub use query::{QueryResult, QueryWorkspace, query};
pub use surface::Surface;
