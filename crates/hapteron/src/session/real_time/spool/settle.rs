//! The last look at a recording: the depths that no pass found.

use super::writer::Mark;
use super::{Output, Spooled};
use crate::recording::{Row, Rows, write_header};
use crate::session::ContactPass;
use crate::session::real_time::recorder::depth;
use std::fs::File;
use std::io::{BufReader, Error};
use std::path::{Path, PathBuf};

/// Rows after which the progress is told.
const TOLD: u64 = 1000;
/// Bytes that are written at once.
const BLOCK: usize = 1 << 16;

/// What is wrong with a recording's files.
#[derive(Debug, thiserror::Error)]
#[error("{what} {}: {error}", .path.display())]
pub struct SpoolError {
    what: &'static str,
    path: PathBuf,
    error: String,
}

impl SpoolError {
    pub(super) fn new(what: &'static str, path: &Path, error: &Error) -> Self {
        Self { what, path: path.to_owned(), error: error.to_string() }
    }
}

impl Spooled {
    /// Measures the depth of the ticks that no pass looked at, writes `run.csv` anew, and gives every row to `each`, in their order, with its tick's lateness and
    /// compute time in nanoseconds. `progress` is told the share that is done; when it answers `false` the rest stays at the last known depth.
    ///
    /// # Errors
    /// [`SpoolError`]; rows that can be read have been given, and where `run.csv` could not be written anew it stays as it was.
    pub fn settle(
        &self,
        progress: &mut dyn FnMut(f64) -> bool,
        each: &mut dyn FnMut(&Row, [u64; 2]),
    ) -> Result<(), SpoolError> {
        let marks_path = self.folder.join(Mark::FILE);
        let done = if self.rows() == 0 { Ok(()) } else { self.read_through(&marks_path, progress, each) };
        // Of no use to anyone else.
        let _ = std::fs::remove_file(&marks_path);
        done
    }

    fn read_through(
        &self,
        marks_path: &Path,
        progress: &mut dyn FnMut(f64) -> bool,
        each: &mut dyn FnMut(&Row, [u64; 2]),
    ) -> Result<(), SpoolError> {
        let path = self.folder.join("run.csv");
        let cannot_read = |path: &Path, error: &Error| SpoolError::new("cannot read", path, error);
        let open = |path: &Path| File::open(path).map_err(|e| cannot_read(path, &e)).map(BufReader::new);
        let (input, mut marks) = (open(&path)?, open(marks_path)?);
        let rows = Rows::new(input, "run.csv").map_err(|e| cannot_read(&path, &Error::other(e)))?;
        let mut anew = Anew::create(self.folder.join("run.csv.part"));
        let mut measure = ContactPass::new(&self.scene);
        let mut last = -self.scene.contact.tolerance;
        let (mut i, mut go_on) = (0u64, true);
        // What lies after the rows that are known to be whole is a row cut off by a full disk.
        for row in rows.lenient().take(usize::try_from(self.rows()).unwrap_or(usize::MAX)) {
            let mut row = row.map_err(|e| cannot_read(&path, &Error::other(e)))?;
            let mark = Mark::read(&mut marks).map_err(|e| cannot_read(marks_path, &e))?;
            if !mark.is_known {
                row.penetration =
                    if go_on { depth(&self.scene, measure.measure_at(&self.scene, &row.body)) } else { last };
            }
            last = row.penetration;
            anew.push(&row);
            each(&row, mark.timing);
            i += 1;
            if i.is_multiple_of(TOLD) {
                go_on = go_on && progress(i as f64 / self.rows() as f64);
            }
        }
        anew.replace(&path)
    }
}

/// `run.csv` as it will be, beside the old one until it is whole.
struct Anew(Result<Output, SpoolError>);

impl Anew {
    fn create(path: PathBuf) -> Self {
        Self(Output::create(path).map(|mut output| {
            // Into memory: that does not fail.
            let _ = write_header(&mut output.buffer);
            output
        }))
    }

    fn push(&mut self, row: &Row) {
        if let Ok(output) = &mut self.0 {
            let _ = row.write_csv(&mut output.buffer);
            if output.buffer.len() > BLOCK {
                self.flush();
            }
        }
    }

    fn flush(&mut self) {
        if let Ok(output) = &mut self.0
            && let Err(error) = output.flush()
        {
            let _ = std::fs::remove_file(&output.path);
            self.0 = Err(SpoolError::new("cannot write", &output.path, &error));
        }
    }

    fn replace(mut self, path: &Path) -> Result<(), SpoolError> {
        self.flush();
        let Output { path: part, .. } = self.0?;
        std::fs::rename(&part, path).map_err(|e| SpoolError::new("cannot write", path, &e))
    }
}
