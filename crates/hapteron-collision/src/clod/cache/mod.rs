//! Hierarchies kept in files, so that a mesh is worked on once.
//!
//! A file's name is the hash of the surface's vertices and triangles and of the version of the building code. Its content
//! carries a checksum, and even then every index and number in it is checked before use: a file that is damaged, stale, or
//! made by somebody else is built anew, never trusted. Files are written beside their place and moved there in one step.

mod format;
mod validate;

use super::build::{BuildError, Progress};
use super::{Hierarchy, format_version};
use crate::surface::Surface;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

pub use format::Refused;

/// Where a hierarchy came from.
#[derive(Clone, Debug, PartialEq)]
pub enum Origin {
    /// From this file.
    Cached(PathBuf),
    /// Built, and written to this file.
    Built(PathBuf),
    /// Built since the file there was no good, and written in its place.
    Rebuilt(PathBuf, Refused),
    /// Built, but it could not be written (or there is no cache folder), for this reason.
    NotCached(String),
}

/// `hapteron` in the user's cache folder: `HAPTERON_CACHE`, or by the habits of the system; none where there is none.
#[must_use]
pub fn default_folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    if let Some(folder) = variable("HAPTERON_CACHE") {
        return Some(folder);
    }
    let base = if cfg!(windows) {
        variable("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        variable("HOME").map(|h| h.join("Library/Caches"))
    } else {
        variable("XDG_CACHE_HOME").or_else(|| variable("HOME").map(|h| h.join(".cache")))
    };
    base.map(|b| b.join("hapteron"))
}

/// The hierarchy of a surface, from the cache in `folder` or else built and put there.
///
/// # Errors
/// Only when `progress` stops the building: no fault of a file is one.
pub fn load_or_build(
    surface: &Surface,
    folder: Option<&Path>,
    progress: &mut Progress<'_>,
) -> Result<(Hierarchy, Origin), BuildError> {
    let Some(folder) = folder else {
        let built = Hierarchy::build(surface, progress)?;
        return Ok((built, Origin::NotCached("there is no cache folder".to_owned())));
    };
    let path = file_in(folder, surface);
    let refused = match std::fs::read(&path) {
        Ok(bytes) => match Hierarchy::from_bytes(&bytes, surface) {
            Ok(hierarchy) => return Ok((hierarchy, Origin::Cached(path))),
            Err(refused) => Some(refused),
        },
        Err(_) => None,
    };
    let built = Hierarchy::build(surface, progress)?;
    let origin = match write_whole(&path, &built.to_bytes(surface)) {
        Err(error) => Origin::NotCached(format!("cannot write {}: {error}", path.display())),
        Ok(()) => match refused {
            Some(refused) => Origin::Rebuilt(path, refused),
            None => Origin::Built(path),
        },
    };
    Ok((built, origin))
}

/// The file of a surface in a cache folder.
#[must_use]
pub fn file_in(folder: &Path, surface: &Surface) -> PathBuf {
    let key = key(surface);
    let name: String = key[..16].iter().map(|b| format!("{b:02x}")).collect();
    folder.join(format!("{name}.clod"))
}

/// Hash of what a hierarchy is made of.
fn key(surface: &Surface) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&format_version().to_le_bytes());
    let mut bytes = Vec::with_capacity(24 * surface.vertices.len().max(1));
    surface.vertices.iter().flatten().for_each(|c| bytes.extend(c.to_bits().to_le_bytes()));
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(&bytes);
    bytes.clear();
    surface.triangles.iter().flatten().for_each(|i| bytes.extend(i.to_le_bytes()));
    hasher.update(&bytes);
    *hasher.finalize().as_bytes()
}

/// What was left beside a file by a writer that was killed is taken away when it is older than this.
const LEFT_BEHIND: Duration = Duration::from_secs(3600);

/// Writes a file so that at no time a part of it stands in its place, whoever else writes it at the same time.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    static WRITES: AtomicU64 = AtomicU64::new(0);
    let folder = path.parent().unwrap_or_else(|| Path::new("."));
    std::fs::create_dir_all(folder)?;
    sweep(path, folder);
    // Of this process, and of this write among those of its threads. Two machines with one folder may have the same number.
    let number = WRITES.fetch_add(1, Ordering::Relaxed);
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |t| t.subsec_nanos());
    let mut beside = path.as_os_str().to_owned();
    beside.push(format!(".{}-{number}-{now}", std::process::id()));
    let beside = PathBuf::from(beside);
    let written = std::fs::File::create_new(&beside).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    let moved = written.and_then(|()| std::fs::rename(&beside, path));
    if moved.is_err() {
        let _ = std::fs::remove_file(&beside);
    }
    moved
}

/// Takes away what killed writers of a file have left beside it.
fn sweep(path: &Path, folder: &Path) {
    let Some(name) = path.file_name().map(|n| format!("{}.", n.to_string_lossy())) else { return };
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let age = entry.metadata().and_then(|m| m.modified()).ok().and_then(|t| t.elapsed().ok());
        if entry.file_name().to_string_lossy().starts_with(&name) && age.is_some_and(|a| a > LEFT_BEHIND) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests;
