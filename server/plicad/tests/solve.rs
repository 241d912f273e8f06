//! `plicad solve` from outside: what it computes against what is known, and how it refuses.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn plicad(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_plicad")).args(arguments).output().unwrap()
}

/// The one JSON object on the last line of standard output.
fn last_line(output: &Output) -> Value {
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{errors}");
    serde_json::from_str(text.lines().last().unwrap_or_default()).unwrap_or_else(|e| panic!("{e}: {text}{errors}"))
}

/// Solves a case given as text.
fn solve(case: &str) -> Value {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("case.toml");
    fs::write(&file, case).unwrap();
    last_line(&plicad(&["solve", file.to_str().unwrap(), "--json"]))
}

fn refusal(case: &str) -> String {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("case.toml");
    fs::write(&file, case).unwrap();
    let output = plicad(&["solve", file.to_str().unwrap(), "--json"]);
    assert!(!output.status.success(), "it was not refused");
    let last = String::from_utf8(output.stdout).unwrap();
    let said: Value = serde_json::from_str(last.lines().last().unwrap()).unwrap();
    said["error"]["message"].as_str().unwrap().to_owned()
}

/// A file of configs/cases with some of its text replaced.
fn case(name: &str, changes: &[(&str, &str)]) -> String {
    let text = fs::read_to_string(repository().join("configs/cases").join(name)).unwrap();
    changes.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "`{from}` is not in {name}");
        text.replace(from, to)
    })
}

fn probe(said: &Value, name: &str) -> Vec<f64> {
    let value = &said["probes"][name]["value"];
    let numbers = value.as_array().cloned().unwrap_or_else(|| vec![value.clone()]);
    numbers.iter().map(|n| n.as_f64().unwrap_or_else(|| panic!("{name}: {said}"))).collect()
}

#[track_caller]
fn assert_close(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{found} is not {expected} within {share}");
}

/// A bar along x, 20 x 10 x 10 mm, pulled with 1 kPa; half of it is twice as stiff.
fn bar(mesh: &str, stiff: &str, wall: &str, end: &str) -> String {
    format!(
        r#"
[mesh]
{mesh}
[material]
model = "linear"
young_modulus_pa = 1e6
poisson_ratio = 0.0
[[regions]]
name = "stiff"
select = {stiff}
young_modulus_pa = 2e6
poisson_ratio = 0.0
[[supports]]
name = "wall"
select = {wall}
[[loads]]
name = "pull"
select = {end}
traction_pa = [1000.0, 0.0, 0.0]
[[probes]]
name = "joint"
quantity = "displacement"
at_m = [0.01, 0.004, 0.003]
[[probes]]
name = "end"
quantity = "displacement"
select = {{ face = "x_max" }}
[[probes]]
name = "corner"
quantity = "displacement"
nearest_to_m = [0.03, 0.02, 0.02]
[[probes]]
name = "wall"
quantity = "force"
support = "wall"
[[probes]]
name = "stress"
quantity = "stress"
at_m = [0.013, 0.004, 0.003]
[[probes]]
name = "volume"
quantity = "volume"
"#
    )
}

fn check_bar(said: &Value) {
    assert_close(probe(said, "joint")[0], 1e-5, 1e-9);
    assert_close(probe(said, "end")[0], 1.5e-5, 1e-9);
    assert_close(probe(said, "corner")[0], 1.5e-5, 1e-9);
    assert_close(probe(said, "wall")[0], -0.1, 1e-9);
    let stress = probe(said, "stress");
    assert_close(stress[0], 1000.0, 1e-9);
    assert!(stress[1..].iter().all(|s| s.abs() < 1e-6), "{stress:?}");
    assert_close(probe(said, "volume")[0], 2e-6 * (1.0 + 1.5e-5 / 0.02), 1e-12);
    assert_eq!(said["probes"]["stress"]["unit"], "Pa");
    assert_eq!(said["warnings"].as_array().unwrap().len(), 0);
}

