//! Who may depend on whom, and what the numerical crates may not name.

use serde_json::Value;

/// Crates of the workspace with those that each may depend on. A crate that is not listed is refused.
pub const ALLOWED: [(&str, &[&str]); 13] = [
    ("plica-protocol", &[]),
    ("plica-trajectory", &[]),
    ("plica-geometry", &[]),
    ("plica-sim", &["plica-geometry"]),
    ("plica-accurate", &["plica-geometry"]),
    ("plica-training", &["plica-sim", "plica-accurate", "plica-geometry"]),
    ("plica-gpu", &["plica-sim"]),
    (
        "plica-scene",
        &["plica-training", "plica-sim", "plica-accurate", "plica-geometry", "plica-protocol", "plica-trajectory"],
    ),
    (
        "plica-jobs",
        &[
            "plica-scene",
            "plica-training",
            "plica-sim",
            "plica-accurate",
            "plica-geometry",
            "plica-protocol",
            "plica-trajectory",
        ],
    ),
    (
        "plica-daemon",
        &[
            "plica-jobs",
            "plica-scene",
            "plica-training",
            "plica-sim",
            "plica-accurate",
            "plica-geometry",
            "plica-gpu",
            "plica-protocol",
            "plica-trajectory",
        ],
    ),
    // The client library is for the demo, which drives its tool over the bus as anybody would.
    (
        "plicad",
        &[
            "plica-daemon",
            "plica-jobs",
            "plica-scene",
            "plica-training",
            "plica-sim",
            "plica-accurate",
            "plica-geometry",
            "plica-gpu",
            "plica-protocol",
            "plica-trajectory",
            "plica-client",
        ],
    ),
    ("plica-client", &["plica-protocol", "plica-trajectory"]),
    ("plica-tests", &["plica-protocol", "plica-client"]),
];

/// Arrows for tests alone: the bus is tested with the clients that use it.
const ALLOWED_IN_TESTS: [(&str, &str); 2] = [("plica-daemon", "plica-client"), ("plica-trajectory", "plica-protocol")];

/// Libraries that a crate beyond the pure ones never names: scenes are read without bus, command line and async runtime.
pub const UNNAMED: [(&str, &[&str]); 1] = [("plica-scene", &["clap", "tokio", "zenoh"])];

/// Crates that know no bus, no thread, no network and no clock.
pub const PURE: [&str; 3] = ["plica-geometry", "plica-sim", "plica-accurate"];

/// Libraries that pure crates never name.
const IMPURE_LIBRARIES: [&str; 3] = ["zenoh", "tokio", "wgpu"];
/// Modules of the standard library that pure crates never name.
const IMPURE_MODULES: [&str; 2] = ["thread", "net"];
/// Types that read a clock.
const CLOCKS: [&str; 2] = ["Instant", "SystemTime"];

/// Every dependency in the output of `cargo metadata --no-deps` that is not allowed, as a sentence.
pub fn forbidden_arrows(metadata: &Value) -> Vec<String> {
    let packages = metadata["packages"].as_array().map_or(&[][..], Vec::as_slice);
    packages.iter().flat_map(forbidden_of_package).collect()
}

fn forbidden_of_package(package: &Value) -> Vec<String> {
    let name = text(&package["name"]);
    let Some((_, allowed)) = ALLOWED.iter().find(|(crate_name, _)| *crate_name == name) else {
        return vec![format!("{name} is not in the list of crates: say in ALLOWED what it may depend on")];
    };
    let dependencies = package["dependencies"].as_array().map_or(&[][..], Vec::as_slice);
    let mut refused = Vec::new();
    for dependency in dependencies {
        let target = text(&dependency["name"]);
        let is_ours = dependency["path"].is_string() || ALLOWED.iter().any(|(c, _)| *c == target);
        let is_for_tests = dependency["kind"] == "dev" && ALLOWED_IN_TESTS.contains(&(name, target));
        let is_allowed = allowed.contains(&target) || is_for_tests;
        if is_banned(name, target) || is_ours && !is_allowed {
            refused.push(format!("{name} -> {target} is not allowed"));
        }
    }
    refused
}

fn is_banned(name: &str, library: &str) -> bool {
    let is_impure = PURE.contains(&name) && IMPURE_LIBRARIES.contains(&library);
    is_impure || UNNAMED.iter().any(|(own, libraries)| *own == name && libraries.contains(&library))
}

/// The names of `banned` that stand in a source. Comments and everything from `#[cfg(test)]` on do not count.
pub fn banned_names<'a>(source: &str, banned: &[&'a str]) -> Vec<&'a str> {
    let code = code_of(source);
    let words: Vec<&str> = code.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
    banned.iter().filter(|name| words.contains(name)).copied().collect()
}

/// What a source file of a pure crate names and may not. Comments and everything from `#[cfg(test)]` on do not count.
pub fn impure_names(source: &str) -> Vec<String> {
    let banned = [&IMPURE_LIBRARIES[..], &CLOCKS[..]].concat();
    let mut found: Vec<String> = banned_names(source, &banned).iter().map(ToString::to_string).collect();
    let code = code_of(source);
    for module in IMPURE_MODULES {
        if std_paths(&code).any(|path| path.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|w| w == module)) {
            found.push(format!("std::{module}"));
        }
    }
    found
}

/// Source without comments and without everything from `#[cfg(test)]` on, in one line.
pub fn code_of(source: &str) -> String {
    source.split("#[cfg(test)]").next().unwrap_or("").lines().map(without_comment).collect()
}

fn without_comment(line: &str) -> String {
    let code = line.split("//").next().unwrap_or("");
    format!("{} ", code.trim())
}

/// What follows each `std::`: the next name, or all that stands in the next braces.
fn std_paths(code: &str) -> impl Iterator<Item = &str> {
    code.split("std::").skip(1).map(|rest| match rest.trim_start().strip_prefix('{') {
        Some(group) => group.split(';').next().unwrap_or(group),
        None => rest.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or(rest),
    })
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or("")
}
