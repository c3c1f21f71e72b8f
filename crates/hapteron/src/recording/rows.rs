//! The rows of a `run.csv`, one after another, in the memory of one.

use super::{COLUMNS, RecordingError, Row};
use std::io::Read;

/// Reads rows.
pub struct Rows<R> {
    reader: csv::Reader<R>,
    record: csv::StringRecord,
    /// Where each of [`COLUMNS`] is.
    places: [usize; COLUMNS.len()],
    name: String,
    only_finite: bool,
}

impl<R: Read> Rows<R> {
    /// Reads the first line.
    ///
    /// # Errors
    /// A file that is no `run.csv`.
    pub fn new(input: R, name: &str) -> Result<Self, RecordingError> {
        let fail = |line, problem| RecordingError { file: name.to_owned(), line, problem };
        let mut reader = csv::Reader::from_reader(input);
        let header = reader.headers().map_err(|e| fail(None, e.to_string()))?;
        let mut places = [0; COLUMNS.len()];
        for (place, column) in places.iter_mut().zip(COLUMNS) {
            *place = header.iter().position(|h| h == column).ok_or_else(|| {
                fail(Some(1), format!("column '{column}' is missing; this is not a run.csv of hapteron"))
            })?;
        }
        Ok(Self {
            reader,
            record: csv::StringRecord::new(),
            places,
            name: name.to_owned(),
            only_finite: true,
        })
    }

    /// Lets numbers through that are not finite: a run may have come to some, and is to be read back as it was written.
    pub(crate) fn lenient(mut self) -> Self {
        self.only_finite = false;
        self
    }

    fn row(&self) -> Result<Row, RecordingError> {
        let mut numbers = [0.0; COLUMNS.len()];
        for ((number, &place), column) in numbers.iter_mut().zip(&self.places).zip(COLUMNS) {
            let word = self.record.get(place).unwrap_or_default();
            let parsed = word.parse().ok().filter(|x: &f64| x.is_finite() || !self.only_finite);
            *number = parsed.ok_or_else(|| {
                let shown: String = word.chars().take(40).collect();
                RecordingError {
                    file: self.name.clone(),
                    line: self.record.position().map(csv::Position::line),
                    problem: format!("'{shown}' in column '{column}' is not a finite number"),
                }
            })?;
        }
        Ok(Row::from_numbers(&numbers))
    }
}

impl<R: Read> Iterator for Rows<R> {
    type Item = Result<Row, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.reader.read_record(&mut self.record) {
            Ok(true) => Some(self.row()),
            Ok(false) => None,
            Err(e) => Some(Err(RecordingError {
                file: self.name.clone(),
                line: e.position().map(csv::Position::line),
                problem: e.to_string(),
            })),
        }
    }
}

/// Without a last line that has no end: what a crash, or a disk that was full, has left of a row.
pub(crate) fn whole_lines(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().rposition(|b| *b == b'\n').map_or(bytes.len(), |i| i + 1);
    bytes.get(..end).unwrap_or(bytes)
}
