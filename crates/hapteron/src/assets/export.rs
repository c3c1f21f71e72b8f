//! Meshes as files that other programs read.

use std::io::{self, Write};

use hapteron_collision::mesh::TriMesh;

/// Writes a mesh as Wavefront OBJ, in metres.
///
/// The coordinates are written so that reading them gives the same bits back.
///
/// # Errors
/// Those of the writer.
pub fn write_obj(mesh: &TriMesh, name: &str, mut output: impl Write) -> io::Result<()> {
    // A line break in the name would become a line of the file.
    let name: String = name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    writeln!(output, "# {name}: {} triangles, metres", mesh.triangles().len())?;
    writeln!(output, "o {name}")?;
    for [x, y, z] in mesh.vertices() {
        writeln!(output, "v {x} {y} {z}")?;
    }
    for triangle in mesh.triangles() {
        let [a, b, c] = triangle.map(|i| u64::from(i) + 1);
        writeln!(output, "f {a} {b} {c}")?;
    }
    output.flush()
}

/// Writes a mesh as binary STL, in metres.
///
/// The format has 32-bit coordinates and repeats a vertex in each of its triangles; all copies of one vertex are equal.
///
/// # Errors
/// Those of the writer, and more triangles than the format can count.
pub fn write_stl(mesh: &TriMesh, mut output: impl Write) -> io::Result<()> {
    let count = u32::try_from(mesh.triangles().len())
        .map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
    // A binary file must not begin with "solid", by which readers know the text form.
    let mut header = [0u8; 80];
    let title = b"hapteron, metres";
    header[..title.len()].copy_from_slice(title);
    output.write_all(&header)?;
    output.write_all(&count.to_le_bytes())?;
    for triangle in mesh.triangles() {
        let corners = triangle.map(|i| mesh.vertices()[i as usize]);
        for vector in std::iter::once(unit_normal(corners)).chain(corners) {
            for coordinate in vector {
                output.write_all(&(coordinate as f32).to_le_bytes())?;
            }
        }
        output.write_all(&[0, 0])?;
    }
    output.flush()
}

/// Unit normal of a triangle; zero when it has no area.
fn unit_normal(corners: [[f64; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = corners;
    let normal = super::shape::cross(super::shape::subtract(b, a), super::shape::subtract(c, a));
    let length = super::shape::length(normal);
    if length > 0.0 { normal.map(|x| x / length) } else { [0.0; 3] }
}
