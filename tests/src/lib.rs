//! What the system tests share: where the repository is, and its files.

use std::fs;
use std::path::{Path, PathBuf};

pub mod arrows;
pub mod citations;
pub mod sources;
pub mod words;

/// Root of the repository whose tests run.
///
/// Cargo's variable is read when the test runs: a test built in another clone that shares the build folder would
/// otherwise look at that clone.
pub fn repository() -> PathBuf {
    let here = std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests");
    Path::new(&here).join("..").canonicalize().expect("the crate lies in the repository")
}

/// A program of this project, built in the same profile as the tests.
///
/// # Panics
/// If it has not been built: `tests/run` does so first.
pub fn program(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a running test has a file");
    let folder = test.parent().and_then(Path::parent).expect("tests lie in deps/ beside the programs");
    let path = folder.join(name).with_extension(std::env::consts::EXE_EXTENSION);
    assert!(path.exists(), "{} is missing: run `cargo build --release --workspace --bins` first", path.display());
    path
}

/// Files below `folder` whose name ends in one of `extensions`, sorted; build output and hidden folders are left out.
pub fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    collect(folder, extensions, &mut found);
    found.sort();
    found
}

/// Text of a file.
pub fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn collect(folder: &Path, extensions: &[&str], found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    for entry in entries.flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        if path.is_dir() {
            if !name.starts_with('.') && !["target", "out", "__pycache__"].contains(&&*name) {
                collect(&path, extensions, found);
            }
        } else if extensions.iter().any(|e| name.ends_with(e)) {
            found.push(path);
        }
    }
}
