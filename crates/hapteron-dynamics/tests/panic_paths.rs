//! No panic and no allocation in the machine code of a step: catches an index, a division or an `unwrap` that the compiler could
//! not prove, and a vector.
//!
//! Run it by hand and in continuous integration (it builds the crate once more and needs `objdump`, x86-64 Linux):
//! `cargo test -p hapteron-dynamics --test panic_paths -- --ignored`
//!
//! It disassembles the optimised crate and the elementary functions of libm, follows every call and jump from the functions of
//! the haptic thread, and wants none to arrive in `core::panicking` or its relatives, or at the allocator.
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What a haptic thread calls; parts of mangled names.
const ROOTS: [&str; 7] = [
    "10integrator4step",
    "8coupling8Coupling8feedback",
    "8coupling8Coupling7limited",
    "7contact12ContactForce6wrench",
    "7contact17LinearizedContact11from_planes",
    "14backward_euler15condensed_solve",
    "5state5State16angular_velocity",
];

/// Parts of the names of what must not be reached.
const FORBIDDEN: [&str; 7] =
    ["panic", "unwrap_failed", "expect_failed", "slice_index", "index_fail", "rust_alloc", "alloc_error"];

type Calls = BTreeMap<String, BTreeSet<String>>;

/// The symbol in a line of relocation, without its section and offset.
fn symbol(text: &str) -> String {
    let name = text.trim().trim_start_matches(".text.unlikely.").trim_start_matches(".text.");
    name.split(['+', '-']).next().unwrap_or(name).to_owned()
}

/// Adds who refers to whom in an object file or a library.
fn read_calls(file: &Path, calls: &mut Calls) {
    let output = Command::new("objdump").arg("-dr").arg("--no-show-raw-insn").arg(file).output().unwrap();
    assert!(output.status.success(), "objdump {}", file.display());
    let mut current = String::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        if let Some(name) = line.strip_suffix(">:").and_then(|l| l.split_once('<')) {
            current = name.1.to_owned();
            calls.entry(current.clone()).or_default();
        } else if let Some((_, target)) = line.split_once("R_X86_64_")
            && let Some((_, target)) = target.split_once(char::is_whitespace)
        {
            calls.entry(current.clone()).or_default().insert(symbol(target));
        }
    }
}

/// Builds the crate without link-time optimisation, which would leave no machine code in its object file.
fn build() -> (PathBuf, Vec<PathBuf>) {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("panic_paths");
    let status = Command::new(env!("CARGO"))
        .args(["rustc", "--release", "--lib", "--package", "hapteron-dynamics"])
        .args(["--", "--emit=obj", "-C", "codegen-units=1"])
        .env("CARGO_TARGET_DIR", &target)
        .env("CARGO_PROFILE_RELEASE_LTO", "off")
        .env_remove("RUSTFLAGS")
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status()
        .unwrap();
    assert!(status.success());
    let files: Vec<PathBuf> = std::fs::read_dir(target.join("release/deps"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "o" || e == "rlib"))
        .collect();
    let newest = |start: &str, end: &str| {
        let matching = |p: &&PathBuf| {
            let name = p.file_name().unwrap().to_string_lossy();
            name.starts_with(start) && name.ends_with(end)
        };
        files.iter().filter(matching).max_by_key(|p| p.metadata().unwrap().modified().unwrap()).cloned()
    };
    (newest("hapteron_dynamics-", ".o").unwrap(), vec![newest("liblibm-", ".rlib").unwrap()])
}

#[test]
#[ignore = "builds the crate once more and needs objdump"]
fn no_panic_is_reachable_from_the_functions_of_the_haptic_thread() {
    let (object, libraries) = build();
    let mut calls = Calls::new();
    read_calls(&object, &mut calls);
    for library in &libraries {
        read_calls(library, &mut calls);
    }
    // `panic_cannot_unwind` stands where an unwinding would end; what would begin one is looked for.
    let is_panic =
        |name: &str| FORBIDDEN.iter().any(|p| name.contains(p)) && !name.contains("panic_cannot_unwind");
    assert!(
        calls.values().flatten().any(|name| is_panic(name)),
        "constructors do refer to panics; if none is found, the disassembly was not understood"
    );
    for root in ROOTS {
        let start = calls.keys().find(|name| name.contains(root));
        let start = start.unwrap_or_else(|| panic!("no function {root} in {}", object.display()));
        let mut from: BTreeMap<&str, &str> = BTreeMap::new();
        let mut open = vec![start.as_str()];
        while let Some(name) = open.pop() {
            assert!(!is_panic(name), "{root} reaches {name}, called from {}", from[name]);
            for next in calls.get(name).into_iter().flatten() {
                if next != start && !from.contains_key(next.as_str()) {
                    from.insert(next, name);
                    open.push(next);
                }
            }
        }
        if root == ROOTS[0] {
            for part in ["quasi_static", "newton_step", "runge_kutta_4", "sin", "atan2"] {
                assert!(from.keys().any(|name| name.contains(part)), "{part} was not followed");
            }
        }
    }
}