#[test]
fn a_bar_of_two_materials_stretches_as_springs_in_series() {
    let block = "generator = \"block\"\nsize_m = [0.02, 0.01, 0.01]\ndivisions = [4, 2, 2]";
    let (wall, end) = ("{ where = \"x < 1e-6\" }", "{ box = { min_m = [0.02, 0, 0], max_m = [0.02, 0.01, 0.01] } }");
    check_bar(&solve(&bar(block, "{ where = \"x > 0.01\" }", wall, end)));
    let corners = "corners_m = [[0, 0, 0], [0.02, 0, 0], [0.02, 0.01, 0], [0, 0.01, 0], \
                   [0, 0, 0.01], [0.02, 0, 0.01], [0.02, 0.01, 0.01], [0, 0.01, 0.01]]";
    let graded = format!("generator = \"hexahedron\"\n{corners}\ndivisions = [2, 2, 2]\ngrading = [1.0, 3.0, 0.5]");
    check_bar(&solve(&bar(&graded, "{ face = \"x_max\" }", "{ face = \"x_min\" }", "{ face = \"x_max\" }")));
}

#[test]
fn the_same_bar_from_mesh_files_with_groups() {
    let data = repository().join("server/geometry/tests/data").canonicalize().unwrap();
    let file = |name: &str| format!("file = {:?}\nmetres_per_unit = 1e-3", data.join(name));
    let wall = "{ face = \"x_min\" }";
    check_bar(&solve(&bar(&file("boxes-4.1-binary.msh"), "{ group = \"stiff\" }", wall, "{ group = \"end\" }")));
    let vtu = file("boxes-appended-raw-zlib.vtu");
    check_bar(&solve(&bar(&vtu, "{ group = \"material=2\" }", wall, "{ face = \"x_max\" }")));
    let message = refusal(&bar(&file("second-order.msh"), "{ group = \"stiff\" }", wall, "{ group = \"end\" }"));
    assert!(message.contains("case.toml:3: mesh.file") && message.contains("27-node hexahedra"), "{message}");
}

/// A rubber block between two plates that do not let it slip, squeezed by a displacement; symmetric, so the plates' forces cancel.
const SQUEEZED: &str = r#"
[mesh]
generator = "block"
size_m = [0.01, 0.01, 0.01]
divisions = [3, 3, 3]
[material]
model = "stable_neo_hookean"
young_modulus_pa = 1e5
poisson_ratio = 0.45
[[supports]]
name = "floor"
select = { face = "z_min" }
[[supports]]
name = "plate"
select = { face = "z_max" }
displacement_m = [0.0, 0.0, -4e-3]
[[probes]]
name = "floor"
quantity = "force"
support = "floor"
[[probes]]
name = "plate"
quantity = "force"
support = "plate"
[solve]
max_iterations = 30
"#;

#[test]
fn given_displacements_have_reactions_that_balance() {
    let said = solve(SQUEEZED);
    let (floor, plate) = (probe(&said, "floor"), probe(&said, "plate"));
    assert!(floor[2] > 5.0 && (floor[2] + plate[2]).abs() < 1e-8 * floor[2], "{floor:?} {plate:?}");
    let history = said["info"]["load_steps"][0]["residuals"].as_array().unwrap();
    assert!(history.last().unwrap().as_f64().unwrap() <= 1e-9, "{history:?}");
    assert_eq!(history.len() as u64, said["info"]["iterations"].as_u64().unwrap() + 1);
}

/// A step that needs more Newton steps than it may take is halved; the result is that of enough steps.
#[test]
fn a_step_that_fails_is_halved() {
    let one = solve(SQUEEZED);
    let patient = SQUEEZED.replace("max_iterations = 30", "max_iterations = 4\nmax_halvings = 12");
    let halved = solve(&patient);
    assert!(halved["info"]["failed_load_steps"].as_u64().unwrap() > 0, "{halved}");
    assert!(halved["info"]["load_steps"].as_array().unwrap().len() > 1, "{halved}");
    assert_close(probe(&halved, "floor")[2], probe(&one, "floor")[2], 1e-6);
    let message = refusal(&SQUEEZED.replace("max_iterations = 30", "max_iterations = 1\nmax_halvings = 3"));
    assert!(message.contains("no equilibrium beyond 0.0000 of the loads"), "{message}");
    assert!(message.contains("raise solve.steps"), "{message}");
}

