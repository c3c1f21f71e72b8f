//! STL, text and binary. Told apart by the length that the binary header implies, since binary files may begin with "solid".
//! Corners that coincide exactly become one vertex.

use super::Raw;
use super::error::{MeshError, MeshProblem};
use super::text::{self, Words};
use std::collections::HashMap;

const HEADER: usize = 84;
const FACET: usize = 50;

/// Whether the triangle count in a binary header fits the length of the file.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|count| HEADER as u64 + FACET as u64 * count == bytes.len() as u64)
}

fn announced(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(80..HEADER)?;
    Some(u64::from(u32::from_le_bytes([count[0], count[1], count[2], count[3]])))
}

pub(super) fn parse(bytes: &[u8]) -> Result<Raw, MeshError> {
    let beginning = &bytes[..bytes.len().min(1024)];
    let facet = beginning.windows(5).any(|w| w.eq_ignore_ascii_case(b"facet"));
    let solid = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    if !is_binary(bytes) && (facet || bytes.len() < HEADER) && solid {
        text_facets(bytes)
    } else {
        binary_facets(bytes)
    }
}

/// Gives equal points equal indices.
#[derive(Default)]
struct Welder {
    vertices: Vec<[f64; 3]>,
    // Only looked up, never iterated: the order of the result is that of the file.
    known: HashMap<[u64; 3], u32>,
}

impl Welder {
    fn index(&mut self, point: [f64; 3]) -> u32 {
        // Adding zero turns -0 into 0.
        let key = point.map(|c| (c + 0.0).to_bits());
        let next = self.vertices.len() as u32;
        *self.known.entry(key).or_insert_with(|| {
            self.vertices.push(point);
            next
        })
    }
}

fn binary_facets(bytes: &[u8]) -> Result<Raw, MeshError> {
    let Some(announced) = announced(bytes) else {
        return Err(MeshProblem::Truncated("the binary header").into());
    };
    let body = &bytes[HEADER..];
    let count = text::check_count("triangles", announced, body.len(), FACET).map_err(MeshError::from)?;
    let mut welder = Welder::default();
    let mut triangles = Vec::with_capacity(count);
    for facet in body.chunks(FACET).take(count) {
        if facet.len() < FACET - 2 {
            return Err(MeshProblem::Truncated("a triangle").into());
        }
        let coordinate = |i: usize| {
            let at = 12 + 4 * i;
            f64::from(f32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]]))
        };
        triangles
            .push([0, 3, 6].map(|i| welder.index([coordinate(i), coordinate(i + 1), coordinate(i + 2)])));
    }
    if body.len() >= (count + 1) * FACET {
        return Err(MeshProblem::Excess { what: "triangles", announced }.into());
    }
    if (triangles.len() as u64) < announced {
        let room = triangles.len() as u64;
        return Err(MeshProblem::Lying { what: "triangles", announced, room }.into());
    }
    Ok((welder.vertices, triangles))
}

fn text_facets(bytes: &[u8]) -> Result<Raw, MeshError> {
    let mut words = Words::new(bytes, 1);
    let mut welder = Welder::default();
    let mut triangles = Vec::new();
    let mut corners = Vec::with_capacity(3);
    words.next("'solid'")?;
    words.skip_line();
    let mut open = true;
    loop {
        let (line, word) = match words.next("the solid: 'endsolid' is missing") {
            Ok(found) => found,
            // Several solids may follow one another; the file may end after any of them.
            Err(error) if open || triangles.is_empty() => return Err(error),
            Err(_) => break,
        };
        match word.to_ascii_lowercase().as_str() {
            "vertex" => {
                let point = [words.coordinate()?, words.coordinate()?, words.coordinate()?];
                corners.push(welder.index(point));
            }
            "endloop" => {
                if corners.len() < 3 {
                    return Err(MeshError::at(line, MeshProblem::FewCorners { corners: corners.len() }));
                }
                super::polygon::cut(&corners, &welder.vertices, &mut triangles);
                corners.clear();
            }
            // Not used, and often not even a number.
            "normal" => {
                for _ in 0..3 {
                    words.next("a normal")?;
                }
            }
            "solid" => {
                open = true;
                words.skip_line();
            }
            "endsolid" => {
                open = false;
                words.skip_line();
            }
            "facet" | "outer" | "loop" | "endfacet" => {}
            _ => {
                let text =
                    format!("unexpected word '{}' in a text STL", word.chars().take(40).collect::<String>());
                return Err(MeshError::at(line, MeshProblem::Syntax(text)));
            }
        }
    }
    Ok((welder.vertices, triangles))
}
