//! Rigid objects that a hand can grip, turn and feel against each other.

pub mod assets;
pub mod motion;
pub mod trajectory;
