//! Vendor libraries, loaded at run time: where they are looked for, and their functions.
#![allow(unsafe_code, reason = "functions of a library that is loaded at run time")]

use super::OpenError;
use super::error::Looked;
use libloading::Library;
use std::path::{Path, PathBuf};

/// Where a library is looked for, in this order: the file that the option `library` or the environment variable names (and then
/// nowhere else), the folders, the system's own loader.
pub(super) struct Search {
    /// As in `Force Dimension's library`.
    pub what: &'static str,
    /// Environment variable with the file's path.
    pub variable: &'static str,
    /// File names; earlier ones are preferred everywhere.
    pub names: &'static [&'static str],
    /// Usual places.
    pub folders: Vec<PathBuf>,
    /// How to install it.
    pub cure: &'static str,
}

/// A library that stays loaded until the process ends: vendors' threads and clean-up code may outlive any owner.
pub(super) struct Loaded {
    library: &'static Library,
    pub path: PathBuf,
    pub cure: &'static str,
}

impl Search {
    /// Loads the first that can be loaded.
    pub fn load(&self, named: Option<&str>) -> Result<Loaded, OpenError> {
        let mut looked = Vec::new();
        let from_variable = std::env::var(self.variable).ok().filter(|v| !v.is_empty());
        if let Some(file) = named.map(str::to_owned).or(from_variable) {
            return self.attempt(Path::new(&file), &mut looked).ok_or_else(|| self.nowhere(looked));
        }
        looked.push(Looked {
            place: format!("environment variable {}", self.variable),
            outcome: "not set".into(),
        });
        for name in self.names {
            for folder in &self.folders {
                let files = versions(folder, name);
                if files.is_empty() {
                    let place = folder.join(name).display().to_string();
                    looked.push(Looked { place, outcome: "no such file".into() });
                }
                for file in files {
                    if let Some(loaded) = self.attempt(&file, &mut looked) {
                        return Ok(loaded);
                    }
                }
            }
        }
        for name in self.names {
            if let Some(loaded) = self.attempt(Path::new(name), &mut looked) {
                return Ok(loaded);
            }
        }
        Err(self.nowhere(looked))
    }

    fn nowhere(&self, looked: Vec<Looked>) -> OpenError {
        OpenError::LibraryNotFound { what: self.what, looked, cure: self.cure }
    }

    fn attempt(&self, file: &Path, looked: &mut Vec<Looked>) -> Option<Loaded> {
        // SAFETY: the vendor's library runs its initialisers; that is what the user asked for by installing or naming it.
        match unsafe { Library::new(file) } {
            Ok(library) => {
                let library = Box::leak(Box::new(library));
                Some(Loaded { library, path: file.to_path_buf(), cure: self.cure })
            }
            Err(error) => {
                let mut outcome = error.to_string();
                if let Some(source) = std::error::Error::source(&error) {
                    outcome = source.to_string();
                }
                let place = match file.components().count() {
                    1 => format!("{} by the system's loader", file.display()),
                    _ => file.display().to_string(),
                };
                looked.push(Looked { place, outcome });
                None
            }
        }
    }
}

/// The file itself, then versions of it as in `libdrd.so.3.16.0`, newest first.
fn versions(folder: &Path, name: &str) -> Vec<PathBuf> {
    let mut numbered: Vec<(Vec<u32>, PathBuf)> = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let file = entry.file_name();
        let Some(rest) = file.to_str().and_then(|f| f.strip_prefix(name)) else { continue };
        if !rest.is_empty() && !rest.starts_with('.') {
            continue;
        }
        let numbers: Option<Vec<u32>> =
            rest.split('.').filter(|p| !p.is_empty()).map(|p| p.parse().ok()).collect();
        if let Some(numbers) = numbers {
            numbered.push((numbers, entry.path()));
        }
    }
    numbered.sort_by(|a, b| (b.0.is_empty(), &b.0).cmp(&(a.0.is_empty(), &a.0)));
    numbered.into_iter().map(|(_, path)| path).collect()
}

impl Loaded {
    /// A function that may be missing.
    ///
    /// # Safety
    /// `F` must be the function's type as the vendor's header has it.
    pub unsafe fn optional<F: Copy>(&self, symbol: &'static str) -> Option<F> {
        // SAFETY: the caller vouches for the type; the library is never unloaded, so that the pointer stays good.
        unsafe { self.library.get::<F>(symbol.as_bytes()) }.ok().map(|f| *f)
    }

    /// A function that must be there.
    ///
    /// # Safety
    /// As [`Loaded::optional`].
    pub unsafe fn required<F: Copy>(&self, symbol: &'static str) -> Result<F, OpenError> {
        // SAFETY: passed on to the caller.
        unsafe { self.optional(symbol) }.ok_or_else(|| OpenError::MissingSymbol {
            library: self.path.clone(),
            symbol,
            cure: self.cure,
        })
    }
}

/// Makes a table of a vendor's functions under the vendor's own names, resolved once when a device is opened.
macro_rules! vendor_functions {
    (
        $(#[$meta:meta])* $table:ident
        required { $($r:ident($($ra:ty),*) $(-> $rr:ty)?;)* }
        optional { $($o:ident($($oa:ty),*) $(-> $or:ty)?;)* }
    ) => {
        $(#[$meta])*
        #[allow(non_snake_case, reason = "the vendor's names")]
        #[derive(Clone, Copy)]
        pub(super) struct $table {
            $(pub $r: unsafe extern "system" fn($($ra),*) $(-> $rr)?,)*
            $(pub $o: Option<unsafe extern "system" fn($($oa),*) $(-> $or)?>,)*
        }

        impl $table {
            /// Resolves all functions.
            pub fn resolve(library: &$crate::drivers::library::Loaded) -> Result<Self, $crate::drivers::OpenError> {
                // SAFETY: the types are those of the vendor's headers.
                unsafe {
                    Ok(Self {
                        $($r: library.required(stringify!($r))?,)*
                        $($o: library.optional(stringify!($o)),)*
                    })
                }
            }

            /// Functions that this version of the library does not have.
            pub fn missing(&self) -> Vec<&'static str> {
                let mut missing = Vec::new();
                $(if self.$o.is_none() { missing.push(stringify!($o)); })*
                missing
            }
        }
    };
}
pub(super) use vendor_functions;

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards the order of versions: a plain name first, then the newest; others' files are not taken.
    #[test]
    fn newest_version_first() {
        let folder = std::env::temp_dir().join(format!("hapteron-versions-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for name in
            ["libdrd.so.3.9.1", "libdrd.so.3.16.0", "libdrd.so", "libdrdx.so", "libdrd.so.old", "libdrd.so.3"]
        {
            std::fs::write(folder.join(name), b"").unwrap();
        }
        let found: Vec<String> = versions(&folder, "libdrd.so")
            .iter()
            .map(|p| p.file_name().unwrap().to_string_lossy().into())
            .collect();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found, ["libdrd.so", "libdrd.so.3.16.0", "libdrd.so.3.9.1", "libdrd.so.3"]);
    }
}
