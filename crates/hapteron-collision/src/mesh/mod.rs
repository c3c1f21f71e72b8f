//! Triangle meshes: reading them, checking them, their mass properties.

mod check;
mod error;
mod mass;
mod obj;
mod off;
mod ply;
mod polygon;
mod stl;
mod text;

pub use check::{MeshReport, check};
pub use error::{MeshError, MeshProblem};
pub use mass::{MassProperties, mass_properties};

use std::path::Path;

/// Largest coordinate that a mesh may have, in metres: squares and volumes of it stay exact enough to be of use.
pub const LARGEST_COORDINATE: f64 = 1e9;

/// A triangle mesh that has been looked at: all coordinates are finite and at most [`LARGEST_COORDINATE`], all indices are in range, and
/// there is at least one triangle. Triangles without area are left out and counted.
///
/// Lengths are metres, in the mesh frame M. Corners run counter-clockwise seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct TriMesh {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    dropped: usize,
}

impl TriMesh {
    /// Checks and keeps a mesh.
    ///
    /// # Errors
    /// A coordinate that is not finite or too large, an index out of range, no triangle with an area.
    pub fn new(vertices: Vec<[f64; 3]>, mut triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if u32::try_from(vertices.len()).is_err() || u32::try_from(triangles.len()).is_err() {
            return Err(MeshError::new("mesh", MeshProblem::TooLarge));
        }
        for (index, vertex) in vertices.iter().enumerate() {
            if let Some(&value) = vertex.iter().find(|c| !(c.abs() <= LARGEST_COORDINATE)) {
                return Err(MeshError::new("mesh", MeshProblem::Coordinate { vertex: index, value }));
            }
        }
        let count = vertices.len();
        for (index, triangle) in triangles.iter().enumerate() {
            if let Some(&bad) = triangle.iter().find(|&&v| v as usize >= count) {
                let problem = MeshProblem::Index { face: index, index: i64::from(bad), vertices: count };
                return Err(MeshError::new("mesh", problem));
            }
        }
        let all = triangles.len();
        triangles.retain(|t| has_area(t.map(|v| vertices[v as usize])));
        if triangles.is_empty() {
            return Err(MeshError::new("mesh", MeshProblem::NoTriangles { without_area: all }));
        }
        let dropped = all - triangles.len();
        Ok(Self { vertices, triangles, dropped })
    }

    /// Vertices, metres, mesh frame.
    #[must_use]
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// Triangles as indices of vertices, counter-clockwise seen from outside.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// How many triangles without area were left out.
    #[must_use]
    pub fn dropped_triangles(&self) -> usize {
        self.dropped
    }

    /// The mesh with all lengths multiplied by `factor`, for files that are not in metres.
    ///
    /// # Errors
    /// A factor that is not positive and finite, or that makes coordinates too large.
    pub fn scaled(&self, factor: f64) -> Result<Self, MeshError> {
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(MeshError::new("mesh", MeshProblem::Scale { factor }));
        }
        let vertices = self.vertices.iter().map(|v| v.map(|c| c * factor)).collect();
        let scaled = Self::new(vertices, self.triangles.clone())?;
        Ok(Self { dropped: self.dropped + scaled.dropped, ..scaled })
    }

    /// Least and greatest coordinates of the vertices that belong to a triangle.
    #[must_use]
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for &v in self.triangles.iter().flatten() {
            let vertex = self.vertices[v as usize];
            for axis in 0..3 {
                low[axis] = low[axis].min(vertex[axis]);
                high[axis] = high[axis].max(vertex[axis]);
            }
        }
        [low, high]
    }

    /// Centre and radius of an enclosing sphere at most 1 % larger than the smallest.
    ///
    /// From the middle of the box the centre steps ever less towards the farthest vertex (Badoiu and Clarkson, "Smaller core-sets for
    /// balls", 2003).
    #[must_use]
    pub fn bounding_sphere(&self) -> ([f64; 3], f64) {
        use crate::vector::{add, norm, scale, sub};
        const STEPS: u32 = 100;
        let used = || self.triangles.iter().flatten().map(|&v| self.vertices[v as usize]);
        let [low, high] = self.bounds();
        let mut center = scale(add(low, high), 0.5);
        let mut best = (center, f64::INFINITY);
        for step in 1..=STEPS {
            let farthest = used().fold((center, 0.0), |best, v| {
                let distance = norm(sub(v, center));
                if distance > best.1 { (v, distance) } else { best }
            });
            if farthest.1 < best.1 {
                best = (center, farthest.1);
            }
            center = add(center, scale(sub(farthest.0, center), 1.0 / (f64::from(step) + 1.0)));
        }
        best
    }
}

fn has_area([a, b, c]: [[f64; 3]; 3]) -> bool {
    let normal = crate::vector::cross(crate::vector::sub(b, a), crate::vector::sub(c, a));
    crate::vector::dot(normal, normal) > 0.0
}

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// Stereolithography, text or binary.
    Stl,
    /// Polygon file format, text or binary of either byte order.
    Ply,
    /// Object file format of Geomview.
    Off,
}

impl Format {
    /// The format that the bytes look like, or else the one that the file's extension names.
    #[must_use]
    pub fn detect(name: &str, bytes: &[u8]) -> Option<Self> {
        let extension = name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase());
        match extension.as_deref() {
            Some("obj") => return Some(Self::Obj),
            Some("stl") => return Some(Self::Stl),
            Some("ply") => return Some(Self::Ply),
            Some("off") => return Some(Self::Off),
            _ => {}
        }
        if bytes.starts_with(b"ply") {
            Some(Self::Ply)
        } else if bytes.starts_with(b"solid") || stl::is_binary(bytes) {
            Some(Self::Stl)
        } else if off::is_off(bytes) {
            Some(Self::Off)
        } else {
            None
        }
    }
}

/// Reads a mesh file (OBJ, STL, PLY, OFF).
///
/// # Errors
/// A file that cannot be read or holds no valid mesh: with the file, the line where there is one, and what to do.
pub fn load(path: impl AsRef<Path>) -> Result<TriMesh, MeshError> {
    let path = path.as_ref();
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|e| MeshError::new(&name, MeshProblem::Io(e)))?;
    let format =
        Format::detect(&name, &bytes).ok_or_else(|| MeshError::new(&name, MeshProblem::UnknownFormat))?;
    parse(&bytes, format, &name)
}

/// Reads a mesh from memory; `name` stands for the file in errors.
///
/// # Errors
/// As [`load`].
pub fn parse(bytes: &[u8], format: Format, name: &str) -> Result<TriMesh, MeshError> {
    // The mark that some editors put before a text in UTF-8.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(MeshError::new(name, MeshProblem::Empty));
    }
    let (vertices, triangles) = match format {
        Format::Obj => obj::parse(bytes),
        Format::Stl => stl::parse(bytes),
        Format::Ply => ply::parse(bytes),
        Format::Off => off::parse(bytes),
    }
    .map_err(|error| error.in_file(name))?;
    TriMesh::new(vertices, triangles).map_err(|error| error.in_file(name))
}

/// What a parser returns: vertices and triangles, not yet checked.
type Raw = (Vec<[f64; 3]>, Vec<[u32; 3]>);
