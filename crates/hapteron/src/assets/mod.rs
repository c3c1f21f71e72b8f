//! The models that come with the library.
pub mod export;
mod cup;
mod shape;
mod spoon;

use hapteron_collision::mesh::TriMesh;

/// Names that [`builtin`] knows.
pub const BUILTIN_NAMES: [&str; 2] = ["spoon", "cup"];
#[doc(hidden)]
pub fn raw(name: &str) -> Option<(Vec<[f64; 3]>, Vec<[u32; 3]>)> {
    let s = match name { "spoon" => spoon::generate(), "cup" => cup::generate(), _ => return None };
    Some((s.vertices, s.triangles))
}
#[cfg(test)]
mod tests;
