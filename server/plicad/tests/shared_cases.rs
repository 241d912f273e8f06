//! Small files of real kinds of trouble: the sentence or the result that each of them gets.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// Displacement of the tip of the bar: 0.04 N at x_max, E 10 kPa, nu 0.3, x_min held \[m\].
const TIP_M: f64 = 3.9103e-4;

/// A folder of `../shared/cases`, where it is there.
fn cases(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/cases").join(name);
    if !folder.is_dir() {
        println!("{} is absent: nothing is tested", folder.display());
        return None;
    }
    folder.canonicalize().ok()
}

fn plicad(command: &str, text: &str) -> Output {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("a.toml");
    fs::write(&file, text).unwrap();
    Command::new(env!("CARGO_BIN_EXE_plicad")).args([command, file.to_str().unwrap(), "--json"]).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_str(String::from_utf8_lossy(&output.stdout).lines().last().unwrap()).unwrap()
}

fn bar(mesh: &Path, keys: &str) -> String {
    format!(
        "[mesh]\nfile = \"{}\"\n{keys}\n[material]\nmodel = \"linear\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\n\
         [[supports]]\nname = \"wall\"\nselect = {{ face = \"x_min\" }}\n\
         [[loads]]\nname = \"tip\"\nselect = {{ face = \"x_max\" }}\nforce_n = [0.04, 0.0, 0.0]\n\
         [[probes]]\nname = \"tip\"\nquantity = \"displacement\"\nselect = {{ face = \"x_max\" }}\n",
        mesh.display()
    )
}

fn check_tip(name: &str, output: &Output) -> Value {
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    let report = json(output);
    let tip = report["probes"]["tip"]["value"][0].as_f64().unwrap();
    assert!((tip - TIP_M).abs() < 1e-4 * TIP_M, "{name}: {tip}");
    report
}

#[test]
fn readable_meshes_give_the_reference_and_separate_halves_a_sentence() {
    let Some(folder) = cases("mesh") else { return };
    for name in ["bar_bom.msh", "bar_comment.msh", "empty_piece.vtu", "lagrange1.vtu", "pieces.vtu"] {
        let report = check_tip(name, &plicad("solve", &bar(&folder.join(name), "")));
        assert_eq!(report["warnings"].as_array().unwrap().len(), usize::from(name == "pieces.vtu"), "{name}");
    }
    let halves = folder.join("two_halves.vtu");
    let refused = plicad("solve", &bar(&halves, ""));
    let message = json(&refused)["error"]["message"].to_string();
    assert!(message.contains("at 9 points several nodes") && message.contains("(0.02, 0, 0)"), "{message}");
    check_tip("two_halves.vtu, merged", &plicad("solve", &bar(&halves, "merge_tolerance_m = 1e-6")));
}

fn scene(shape: &str) -> String {
    format!(
        "[objects.block]\nmesh = {{ generator = \"block\", size_m = [0.08, 0.08, 0.04] }}\n\
         material = {{ young_modulus_pa = 3e4, poisson_ratio = 0.4, density_kg_per_m3 = 1000.0 }}\n\
         coarse = {{ divisions = [4, 4, 2] }}\nskin = {{ spacing_m = 4e-3 }}\n\
         supports = {{ fixed = {{ faces = [\"z_min\"] }} }}\n[tools.tool]\nshape = {shape}\n"
    )
}

#[test]
fn a_fork_of_one_part_is_not_convex_and_one_of_convex_parts_is() {
    let Some(folder) = cases("tools") else { return };
    let warnings = |name: &str| {
        let shape = format!("{{ mesh = {{ file = \"{}\" }} }}", folder.join(name).display());
        json(&plicad("check", &scene(&shape)))["warnings"].as_array().unwrap().clone()
    };
    let one = warnings("fork_one.obj");
    assert!(one.len() == 1 && one[0].as_str().unwrap().contains("part `fork` is not convex"), "{one:?}");
    assert!(warnings("fork_parts.obj").is_empty() && warnings("sphere_s4.obj").is_empty());
}

#[test]
fn the_cause_of_an_error_is_said_once() {
    let all = "\"x_min\", \"x_max\", \"y_min\", \"y_max\", \"z_min\", \"z_max\"";
    let text = scene("{ ball = { radius_m = 5e-3 } }").replace("\"z_min\"", all).replace("[4, 4, 2]", "[1, 1, 1]");
    let output = plicad("check", &text);
    assert!(!output.status.success());
    let message = json(&output)["error"]["message"].as_str().unwrap().to_owned();
    assert_eq!(message.matches("fixed: nothing can move").count(), 1, "{message}");
}
