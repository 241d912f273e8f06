//! DESIGN section 2 as a test: crates depend only on those that they may know, and the numerical ones stay pure.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::path::{Path, PathBuf};
use std::process::Command;

use plica_tests::arrows::{ALLOWED, PURE, code_of, forbidden_arrows, impure_names};
use plica_tests::{files, read, repository};
use serde_json::{Value, json};

fn metadata() -> Value {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let arguments = ["metadata", "--no-deps", "--format-version", "1", "--offline", "--locked"];
    let output = Command::new(cargo).args(arguments).current_dir(repository()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Folder of a crate, if the workspace has it already.
fn folder_of(metadata: &Value, name: &str) -> Option<PathBuf> {
    let package = metadata["packages"].as_array()?.iter().find(|p| p["name"] == name)?;
    Path::new(package["manifest_path"].as_str()?).parent().map(Path::to_owned)
}

#[test]
fn crates_depend_only_on_those_they_may_know() {
    let metadata = metadata();
    assert!(metadata["packages"].as_array().unwrap().len() >= 6);
    assert_eq!(forbidden_arrows(&metadata), Vec::<String>::new());
}

#[test]
fn a_forbidden_arrow_is_refused() {
    let package = |name: &str, dependency: &str| json!({"packages": [{"name": name, "dependencies": [{"name": dependency, "path": null}]}]});
    assert_eq!(
        forbidden_arrows(&package("plica-sim", "plica-protocol")),
        ["plica-sim -> plica-protocol is not allowed"]
    );
    assert_eq!(forbidden_arrows(&package("plica-geometry", "zenoh")), ["plica-geometry -> zenoh is not allowed"]);
    assert_eq!(forbidden_arrows(&package("plica-client", "plica-sim")).len(), 1);
    assert_eq!(forbidden_arrows(&package("plica-protocol", "plica-client")).len(), 1);
    assert_eq!(forbidden_arrows(&package("plicad", "plica-sim")).len(), 0);
    assert!(forbidden_arrows(&package("plica-new", "serde"))[0].contains("not in the list"));
    let by_path = json!({"packages": [{"name": "plica-sim", "dependencies": [{"name": "other", "path": "/x/other"}]}]});
    assert_eq!(forbidden_arrows(&by_path).len(), 1);
}

#[test]
fn numerical_crates_name_no_bus_thread_network_or_clock() {
    let metadata = metadata();
    let folders: Vec<PathBuf> = PURE.iter().filter_map(|name| folder_of(&metadata, name)).collect();
    assert!(folders.len() >= 2, "geometry and sim are there");
    for path in folders.iter().flat_map(|f| files(&f.join("src"), &[".rs"])) {
        assert_eq!(impure_names(&read(&path)), Vec::<String>::new(), "{}", path.display());
    }
}

#[test]
fn an_impure_name_is_found() {
    assert_eq!(impure_names("use std::time::Instant;"), ["Instant"]);
    assert_eq!(impure_names("use std::{\n    fs,\n    thread::spawn,\n};"), ["std::thread"]);
    assert_eq!(impure_names("let s = std::net::TcpStream::connect(a);"), ["std::net"]);
    assert_eq!(impure_names("zenoh::open(c)"), ["zenoh"]);
    assert_eq!(impure_names("// zenoh, std::thread\nlet threads = network;\n"), [""; 0]);
    assert_eq!(impure_names("fn f() {}\n#[cfg(test)]\nmod tests { use std::time::Instant; }"), [""; 0]);
}

/// Sources of the daemon, its tests left out, that hold a text and do not lie in a place (a folder or a file).
fn outside(place: &str, text: &str) -> Vec<PathBuf> {
    let sources = repository().join("server/daemon/src");
    let found = files(&sources, &[".rs"]).into_iter().filter(|path| !path.starts_with(sources.join(place)));
    let found = found.filter(|path| !path.ends_with("tests.rs"));
    found.filter(|path| code_of(&read(path)).contains(text)).collect()
}

#[test]
fn only_the_bus_folder_touches_zenoh() {
    assert_eq!(outside("bus", "zenoh::"), Vec::<PathBuf>::new());
}

#[test]
fn only_one_file_makes_simulation_types_of_wire_types() {
    for made in ["PoseSample {", " Wrench {"] {
        assert_eq!(outside("wire.rs", made), Vec::<PathBuf>::new(), "{made}");
    }
}

#[test]
fn the_simulation_thread_knows_no_bus_lock_or_log() {
    for path in files(&repository().join("server/daemon/src/realtime"), &[".rs"]) {
        let code = code_of(&read(&path));
        for banned in ["zenoh", "plica_protocol", "plica_client", "Mutex", "RwLock", "tracing::", "print!", "println!"]
        {
            assert!(!code.contains(banned), "{} names {banned}", path.display());
        }
    }
}

#[test]
fn every_allowed_arrow_points_at_a_known_crate() {
    for (name, allowed) in ALLOWED {
        for target in allowed {
            assert!(ALLOWED.iter().any(|(known, _)| known == target), "{name} -> {target}");
        }
    }
}
