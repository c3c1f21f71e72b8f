//! The equation ledger against the sources: catches a function, type or test that was renamed or removed while `docs/equations.md`
//! still names it, an equation without a row, and a deviation that is used but not explained.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn ledger() -> String {
    std::fs::read_to_string(root().join("docs/equations.md")).unwrap()
}

/// Names and files of the links to Rust sources.
fn links(text: &str) -> Vec<(String, String)> {
    text.split("[`")
        .skip(1)
        .filter_map(|rest| {
            let (name, rest) = rest.split_once("`](")?;
            let (file, _) = rest.split_once(')')?;
            file.strip_suffix(".rs").map(|_| (name.to_owned(), file.to_owned()))
        })
        .collect()
}

/// Whether a source has a function, type, implementation or variant of that very name.
fn defines(source: &str, name: &str) -> bool {
    let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    ["fn ", "struct ", "enum ", "impl ", "> ", "    "].iter().any(|kind| {
        source.match_indices(&format!("{kind}{name}")).any(|(at, found)| {
            let rest = &source[at + found.len()..];
            ends(rest) && (*kind != "    " || rest.starts_with('('))
        })
    })
}

/// The deviations (D1, D2, ...) in a text.
fn deviations(text: &str) -> BTreeSet<u32> {
    text.split(|c: char| !c.is_ascii_alphanumeric())
        .filter_map(|word| word.strip_prefix('D')?.parse().ok())
        .collect()
}

#[test]
fn every_name_in_the_ledger_exists() {
    let links = links(&ledger());
    assert!(!defines("fn step_by() {}", "step"), "a longer name is another name");
    assert!(links.len() > 100, "the links were understood: {}", links.len());
    for (name, file) in links {
        if name.starts_with("crates/") {
            continue;
        }
        let source = std::fs::read_to_string(root().join("docs").join(&file));
        let source = source.unwrap_or_else(|e| panic!("{file}: {e}"));
        for part in name.split("::") {
            assert!(defines(&source, part), "{name} is not in {file}");
        }
    }
}

#[test]
fn every_equation_has_a_row() {
    let text = ledger();
    for equation in 1..=30 {
        let row = text.lines().find(|line| line.starts_with(&format!("| {equation} |")));
        let row = row.unwrap_or_else(|| panic!("no row for Eq. {equation}"));
        let tested = links(row).iter().any(|(_, file)| file.contains("/tests/"));
        assert!(tested, "Eq. {equation} has no test");
    }
    for section in ["5.3.1", "6.1", "7.2", "7.4", "8.1"] {
        assert!(text.lines().any(|line| line.starts_with(&format!("| {section} |"))), "section {section}");
    }
}

#[test]
fn every_deviation_is_explained() {
    let text = ledger();
    let explained: BTreeSet<u32> =
        text.lines().filter_map(|line| line.strip_prefix("| D")?.split_once(" |")?.0.parse().ok()).collect();
    let mut used = deviations(&text);
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                used.append(&mut deviations(&std::fs::read_to_string(&path).unwrap()));
            }
        }
    }
    assert_eq!(used, explained);
    assert_eq!(explained, (1..=*explained.last().unwrap()).collect());
}
