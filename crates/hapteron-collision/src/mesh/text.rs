//! Words and numbers of text formats, with their lines.

use super::error::{MeshError, MeshProblem};

/// The lines of a file with their numbers, from 1; bytes that are not UTF-8 become replacement characters.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, std::borrow::Cow<'_, str>)> {
    bytes.split(|&b| b == b'\n').enumerate().map(|(i, line)| (i + 1, String::from_utf8_lossy(line)))
}

/// A file whose lines end as they did on old Macintoshes, with a carriage return alone, with line feeds in their place.
pub(super) fn with_line_feeds(bytes: &[u8]) -> std::borrow::Cow<'_, [u8]> {
    if bytes.contains(&b'\n') || !bytes.contains(&b'\r') {
        return bytes.into();
    }
    bytes.iter().map(|&b| if b == b'\r' { b'\n' } else { b }).collect::<Vec<_>>().into()
}

/// All words of a file outside `#` comments, each with its line.
pub(super) struct Words<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(bytes: &'a [u8], line: usize) -> Self {
        Self { rest: bytes, line }
    }

    /// The next word, or an error that says what is missing.
    pub(super) fn next(&mut self, what: &'static str) -> Result<(usize, &'a str), MeshError> {
        loop {
            match self.rest.first() {
                None => return Err(MeshError::at(self.line, MeshProblem::Truncated(what))),
                Some(b'\n') => {
                    self.line += 1;
                    self.rest = &self.rest[1..];
                }
                Some(b'#') => {
                    let end = self.rest.iter().position(|&b| b == b'\n').unwrap_or(self.rest.len());
                    self.rest = &self.rest[end..];
                }
                Some(b) if b.is_ascii_whitespace() => self.rest = &self.rest[1..],
                Some(_) => break,
            }
        }
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        let word = std::str::from_utf8(word)
            .map_err(|_| MeshError::at(self.line, MeshProblem::Syntax("the file is not text here".into())))?;
        Ok((self.line, word))
    }

    pub(super) fn number<T: std::str::FromStr>(&mut self, what: &'static str) -> Result<T, MeshError> {
        let (line, word) = self.next(what)?;
        number(word, what).map_err(|p| MeshError::at(line, p))
    }

    /// A coordinate: a number that is finite and of a size that lengths have.
    pub(super) fn coordinate(&mut self) -> Result<f64, MeshError> {
        let (line, word) = self.next("a coordinate")?;
        coordinate(word).map_err(|p| MeshError::at(line, p))
    }

    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// The rest of the line that the last word is on.
    pub(super) fn skip_line(&mut self) {
        self.rest = &self.rest[first_line(self.rest).len()..];
    }

    /// Words left in the line that the last word is on.
    pub(super) fn left_in_line(&self) -> usize {
        words_in(first_line(self.rest))
    }

    /// Words in the next line that has any.
    pub(super) fn in_next_line(&self) -> usize {
        let after = &self.rest[first_line(self.rest).len()..];
        after.split(|&b| b == b'\n').map(words_in).find(|&count| count > 0).unwrap_or(0)
    }

    /// Bytes not yet read.
    pub(super) fn remaining(&self) -> usize {
        self.rest.len()
    }
}

fn first_line(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().position(|&b| b == b'\n').unwrap_or(bytes.len());
    &bytes[..end]
}

/// Words of a line before its comment.
fn words_in(line: &[u8]) -> usize {
    let end = line.iter().position(|&b| b == b'#').unwrap_or(line.len());
    line[..end].split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).count()
}

/// A number in a word.
pub(super) fn number<T: std::str::FromStr>(word: &str, what: &'static str) -> Result<T, MeshProblem> {
    word.parse().map_err(|_| MeshProblem::NotANumber { what, found: word.chars().take(40).collect() })
}

/// A coordinate in a word; here, and not only when the mesh is made, so that the error can name the line.
pub(super) fn coordinate(word: &str) -> Result<f64, MeshProblem> {
    let value = number(word, "a coordinate")?;
    if is_coordinate(value) { Ok(value) } else { Err(MeshProblem::NotACoordinate { value }) }
}

/// Whether a number can be a coordinate.
pub(super) fn is_coordinate(value: f64) -> bool {
    value.abs() <= super::LARGEST_COORDINATE
}

/// Refuses a count for which the rest of a file has no room, before anything is allocated for it.
pub(super) fn check_count(
    what: &'static str,
    announced: u64,
    remaining: usize,
    least_bytes: usize,
) -> Result<usize, MeshProblem> {
    let room = (remaining / least_bytes.max(1)) as u64 + 1;
    match usize::try_from(announced) {
        Ok(count) if announced <= room => Ok(count),
        _ => Err(MeshProblem::Lying { what, announced, room }),
    }
}