/// A pressure all around has no resultant however the body is turned, and compresses by `p / K`.
#[test]
fn pressure_all_around_compresses_evenly() {
    let said = solve(
        r#"
[mesh]
generator = "block"
size_m = [0.02, 0.01, 0.01]
divisions = [3, 2, 2]
[material]
model = "compressible_neo_hookean"
mu_pa = 1e5
lambda_pa = 1e6
[[supports]]
name = "x"
select = { where = "x == 0 && y == 0 && z == 0" }
[[supports]]
name = "y"
select = { where = "x > 0.0199 && y == 0 && z == 0" }
axes = ["y", "z"]
[[supports]]
name = "z"
select = { where = "x == 0 && y > 0.0099 && z == 0" }
axes = ["z"]
[[loads]]
name = "water"
select = { where = "x > -1" }
pressure_pa = 10.0
[[probes]]
name = "volume"
quantity = "volume"
[[probes]]
name = "stress"
quantity = "stress"
at_m = [0.005, 0.005, 0.005]
[[probes]]
name = "held"
quantity = "force"
support = "x"
"#,
    );
    let bulk = 1e6 + 2.0 / 3.0 * 1e5;
    assert_close(1.0 - probe(&said, "volume")[0] / 2e-6, 10.0 / bulk, 1e-4);
    let stress = probe(&said, "stress");
    assert!(
        stress[..3].iter().all(|s| (s + 10.0).abs() < 1e-6) && stress[3..].iter().all(|s| s.abs() < 1e-6),
        "{stress:?}"
    );
    assert!(probe(&said, "held").iter().all(|f| f.abs() < 1e-11), "{said}");
}

#[test]
fn the_result_is_a_file_for_paraview() {
    let folder = TempDir::new().unwrap();
    let (file, out) = (folder.path().join("case.toml"), folder.path().join("out.vtu"));
    fs::write(&file, SQUEEZED).unwrap();
    let (file, out) = (file.to_str().unwrap(), out.to_str().unwrap());
    let output = plicad(&["solve", file, "--out", out]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("27 hexahedra") && text.contains("probe      floor  force"), "{text}");
    let head = fs::read_to_string(out).unwrap();
    for field in ["displacement_m", "cauchy_stress_pa", "von_mises_pa", "jacobian", "region"] {
        assert!(head.contains(&format!("Name=\"{field}\"")), "no {field}");
    }
    let mesh =
        plica_geometry::import::read_mesh(Path::new(out), plica_geometry::import::ReadOptions::unit(1.0)).unwrap();
    assert_eq!((mesh.mesh.n_elements(), mesh.groups.volume("region=0").unwrap().elements.len()), (27, 27));
    let refused = plicad(&["solve", file, "--out", "no/such/folder/out.vtu"]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("there is no folder no/such/folder"));
}

/// Deflection and shortening of the cantilever's tip over its length.
fn cantilever(changes: &[(&str, &str)]) -> [f64; 2] {
    let said = solve(&case("cantilever.toml", changes));
    let tip = probe(&said, "tip");
    let found = [-tip[2] / 0.4, -tip[0] / 0.4];
    println!("cantilever {changes:?}: w/L {:.5}, u/L {:.5}, {} s", found[0], found[1], said["wall_s"]);
    found
}

const LIGHT: (&str, &str) = ("-2.0833333e-3", "-5.2083333e-4");

/// F L^2 / (E I) = 4 and 1 against the elastica [BD45].
#[test]
fn a_cantilever_bends_like_the_elastica() {
    let [w, u] = cantilever(&[]);
    assert_close(w, 0.6700, 0.01);
    assert_close(u, 0.3289, 0.01);
    let [w, u] = cantilever(&[LIGHT]);
    assert_close(w, 0.3017, 0.01);
    assert_close(u, 0.0564, 0.01);
}

