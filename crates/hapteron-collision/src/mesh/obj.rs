//! Wavefront OBJ: `v` and `f` lines; everything else is left unread.
//!
//! Own rather than a crate's, because an error must name the line and the cure, and a comment in any encoding is no error.

use super::error::{MeshError, MeshProblem};
use super::{Raw, polygon, text};

pub(super) fn parse(bytes: &[u8]) -> Result<Raw, MeshError> {
    let bytes = &*text::with_line_feeds(bytes);
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut faces: Vec<(usize, Vec<i64>)> = Vec::new();
    let mut continued = String::new();
    let last = 1 + bytes.iter().filter(|&&b| b == b'\n').count();
    for (number, line) in text::lines(bytes) {
        let line = line.trim_end_matches('\r');
        let comment = continued.is_empty() && line.trim_start().starts_with('#');
        let part = line.strip_suffix('\\').filter(|_| !comment);
        if let Some(part) = part.filter(|_| number < last) {
            continued.push_str(part);
            continued.push(' ');
            continue;
        }
        let whole = std::mem::take(&mut continued) + part.unwrap_or(line);
        let mut words = whole.split('#').next().unwrap_or_default().split_ascii_whitespace();
        let result = match words.next() {
            Some("v") => vertex(words).map(|v| vertices.push(v)),
            Some("f") => {
                face(words, faces.len(), vertices.len()).map(|corners| faces.push((number, corners)))
            }
            _ => Ok(()),
        };
        result.map_err(|problem| MeshError::at(number, problem))?;
    }
    let mut triangles = Vec::with_capacity(faces.len());
    for (face, (line, corners)) in faces.iter().enumerate() {
        let corners: Result<Vec<u32>, MeshProblem> = corners
            .iter()
            .map(|&index| match u32::try_from(index) {
                Ok(v) if (v as usize) < vertices.len() => Ok(v),
                // Counted from 1 in the file.
                _ => {
                    Err(MeshProblem::Index { face, index: index.saturating_add(1), vertices: vertices.len() })
                }
            })
            .collect();
        let corners = corners.map_err(|problem| MeshError::at(*line, problem))?;
        polygon::cut(&corners, &vertices, &mut triangles);
    }
    Ok((vertices, triangles))
}

fn vertex<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<[f64; 3], MeshProblem> {
    let mut next = || match words.next() {
        Some(word) => text::coordinate(word),
        None => Err(MeshProblem::Syntax("a vertex needs three coordinates".into())),
    };
    Ok([next()?, next()?, next()?])
}

/// Corners counted from 0; a negative index in the file counts back from the last vertex before the line.
fn face<'a>(
    words: impl Iterator<Item = &'a str>,
    face: usize,
    vertices: usize,
) -> Result<Vec<i64>, MeshProblem> {
    let corners: Result<Vec<i64>, MeshProblem> = words
        .map(|word| {
            let index: i64 = text::number(word.split('/').next().unwrap_or_default(), "a vertex index")?;
            match index {
                0 => Err(MeshProblem::Syntax(
                    "vertex index 0; OBJ counts from 1, export the mesh again".into(),
                )),
                1.. => Ok(index - 1),
                _ if index.saturating_add(vertices as i64) < 0 => {
                    Err(MeshProblem::Index { face, index, vertices })
                }
                _ => Ok(index + vertices as i64),
            }
        })
        .collect();
    let corners = corners?;
    if corners.len() < 3 {
        return Err(MeshProblem::FewCorners { corners: corners.len() });
    }
    Ok(corners)
}
