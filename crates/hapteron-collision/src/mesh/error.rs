//! What can be wrong with a mesh.

/// A mesh that cannot be used: which file, which line, what is wrong and what to do about it.
#[derive(Debug, thiserror::Error)]
#[error("{file}{}: {problem}", .line.map(|l| format!(", line {l}")).unwrap_or_default())]
pub struct MeshError {
    /// The file, or "mesh" for one that was made in memory.
    pub file: String,
    /// Line in the file, counted from 1, for text formats.
    pub line: Option<usize>,
    /// What is wrong.
    #[source]
    pub problem: MeshProblem,
}

impl MeshError {
    pub(super) fn new(file: &str, problem: MeshProblem) -> Self {
        Self { file: file.to_owned(), line: None, problem }
    }

    pub(super) fn at(line: usize, problem: MeshProblem) -> Self {
        Self { file: String::new(), line: Some(line), problem }
    }

    pub(super) fn in_file(self, file: &str) -> Self {
        Self { file: file.to_owned(), ..self }
    }
}

impl From<MeshProblem> for MeshError {
    fn from(problem: MeshProblem) -> Self {
        Self::new("mesh", problem)
    }
}

/// The kinds of fault, each with its cure.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshProblem {
    /// The file could not be read.
    #[error("cannot read the file: {0}")]
    Io(std::io::Error),
    /// Neither the name nor the content tells the format.
    #[error("unknown mesh format; use a .obj, .stl, .ply or .off file")]
    UnknownFormat,
    /// Nothing in it.
    #[error("the file is empty; export the mesh again")]
    Empty,
    /// It ends too early.
    #[error("the file ends in the middle of {0}; it is truncated, copy or export it again")]
    Truncated(&'static str),
    /// A header promises more than the file can hold.
    #[error(
        "the header announces {announced} {what} but the file has room for {room} at most; it is damaged or truncated, export it again"
    )]
    Lying {
        /// What the header counts.
        what: &'static str,
        /// How many it says.
        announced: u64,
        /// How many the rest of the file can hold.
        room: u64,
    },
    /// A header promises less than the file holds.
    #[error("the header announces {announced} {what} but more follow; it is damaged, export it again")]
    Excess {
        /// What the header counts.
        what: &'static str,
        /// How many it says.
        announced: u64,
    },
    /// A word where a number should be.
    #[error("expected a number for {what}, found '{found}'")]
    NotANumber {
        /// What the number stands for.
        what: &'static str,
        /// The word.
        found: String,
    },
    /// Something that the format does not have.
    #[error("{0}")]
    Syntax(String),
    /// Infinite, not a number, or absurdly large.
    #[error(
        "vertex {vertex} has the coordinate {value}; coordinates must be finite and at most 1e9, repair the mesh or set its scale"
    )]
    Coordinate {
        /// Counted from 0.
        vertex: usize,
        /// The coordinate.
        value: f64,
    },
    /// The same where the line tells which vertex.
    #[error(
        "the coordinate {value}; coordinates must be finite and at most 1e9, repair the mesh or set its scale"
    )]
    NotACoordinate {
        /// The coordinate.
        value: f64,
    },
    /// An index beyond the vertices.
    #[error(
        "face {face} uses vertex {index}, but there are {vertices} vertices; repair or re-export the mesh"
    )]
    Index {
        /// Counted from 0.
        face: usize,
        /// As in the file.
        index: i64,
        /// How many there are.
        vertices: usize,
    },
    /// A face with fewer than three corners.
    #[error("face with {corners} corners; a face needs at least 3")]
    FewCorners {
        /// How many it has.
        corners: usize,
    },
    /// Nothing to touch.
    #[error("no triangle with an area ({without_area} without); export the mesh with faces")]
    NoTriangles {
        /// How many triangles have none.
        without_area: usize,
    },
    /// More than 2^32 vertices or triangles.
    #[error("more than 4 billion vertices or triangles; simplify the mesh")]
    TooLarge,
    /// A scale that makes no size.
    #[error("scale {factor} is not a positive number; use 0.001 for a mesh in millimetres")]
    Scale {
        /// The factor.
        factor: f64,
    },
    /// Mass properties of a mesh without an inside.
    #[error(
        "the mesh encloses no volume ({reason}); give the body mass, center_of_mass and inertia, or repair the mesh"
    )]
    NoVolume {
        /// Why.
        reason: String,
    },
}
