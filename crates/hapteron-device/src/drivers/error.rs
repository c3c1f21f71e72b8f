//! Why a device cannot be opened: what was looked for, where, and the cure.

use crate::DeviceFault;
use std::path::PathBuf;

/// A place where a library was looked for, and what was wrong there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Looked {
    /// File or name as given to the system's loader.
    pub place: String,
    /// As in `no such file`.
    pub outcome: String,
}

/// Why a device cannot be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// No driver of this name.
    #[error("there is no device kind '{kind}'{hint}; known kinds: {known}")]
    UnknownKind {
        /// As given.
        kind: String,
        /// `; did you mean 'haply'?` or nothing.
        hint: String,
        /// All kinds.
        known: String,
    },
    /// The driver has no such option.
    #[error("device kind '{kind}' has no option '{key}'{hint}; it has: {known}")]
    UnknownOption {
        /// The driver.
        kind: &'static str,
        /// As given.
        key: String,
        /// `; did you mean 'serial'?` or nothing.
        hint: String,
        /// All options of the driver.
        known: String,
    },
    /// An option's value is not what it must be.
    #[error("device option {key} = '{value}' of kind '{kind}': it must be {expected}")]
    BadOption {
        /// The driver.
        kind: &'static str,
        /// The option.
        key: &'static str,
        /// As given.
        value: String,
        /// What would be right.
        expected: String,
    },
    /// The vendor's library is nowhere.
    #[error("{what} was not found. Looked for:\n{}{cure}", looked_for(.looked))]
    LibraryNotFound {
        /// As in `Force Dimension's library`.
        what: &'static str,
        /// Everywhere it was looked for.
        looked: Vec<Looked>,
        /// How to install it.
        cure: &'static str,
    },
    /// The library lacks a function that cannot be done without.
    #[error("{} has no function {symbol}: it is too old, or another library. {cure}", .library.display())]
    MissingSymbol {
        /// The file that was loaded.
        library: PathBuf,
        /// The function.
        symbol: &'static str,
        /// How to get a right one.
        cure: &'static str,
    },
    /// Library or service are there, but no such device is attached.
    #[error("no device: {detail}. {cure}")]
    NoDevice {
        /// What library or service said.
        detail: String,
        /// What to do.
        cure: &'static str,
    },
    /// Nobody answers at the address.
    #[error("cannot reach {address}: {reason}. {cure}")]
    Unreachable {
        /// Address or path.
        address: String,
        /// What the system said.
        reason: String,
        /// What to do.
        cure: &'static str,
    },
    /// Somebody answers, but speaks another protocol.
    #[error("{address} does not speak {protocol}: {detail}")]
    Protocol {
        /// Address or path.
        address: String,
        /// What was expected.
        protocol: &'static str,
        /// What came instead.
        detail: String,
    },
    /// The device failed while it was opened.
    #[error("the device failed while it was opened: {0}")]
    Fault(#[from] DeviceFault),
    /// The driver does not exist on this system.
    #[error("device kind '{kind}' does not exist on this system: {reason}")]
    NotHere {
        /// The driver.
        kind: &'static str,
        /// Why, and what does.
        reason: &'static str,
    },
}

fn looked_for(looked: &[Looked]) -> String {
    looked.iter().map(|l| format!("  {} ({})\n", l.place, l.outcome)).collect()
}
