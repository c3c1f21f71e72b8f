//! PLY, text and binary of both byte orders. Elements other than vertices and faces are skipped by their declared sizes.
//!
//! Own rather than a crate's: those that exist allocate what a header announces before looking at the file.

use super::error::{MeshError, MeshProblem};
use super::text::{self, Words};
use super::{Raw, polygon};

#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Text,
    Little,
    Big,
}

#[derive(Clone, Copy)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

struct Property {
    name: String,
    /// Type of the length, for a list.
    length: Option<Scalar>,
    value: Scalar,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes that one entry takes.
    fn least_size(&self, encoding: Encoding) -> usize {
        let sizes = self.properties.iter().map(|p| match encoding {
            Encoding::Text => 2,
            _ => p.length.unwrap_or(p.value).size(),
        });
        sizes.sum()
    }
}

pub(super) fn parse(bytes: &[u8]) -> Result<Raw, MeshError> {
    let Header { encoding, elements, lines, body } = header(bytes)?;
    let mut source = match encoding {
        Encoding::Text => Source::Text(Words::new(body, lines)),
        _ => Source::Binary { rest: body, little: encoding == Encoding::Little },
    };
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for element in &elements {
        let size = element.least_size(encoding);
        if size == 0 {
            continue;
        }
        let what = match element.name.as_str() {
            "vertex" => "vertices",
            "face" => "faces",
            _ => "entries",
        };
        let count =
            text::check_count(what, element.count, source.remaining(), size).map_err(|p| source.error(p))?;
        match what {
            "vertices" => read_vertices(&mut source, element, count, &mut vertices)?,
            "faces" => read_faces(&mut source, element, count, &vertices, &mut triangles)?,
            _ => {
                for _ in 0..count {
                    for property in &element.properties {
                        source.property(property, |_| ())?;
                    }
                }
            }
        }
    }
    if let Some(last) = elements.last().filter(|_| source.has_more()) {
        return Err(source.error(MeshProblem::Excess { what: "entries", announced: last.count }));
    }
    Ok((vertices, triangles))
}

/// What stands before the numbers.
struct Header<'a> {
    encoding: Encoding,
    elements: Vec<Element>,
    /// Number of the first line after the header.
    lines: usize,
    /// What follows.
    body: &'a [u8],
}

fn header(bytes: &[u8]) -> Result<Header<'_>, MeshError> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut offset = 0;
    for (number, line) in text::lines(bytes) {
        let fail = |text: String| Err(MeshError::at(number, MeshProblem::Syntax(text)));
        offset += bytes[offset..].iter().position(|&b| b == b'\n').map_or(bytes.len() - offset, |i| i + 1);
        let words: Vec<&str> = line.split_ascii_whitespace().take(8).collect();
        match words.as_slice() {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return fail("a PLY file begins with the line 'ply'".into()),
            ["format", "ascii", ..] => encoding = Some(Encoding::Text),
            ["format", "binary_little_endian", ..] => encoding = Some(Encoding::Little),
            ["format", "binary_big_endian", ..] => encoding = Some(Encoding::Big),
            ["comment" | "obj_info", ..] | [] => {}
            ["element", name, count] => {
                let count =
                    text::number(count, "the number of entries").map_err(|p| MeshError::at(number, p))?;
                elements.push(Element { name: (*name).into(), count, properties: Vec::new() });
            }
            ["property", kind @ .., name] => {
                let Some(property) = property(kind, name) else {
                    return fail(format!("property type '{}' is not one of PLY", kind.join(" ")));
                };
                match elements.last_mut() {
                    Some(element) => element.properties.push(property),
                    None => return fail("a property before the first element".into()),
                }
            }
            ["end_header"] => {
                return match encoding {
                    Some(encoding) => {
                        Ok(Header { encoding, elements, lines: number + 1, body: &bytes[offset..] })
                    }
                    None => fail("the header has no 'format' line".into()),
                };
            }
            _ => {
                return fail(format!(
                    "unexpected line '{}' in the header",
                    line.trim().chars().take(60).collect::<String>()
                ));
            }
        }
    }
    Err(MeshProblem::Truncated("the header").into())
}

fn property(kind: &[&str], name: &str) -> Option<Property> {
    let (length, value) = match kind {
        ["list", length, value] => (Some(Scalar::named(length)?), Scalar::named(value)?),
        [value] => (None, Scalar::named(value)?),
        _ => return None,
    };
    Some(Property { name: name.into(), length, value })
}

