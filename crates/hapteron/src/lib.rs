//! Six-degree-of-freedom haptic rendering: a hand grips, turns and feels a rigid object against a scene.
//!
//! The façade over `hapteron-dynamics`, `hapteron-collision` and `hapteron-device`: scenes, trajectories, the session with its one pure
//! haptic tick, recordings, and the built-in models. What never lives here: mathematics of the body and of contact (dynamics), of
//! surfaces (collision), the command line and its reports.

pub mod assets;
pub mod motion;
pub mod recording;
pub mod scene;
pub mod scenes;
pub mod session;
pub mod trajectory;

pub use hapteron_collision as collision;
pub use hapteron_device as device;
pub use hapteron_dynamics as dynamics;
