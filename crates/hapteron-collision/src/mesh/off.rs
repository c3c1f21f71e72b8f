//! OFF of Geomview, with the prefixes for colours, normals and texture coordinates (whose numbers are skipped), and as others write it: without the
//! number of edges, and with colours that the header does not announce.

use super::error::{MeshError, MeshProblem};
use super::text::{self, Words};
use super::{Raw, polygon};

/// Whether the first word is OFF with one of its prefixes.
pub(super) fn is_off(bytes: &[u8]) -> bool {
    let first = bytes.split(u8::is_ascii_whitespace).find(|w| !w.is_empty()).unwrap_or_default();
    first.ends_with(b"OFF") && first.len() <= 7
}

pub(super) fn parse(bytes: &[u8]) -> Result<Raw, MeshError> {
    let bytes = &*text::with_line_feeds(bytes);
    let mut words = Words::new(bytes, 1);
    let (line, first) = words.next("the header")?;
    let announced_extra = match first {
        "OFF" => false,
        "COFF" | "NOFF" | "CNOFF" | "NCOFF" | "STOFF" | "STCOFF" | "STNOFF" | "STNCOFF" | "STCNOFF" => true,
        _ => {
            let text = format!(
                "expected 'OFF', found '{}'; only three-dimensional text OFF is read",
                first.chars().take(40).collect::<String>()
            );
            return Err(MeshError::at(line, MeshProblem::Syntax(text)));
        }
    };
    let announced: [u64; 2] = [words.number("the number of vertices")?, words.number("the number of faces")?];
    if words.left_in_line() > 0 || words.in_next_line() == 1 {
        let _edges: u64 = words.number("the number of edges")?;
    }
    let at = |words: &Words<'_>, p| MeshError::at(words.line(), p);
    let count =
        text::check_count("vertices", announced[0], words.remaining(), 6).map_err(|p| at(&words, p))?;
    let mut vertices = Vec::with_capacity(count);
    let in_line = words.in_next_line();
    let alone_in_line = announced_extra || in_line > 3;
    for _ in 0..count {
        if !announced_extra && alone_in_line && words.in_next_line() != in_line {
            words.next("a coordinate")?;
            return Err(at(&words, unlike(in_line)));
        }
        vertices.push([words.coordinate()?, words.coordinate()?, words.coordinate()?]);
        if alone_in_line {
            words.skip_line();
        }
    }
    let faces = text::check_count("faces", announced[1], words.remaining(), 8).map_err(|p| at(&words, p))?;
    let mut triangles = Vec::with_capacity(faces);
    let mut corners = Vec::new();
    for face in 0..faces {
        let size: u64 = words.number("the number of corners of a face")?;
        let size = text::check_count("corners", size, words.remaining(), 2).map_err(|p| at(&words, p))?;
        if size < 3 {
            return Err(at(&words, MeshProblem::FewCorners { corners: size }));
        }
        corners.clear();
        for _ in 0..size {
            let index: i64 = words.number("a vertex index")?;
            match u32::try_from(index) {
                Ok(v) if (v as usize) < count => corners.push(v),
                _ => {
                    return Err(at(&words, MeshProblem::Index { face, index, vertices: count }));
                }
            }
        }
        polygon::cut(&corners, &vertices, &mut triangles);
        words.skip_line();
    }
    if words.next("").is_ok() {
        return Err(at(&words, MeshProblem::Excess { what: "faces", announced: announced[1] }));
    }
    Ok((vertices, triangles))
}

/// What is wrong with a line of vertices that has not as many words as the first.
fn unlike(first: usize) -> MeshProblem {
    let text = format!(
        "expected a vertex with {first} numbers, like the first; put each vertex in a line of its own, its colour or normal behind it"
    );
    MeshProblem::Syntax(text)
}