#[test]
#[ignore = "half a minute; run by name"]
fn a_fine_cantilever_bends_like_the_elastica() {
    for model in ["compressible_neo_hookean", "stable_neo_hookean"] {
        let fine = [
            ("[480, 1, 8]", "[960, 1, 12]"),
            ("model = \"compressible_neo_hookean\"", &format!("model = \"{model}\"")),
        ];
        let [w, u] = cantilever(&fine);
        assert_close(w, 0.6700, 0.003);
        assert_close(u, 0.3289, 0.003);
    }
}

/// How far the upper right corner of Cook's membrane rises \[m\].
fn cook(name: &str, divisions: usize) -> f64 {
    let said = solve(&case(name, &[("[64, 64, 1]", &format!("[{divisions}, {divisions}, 1]"))]));
    let rise = probe(&said, "corner")[1];
    println!("{name} {divisions} x {divisions}: {:.4} mm, {} s", 1e3 * rise, said["wall_s"]);
    assert_close(probe(&said, "wall")[1], -100.0, 1e-8);
    rise
}

#[test]
fn cooks_membrane_rises_as_published() {
    assert_close(cook("cook-linear.toml", 64), 32.2e-3, 0.01);
    let (coarse, refined) = (cook("cook-stable.toml", 32), cook("cook-stable.toml", 64));
    assert_close(coarse, refined, 0.01);
    assert_close(refined, 17.5e-3, 0.01);
}

#[test]
#[ignore = "half a minute; run by name"]
fn cooks_membrane_is_converged() {
    assert_close(cook("cook-linear.toml", 128), 32.2e-3, 0.01);
    assert_close(cook("cook-stable.toml", 64), cook("cook-stable.toml", 128), 0.01);
}

/// How far the middle of the loaded face of the block sinks \[m\].
fn block(model: &str, divisions: usize) -> f64 {
    let divisions = format!("[{divisions}, {divisions}, {divisions}]");
    let said = solve(&case("block.toml", &[("[12, 12, 12]", &divisions), ("compressible_neo_hookean", model)]));
    let depth = -probe(&said, "middle")[2];
    println!("block {model} {divisions}: {:.4} mm, {} s", 1e3 * depth, said["wall_s"]);
    depth
}

#[test]
fn a_nearly_incompressible_block_sinks_as_published() {
    let (compressible, stable) = (block("compressible_neo_hookean", 8), block("stable_neo_hookean", 8));
    assert_close(compressible, 0.70e-3, 0.03);
    println!("stable sinks by {:.1} % less", 100.0 * (1.0 - stable / compressible));
    assert!((0.03..0.10).contains(&(1.0 - stable / compressible)), "{stable} beside {compressible}");
}

#[test]
#[ignore = "two minutes; run by name"]
fn the_block_is_converged() {
    assert_close(block("compressible_neo_hookean", 20), 0.70e-3, 0.03);
    assert_close(block("stable_neo_hookean", 12), block("stable_neo_hookean", 20), 0.01);
}

#[test]
fn an_unstable_equilibrium_is_a_warning_and_may_be_left() {
    let file = repository().join("configs/cases/column.toml");
    let file = file.to_str().unwrap();
    let straight = last_line(&plicad(&["solve", file, "--json"]));
    assert!(
        straight["warnings"][0].as_str().unwrap().contains("negative in 1 direction; --follow-stable"),
        "{straight}"
    );
    assert_eq!(straight["info"]["negative_directions"], 1);
    let bent = last_line(&plicad(&["solve", file, "--follow-stable", "--json"]));
    assert_eq!(
        (&bent["info"]["negative_directions"], bent["warnings"].as_array().unwrap().len()),
        (&Value::from(0), 0)
    );
    assert!(probe(&bent, "tip")[2].abs() > 0.07, "{bent}");
}

#[test]
fn both_schemas_are_printed() {
    assert_eq!(last_line(&plicad(&["schema", "--case", "--json"]))["title"], "Plica case");
    assert_ne!(last_line(&plicad(&["schema", "--json"]))["title"], "Plica case");
}
