//! The models that come with the library, made by its own code.
//!
//! Nothing is read from files: every model is generated, with the same bits on every machine and in every profile
//! (only IEEE 754 arithmetic, exact square roots and `libm`). All are closed, manifold and oriented outwards.
//!
//! | name | what | triangles | frame |
//! |---|---|---|---|
//! | `spoon` | 20 cm spoon of the paper's sections 7.2 and 7.3 | 1,344 | x along it, bowl at negative x, z up, origin at the centre of mass |
//! | `cup` | mug with a handle, fits a sphere of 8 cm radius | 4,000 | foot on z = 0, axis z, handle towards positive x |
//! | `lower_jaw` | cast of fourteen teeth, 6 cm radius, of section 7.4 | 40,180 | tips of the teeth near z = 0, base below, front towards positive y |
//! | `upper_jaw` | its counterpart | 47,340 | as the lower jaw's, base above; at the identity the cusps stand between the lower jaw's, 0.25 mm away |
//!
//! The paper's upper jaw has 47,339 triangles; a closed surface has an even number.
//!
//! Lengths are metres. Set-up only: generating allocates and takes milliseconds.

mod cup;
mod export;
mod jaws;
mod shape;
mod spoon;

pub use export::{write_obj, write_stl};

use hapteron_collision::mesh::{MeshError, TriMesh};

/// Names that [`builtin`] knows.
pub const BUILTIN_NAMES: [&str; 4] = ["spoon", "cup", "lower_jaw", "upper_jaw"];

/// Where the opening of the cup's handle is, for a scene that puts something through it.
pub use cup::{OPENING, Opening};

/// A built-in model that cannot be had.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AssetError {
    /// No model has this name.
    #[error("no built-in model is called \"{name}\"; there are {}", BUILTIN_NAMES.join(", "))]
    UnknownName {
        /// The name that was asked for.
        name: String,
    },
    /// The generated triangles are not a valid mesh: a fault of this library.
    #[error("the built-in model \"{name}\" is faulty, please report this: {problem}")]
    Faulty {
        /// The name that was asked for.
        name: String,
        /// What is wrong with the triangles.
        #[source]
        problem: MeshError,
    },
}

/// A built-in model by its name, in metres and in the frame that the [module page](self) gives.
///
/// # Errors
/// A name that is not among [`BUILTIN_NAMES`].
pub fn builtin(name: &str) -> Result<TriMesh, AssetError> {
    let shape = generate(name).ok_or_else(|| AssetError::UnknownName { name: name.to_owned() })?;
    TriMesh::new(shape.vertices, shape.triangles)
        .map_err(|problem| AssetError::Faulty { name: name.to_owned(), problem })
}

/// The triangles of a model before they are checked.
fn generate(name: &str) -> Option<shape::Shape> {
    match name {
        "spoon" => Some(spoon::generate()),
        "cup" => Some(cup::generate()),
        "lower_jaw" => Some(jaws::lower()),
        "upper_jaw" => Some(jaws::upper()),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
