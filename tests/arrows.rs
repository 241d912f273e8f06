//! Crates, folders and files depend only on those that they may know, and the numerical crates stay pure.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use plica_tests::arrows::{ALLOWED, PURE, UNNAMED, banned_names, code_of, forbidden_arrows, impure_names};
use plica_tests::sources::{CrateTree, circles, folder_circles};
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
    assert!(metadata["packages"].as_array().unwrap().len() >= 12);
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
fn what_only_tests_may_know_stays_out_of_the_code() {
    let package = |kind: Value| {
        let dependency = json!({"name": "plica-client", "path": "/x/client", "kind": kind});
        json!({"packages": [{"name": "plica-daemon", "dependencies": [dependency]}]})
    };
    assert_eq!(forbidden_arrows(&package(json!("dev"))).len(), 0);
    assert_eq!(forbidden_arrows(&package(Value::Null)).len(), 1);
}

#[test]
fn scenes_are_read_without_bus_command_line_or_async_runtime() {
    let metadata = metadata();
    for (name, banned) in UNNAMED {
        let folder = folder_of(&metadata, name).unwrap_or_else(|| panic!("the workspace lacks {name}"));
        for path in files(&folder.join("src"), &[".rs"]) {
            assert_eq!(banned_names(&read(&path), banned), [""; 0], "{}", path.display());
        }
    }
    let with_clap = json!({"packages": [{"name": "plica-scene", "dependencies": [{"name": "clap", "path": null}]}]});
    assert_eq!(forbidden_arrows(&with_clap), ["plica-scene -> clap is not allowed"]);
    assert_eq!(banned_names("use clap::Parser; // tokio", &["clap", "tokio"]), ["clap"]);
}