fn read_vertices(
    source: &mut Source<'_>,
    element: &Element,
    count: usize,
    vertices: &mut Vec<[f64; 3]>,
) -> Result<(), MeshError> {
    let axis = |p: &Property| ["x", "y", "z"].iter().position(|&n| n == p.name && p.length.is_none());
    let axes: Vec<Option<usize>> = element.properties.iter().map(axis).collect();
    if (0..3).any(|k| !axes.contains(&Some(k))) {
        return Err(source.error(MeshProblem::Syntax("the vertices lack x, y or z".into())));
    }
    vertices.reserve(count);
    for _ in 0..count {
        let mut vertex = [0.0; 3];
        for (property, axis) in element.properties.iter().zip(&axes) {
            source.property(property, |value| {
                if let Some(axis) = *axis {
                    vertex[axis] = value;
                }
            })?;
        }
        vertices.push(vertex);
    }
    Ok(())
}

fn read_faces(
    source: &mut Source<'_>,
    element: &Element,
    count: usize,
    vertices: &[[f64; 3]],
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), MeshError> {
    let is_corners =
        |p: &Property| p.length.is_some() && (p.name == "vertex_indices" || p.name == "vertex_index");
    if !element.properties.iter().any(is_corners) {
        return Err(source.error(MeshProblem::Syntax("the faces have no list 'vertex_indices'".into())));
    }
    let mut corners: Vec<f64> = Vec::new();
    for face in 0..count {
        corners.clear();
        for property in &element.properties {
            let wanted = is_corners(property);
            source.property(property, |value| {
                if wanted {
                    corners.push(value);
                }
            })?;
        }
        if corners.len() < 3 {
            return Err(source.error(MeshProblem::FewCorners { corners: corners.len() }));
        }
        let mut indices = Vec::with_capacity(corners.len());
        for &corner in &corners {
            if !(corner >= 0.0 && corner < vertices.len() as f64 && corner.fract() == 0.0) {
                let index = corner as i64;
                return Err(source.error(MeshProblem::Index { face, index, vertices: vertices.len() }));
            }
            indices.push(corner as u32);
        }
        polygon::cut(&indices, vertices, triangles);
    }
    Ok(())
}

/// The values after the header.
enum Source<'a> {
    Text(Words<'a>),
    Binary { rest: &'a [u8], little: bool },
}

impl Source<'_> {
    fn remaining(&self) -> usize {
        match self {
            Self::Text(words) => words.remaining(),
            Self::Binary { rest, .. } => rest.len(),
        }
    }

    /// Whether anything but white space is left.
    fn has_more(&mut self) -> bool {
        match self {
            Self::Text(words) => words.next("").is_ok(),
            Self::Binary { rest, .. } => !rest.iter().all(|b| b.is_ascii_whitespace() || *b == 0),
        }
    }

    fn error(&self, problem: MeshProblem) -> MeshError {
        match self {
            Self::Text(words) => MeshError::at(words.line(), problem),
            Self::Binary { .. } => problem.into(),
        }
    }

    /// Reads a property and hands on its value or, for a list, each of its values.
    fn property(&mut self, property: &Property, mut each: impl FnMut(f64)) -> Result<(), MeshError> {
        let Some(length) = property.length else {
            each(self.scalar(property.value)?);
            return Ok(());
        };
        let announced = self.scalar(length)?;
        if !(announced >= 0.0 && announced.fract() == 0.0) {
            return Err(self.error(MeshProblem::Syntax(format!("a list of length {announced}"))));
        }
        let least = if matches!(self, Self::Text(_)) { 2 } else { property.value.size() };
        let count = text::check_count("list entries", announced as u64, self.remaining(), least)
            .map_err(|p| self.error(p))?;
        for _ in 0..count {
            each(self.scalar(property.value)?);
        }
        Ok(())
    }

    fn scalar(&mut self, kind: Scalar) -> Result<f64, MeshError> {
        let (rest, little) = match self {
            Self::Text(words) => return words.number("a property"),
            Self::Binary { rest, little } => (rest, *little),
        };
        if rest.len() < kind.size() {
            return Err(MeshProblem::Truncated("a property").into());
        }
        let (own, after) = rest.split_at(kind.size());
        *rest = after;
        let mut bytes = [0; 8];
        for (i, &b) in own.iter().enumerate() {
            bytes[if little { i } else { kind.size() - 1 - i }] = b;
        }
        let [a, b, c, d, ..] = bytes;
        Ok(match kind {
            Scalar::I8 => f64::from(a as i8),
            Scalar::U8 => f64::from(a),
            Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(bytes),
        })
    }
}
