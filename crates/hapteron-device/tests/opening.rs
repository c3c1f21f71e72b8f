//! What a user is told when a device cannot be opened.

#![allow(clippy::unwrap_used, reason = "tests")]

use hapteron_device::drivers::{self, DriverOptions, OpenError};

fn error(kind: &str, options: &DriverOptions) -> String {
    drivers::open(kind, options).map(drop).unwrap_err().to_string()
}

/// Guards the words for a misspelt kind or option.
#[test]
fn misspelt_words_get_a_suggestion() {
    let none = DriverOptions::new();
    let text = error("force_dimension", &none);
    assert!(text.contains("did you mean 'force-dimension'?"), "{text}");
    let text = error("zzz", &none);
    assert!(text.contains("known kinds: force-dimension") && !text.contains("did you mean"), "{text}");
    let text = error("force-dimension", &none.clone().with("seriel", 3));
    assert!(text.contains("'seriel'; did you mean 'serial'?"), "{text}");
    let text = error("force-dimension", &none.clone().with("serial", "abc").with("library", "x"));
    assert!(text.contains("x"), "{text}");
}

/// Guards the words for a library that is missing: which file was looked for where, and how to install it.
#[test]
fn missing_library_tells_where_and_how() {
    let named = error("force-dimension", &DriverOptions::new().with("library", "/nowhere/libdrd.so"));
    assert!(named.contains("/nowhere/libdrd.so") && named.contains("forcedimension.com"), "{named}");
    assert!(!named.contains("/usr/local/lib"), "a named library is looked for nowhere else: {named}");
    let found = drivers::open("force-dimension", &DriverOptions::new());
    match found {
        Err(OpenError::LibraryNotFound { ref looked, .. }) => {
            let text = found.as_ref().err().unwrap().to_string();
            assert!(text.contains("HAPTERON_DRD_LIBRARY") && text.contains("FDSDK"), "{text}");
            assert!(looked.iter().any(|l| l.place.contains("by the system's loader")), "{text}");
            assert!(cfg!(windows) || text.contains("/usr/local/lib/libdrd"), "{text}");
        }
        Err(other) => println!("skipped: this machine has the library ({other})"),
        Ok(_) => println!("skipped: this machine has the library and a device"),
    }
}

/// Guards against a file that is no such library: it is named, with the function that it lacks.
#[test]
#[cfg(target_os = "linux")]
fn another_library_is_told() {
    let text = error("force-dimension", &DriverOptions::new().with("library", "libc.so.6"));
    assert!(text.contains("libc.so.6 has no function dhdErrorGetLast"), "{text}");
}