#[test]
fn numerical_crates_name_no_bus_thread_network_or_clock() {
    let metadata = metadata();
    let folders: Vec<PathBuf> = PURE.iter().filter_map(|name| folder_of(&metadata, name)).collect();
    assert_eq!(folders.len(), PURE.len());
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

/// Crates above the numerical ones.
const SERVING: [&str; 4] = ["server/scene/src", "server/jobs/src", "server/daemon/src", "server/plicad/src"];

/// Sources of the serving crates, their tests left out, that hold a text and do not lie in a place (a folder or a file of the daemon).
fn outside(place: &str, text: &str) -> Vec<PathBuf> {
    let place = repository().join("server/daemon/src").join(place);
    assert!(place.exists(), "{} is missing", place.display());
    let sources = SERVING.iter().flat_map(|folder| files(&repository().join(folder), &[".rs"]));
    let found = sources.filter(|path| !path.starts_with(&place) && *path != place.with_extension("rs"));
    let found = found.filter(|path| !path.ends_with("tests.rs"));
    found.filter(|path| code_of(&read(path)).contains(text)).collect()
}

#[test]
fn only_the_bus_folder_touches_zenoh() {
    assert_eq!(outside("bus", "zenoh::"), Vec::<PathBuf>::new());
}

#[test]
fn only_one_file_makes_simulation_types_of_wire_types() {
    assert_eq!(outside("wire.rs", " Wrench {"), Vec::<PathBuf>::new());
    // Recorded and scripted motions make samples of no wire type.
    let of_motions =
        ["server/scene/src/motion.rs", "server/plicad/src/commands/bench.rs"].map(|p| repository().join(p));
    assert_eq!(outside("wire.rs", "PoseSample {"), of_motions);
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

/// The crate roots below `src` folders of the workspace: libraries and programs.
fn crate_roots() -> Vec<PathBuf> {
    let metadata = metadata();
    let targets = metadata["packages"].as_array().unwrap().iter().flat_map(|p| p["targets"].as_array().unwrap());
    let sources = targets.filter(|target| matches!(target["kind"][0].as_str(), Some("lib" | "bin")));
    sources.map(|target| PathBuf::from(target["src_path"].as_str().unwrap())).collect()
}

fn trees() -> Vec<CrateTree> {
    let read = |path: &Path| path.is_file().then(|| read(path));
    crate_roots().iter().map(|root| CrateTree::new(root, &read)).collect()
}

/// One reader in three files; nothing else takes a name of them but through `vtu.rs`.
const MAY_CIRCLE: &str = "server/geometry/src/import/vtu";

/// Circles as sentences, but for the one that is allowed; `name` has the place of a module.
fn described(circles: Vec<Vec<Vec<String>>>, tree: &CrateTree) -> Vec<String> {
    let root = repository();
    let place = |module: &Vec<String>| tree.file(module).strip_prefix(&root).unwrap_or(tree.file(module)).to_owned();
    let circles = circles.iter().map(|circle| circle.iter().map(place).collect::<Vec<_>>());
    let refused = circles.filter(|circle| !circle.iter().all(|file| file.starts_with(MAY_CIRCLE)));
    refused.map(|circle| circle.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(", ")).collect()
}

/// Lines for the output of a failed test: each on a line of its own, since there may be many.
fn assert_none(found: Vec<String>, kind: &str) {
    assert!(found.is_empty(), "{} {kind}:\n{}", found.len(), found.join("\n"));
}

#[test]
fn no_circle_of_files() {
    let found = trees().iter().flat_map(|tree| described(circles(&tree.arrows()), tree)).collect();
    assert_none(found, "circles of files");
}

#[test]
fn no_circle_of_folders() {
    let found = trees().iter().flat_map(|tree| described(folder_circles(&tree.arrows()), tree)).collect();
    assert_none(found, "circles of folders");
}

#[test]
fn no_file_reaches_a_sibling_through_a_parent() {
    assert_none(trees().iter().flat_map(through_parents).collect(), "names taken through a parent");
}

/// Names that a file takes from a module above it, which has them from elsewhere.
fn through_parents(tree: &CrateTree) -> Vec<String> {
    let arrows = tree.arrows();
    let handed_on = arrows.iter().filter(|arrow| arrow.through.is_some());
    let sentence = |a: &plica_tests::sources::Arrow| {
        format!("{}: {} is declared in {}", tree.file(&a.from).display(), a.name, tree.file(&a.to).display())
    };
    handed_on.map(sentence).collect()
}

/// A file that no test reads would be one without rules.
#[test]
fn every_source_file_belongs_to_a_tree() {
    let trees = trees();
    let known: Vec<&Path> = trees.iter().flat_map(CrateTree::files).collect();
    assert!(known.len() > 250, "{} files", known.len());
    let folders: Vec<PathBuf> = crate_roots().iter().map(|root| root.parent().unwrap().to_owned()).collect();
    let unknown = folders.iter().flat_map(|folder| files(folder, &[".rs"]));
    let unknown = unknown.filter(|path| !known.contains(&path.as_path()) && !path.ends_with("tests.rs"));
    assert_eq!(unknown.collect::<Vec<_>>(), Vec::<PathBuf>::new());
}

/// A crate of files held in memory.
fn made_up(files: &[(&str, &str)]) -> CrateTree {
    let files: BTreeMap<PathBuf, String> = files.iter().map(|(path, text)| (path.into(), (*text).to_owned())).collect();
    CrateTree::new(Path::new("lib.rs"), &|path| files.get(path).cloned())
}

fn modules(circles: Vec<Vec<Vec<String>>>) -> Vec<String> {
    circles.iter().map(|circle| circle.iter().map(|m| m.join("::")).collect::<Vec<_>>().join(" ")).collect()
}

#[test]
fn a_circle_of_files_is_found() {
    let ring = [
        ("lib.rs", "mod a; mod b; mod c; mod d;"),
        ("a.rs", "use crate::b::B; pub struct A;"),
        ("b.rs", "use super::{c, d::D}; pub struct B; fn f() { c::g(); }"),
        ("c.rs", "pub fn g() -> crate::a::A { crate::a::A }"),
        ("d.rs", "pub struct D;"),
    ];
    assert_eq!(modules(circles(&made_up(&ring).arrows())), ["a b c"]);
    // Through a re-export as well, since it is the file behind it that is taken from.
    let facade = [
        ("lib.rs", "mod x; mod y;"),
        ("x.rs", "mod a; mod b; pub use a::A; pub use b::B;"),
        ("x/a.rs", "pub struct A(super::b::B);"),
        ("x/b.rs", "pub struct B(Vec<crate::x::A>);"),
        ("y.rs", "use crate::x::A;"),
    ];
    assert_eq!(modules(circles(&made_up(&facade).arrows())), ["x::a x::b"]);
}

#[test]
fn a_parent_a_facade_and_test_code_make_no_circle() {
    let files = [
        ("lib.rs", "mod x; pub use x::A; pub struct Top;"),
        ("x.rs", "mod a; pub use a::A; pub struct X; fn f(a: A) {}"),
        ("x/a.rs", "use super::X; pub struct A(X, crate::Top); #[cfg(test)] mod tests { use crate::y::Y; }"),
    ];
    let arrows = made_up(&files).arrows();
    assert_eq!(circles(&arrows), Vec::<Vec<Vec<String>>>::new());
    assert_eq!(arrows.len(), 3, "{arrows:?}");
}

#[test]
fn a_circle_of_folders_without_one_of_files_is_found() {
    let files = [
        ("lib.rs", "mod x; mod y;"),
        ("x.rs", "mod a; mod b;"),
        ("x/a.rs", "use crate::y::c::C;"),
        ("x/b.rs", "pub struct B;"),
        ("y.rs", "pub mod c; mod d;"),
        ("y/c.rs", "pub struct C;"),
        ("y/d.rs", "use crate::x::b::B;"),
    ];
    let arrows = made_up(&files).arrows();
    assert_eq!(circles(&arrows), Vec::<Vec<Vec<String>>>::new());
    assert_eq!(modules(folder_circles(&arrows)), ["x y"]);
}

#[test]
fn a_sibling_reached_through_its_parent_is_found() {
    let files = |a: &'static str| {
        let parent = "mod a; mod error; pub use error::Error; pub struct Own;";
        made_up(&[("lib.rs", "mod x;"), ("x.rs", parent), ("x/a.rs", a), ("x/error.rs", "pub struct Error;")])
    };
    let through_parent = through_parents(&files("use super::{Error, Own};"));
    assert_eq!(through_parent, ["x/a.rs: super::Error is declared in x/error.rs"]);
    assert_eq!(through_parents(&files("use super::{Own, error::Error};")), Vec::<String>::new());
    assert_eq!(through_parents(&files("fn f() -> crate::x::Error {}")).len(), 1);
}
