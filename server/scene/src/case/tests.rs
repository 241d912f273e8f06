#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;

use super::*;
use crate::error::ConfigError;

const EXAMPLE_CASE: &str = include_str!("../../../../configs/cases/cantilever.toml");

/// A short beam in few hexahedra, with one of everything.
const CASE: &str = r#"
[mesh]
generator = "block"
size_m = [0.04, 0.01, 0.01]
divisions = [4, 1, 1]
[material]
model = "linear"
young_modulus_pa = 1e6
poisson_ratio = 0.3
[[regions]]
name = "tip"
select = { where = "x > 0.03" }
young_modulus_pa = 2e6
poisson_ratio = 0.2
[[supports]]
name = "wall"
select = { face = "x_min" }
[[supports]]
name = "end"
select = { face = "x_max", where = "z > 0.005" }
axes = ["z"]
displacement_m = [0.0, 0.0, 1e-4]
[[loads]]
name = "top"
select = { face = "z_max" }
pressure_pa = 10.0
[[probes]]
name = "middle"
quantity = "displacement"
at_m = [0.02, 0.005, 0.005]
[[probes]]
name = "held"
quantity = "force"
support = "wall"
[solve]
steps = 2
"#;

fn check_and_build(text: &str) -> Result<Problem, ConfigError> {
    Problem::new(&Case::parse(Path::new("bad.toml"), text)?)
}

#[test]
fn the_examples_read() {
    for text in [EXAMPLE_CASE, CASE] {
        check_and_build(text).unwrap();
    }
    assert_eq!(Case::parse(Path::new("a/cantilever.toml"), EXAMPLE_CASE).unwrap().name(), "cantilever");
}

/// The example names every key, typed or in a comment.
#[test]
fn the_example_explains_every_key() {
    let raw = include_str!("raw.rs");
    let fields = raw.lines().filter_map(|line| line.trim().strip_prefix("pub ")?.split_once(':'));
    let fields: Vec<&str> = fields.map(|(name, _)| name).filter(|name| !name.contains(' ')).collect();
    assert!(fields.len() > 30, "{fields:?}");
    for field in fields {
        let key = match field {
            "within" => "box",
            "condition" => "where",
            other => other,
        };
        let is_there = EXAMPLE_CASE.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).any(|word| word == key);
        assert!(is_there, "`{key}` is not explained in configs/cases/cantilever.toml");
    }
}

#[test]
fn the_example_writes_the_defaults() {
    let written = Case::parse(Path::new("a.toml"), EXAMPLE_CASE).unwrap().solve();
    let bare = &EXAMPLE_CASE[..EXAMPLE_CASE.find("[solve]").unwrap()];
    assert_eq!(Case::parse(Path::new("a.toml"), bare).unwrap().solve(), written);
}

/// Each bad file gives one message that names file, line, key, what is wrong, and what to do.
#[test]
fn every_bad_case_gives_one_clear_message() {
    let cases: &[(&str, &str, &[&str])] = &[
        (
            "generator = \"block\"",
            "generator = \"cone\"",
            &["mesh.generator", "unknown variant `cone`", "cantilever.toml"],
        ),
        ("generator = \"block\"", "", &["mesh", "needs a generator or a file"]),
        ("generator = \"block\"", "file = \"none.msh\"", &["mesh.divisions", "no meaning with a mesh file"]),
        ("size_m = [0.04, 0.01, 0.01]", "length_m = 0.04", &["mesh.length_m", "no meaning"]),
        ("size_m = [0.04, 0.01, 0.01]", "size_m = [0.04, -0.01, 0.01]", &["mesh.size_m", "-0.01"]),
        ("divisions = [4, 1, 1]", "", &["mesh.divisions", "is missing"]),
        ("divisions = [4, 1, 1]", "divisions = [4000, 400, 1]", &["1600000 hexahedra", "fewer"]),
        (
            "divisions = [4, 1, 1]",
            "divisions = [4, 1, 1]\ngrading = [0.0, 1.0, 1.0]",
            &["mesh.grading", "0.001 to 1000"],
        ),
        ("model = \"linear\"", "model = \"rubber\"", &["unknown variant `rubber`", "stable_neo_hookean"]),
        ("young_modulus_pa = 1e6", "young_modulus_pa = 1e6\nmu_pa = 1e5", &["material", "belong together"]),
        ("young_modulus_pa = 1e6", "", &["material", "give young_modulus_pa and poisson_ratio, or mu_pa"]),
        ("poisson_ratio = 0.3", "poisson_ratio = 0.5", &["material.poisson_ratio", "-0.99 to 0.499999"]),
        ("poisson_ratio = 0.2", "mu_pa = 1.0", &["regions.0", "belong together"]),
        ("x > 0.03", "x > 0.03 mm", &["regions.0.select.where", "column 10", "`mm`"]),
        ("x > 0.03", "x > 30", &["regions.0.select", "selects none of 4 hexahedra", "spans [0.0000e0"]),
        ("select = { where = \"x > 0.03\" }", "select = {}", &["regions.0.select", "selects nothing", "face = "]),
        ("face = \"x_min\"", "face = \"left\"", &["unknown variant `left`", "x_min"]),
        ("face = \"x_min\"", "group = \"left\"", &["supports.0.select", "no group `left`; the mesh has none"]),
        ("name = \"end\"", "name = \"wall\"", &["supports.1.name", "`wall` is taken"]),
        ("name = \"end\"", "name = \" \"", &["supports.1.name", "is empty"]),
        ("axes = [\"z\"]", "axes = []", &["supports.1.axes", "holds nothing"]),
        ("axes = [\"z\"]", "axes = [\"x\"]", &["supports.1.displacement_m", "moves along z"]),
        (
            "face = \"x_max\", where = \"z > 0.005\"",
            "face = \"z_max\"",
            &["supports.1", "`wall` moves the node at", "`end` by 0.0001 m"],
        ),
        (
            "face = \"x_min\" }",
            "face = \"x_min\", where = \"y < 1e-9 && z < 1e-9\" }",
            &["supports", "free to turn about"],
        ),
        ("pressure_pa = 10.0", "pressure_pa = 10.0\nforce_n = [1, 0, 0]", &["loads.0", "2 of seven kinds"]),
        ("pressure_pa = 10.0", "", &["loads.0", "exactly one of traction_pa"]),
        ("pressure_pa = 10.0", "pressure_pa = inf", &["loads.0.pressure_pa", "inf"]),
        ("pressure_pa = 10.0", "pressure = 10.0", &["unknown field `pressure`", "pressure_pa"]),
        (
            "at_m = [0.02, 0.005, 0.005]",
            "at_m = [0.02, 0.005, 0.05]",
            &["probes.0.at_m", "outside the body", "4.0000e-2"],
        ),
        ("at_m = [0.02, 0.005, 0.005]", "", &["probes.0", "exactly one of at_m, nearest_to_m, select"]),
        ("at_m = [0.02, 0.005, 0.005]", "support = \"wall\"", &["probes.0.support", "no meaning with displacement"]),
        ("quantity = \"force\"", "quantity = \"forces\"", &["unknown variant `forces`"]),
        ("support = \"wall\"", "support = \"floor\"", &["probes.1.support", "no support `floor`", "wall, end"]),
        ("pressure_pa = 10.0", "gravity_m_per_s2 = [0, 0, -9.81]", &["loads.0.gravity_m_per_s2", "no density"]),
        ("axes = [\"z\"]", "normal = [0, 0, 0]", &["supports.1.normal", "length 0"]),
        ("axes = [\"z\"]", "axes = [\"z\"]\nnormal = [0, 0, 1]", &["supports.1.axes", "no meaning with normal"]),
        (
            "displacement_m = [0.0, 0.0, 1e-4]",
            "displacement_m = [0.0, 0.0, 1e-4]\nturn = { axis = [1, 0, 0], angle_deg = 5 }",
            &["supports.1.displacement_m", "no meaning with turn"],
        ),
        ("support = \"wall\"", "tool = \"ball\"", &["probes.1.tool", "no tool `ball`"]),
        (
            "support = \"wall\"",
            "support = \"wall\"\nabout_m = [0, 0, 0]",
            &["probes.1.about_m", "no meaning with force"],
        ),
        ("steps = 2", "arc_length = { step_m = 1e-3, max_steps = 5 }", &["solve.arc_length", "supports that move"]),
        (
            "[solve]",
            "[[tools]]\nname = \"a\"\nshape = { ball = { radius_m = 1e-3 } }\nposition_m = [0, 0, 1]\nfriction = 0.3\n\
             [[tools]]\nname = \"b\"\nshape = { half_space = {} }\nposition_m = [0, 0, -1]\n[solve]",
            &["tools.0.friction", "several tools"],
        ),
        ("steps = 2", "steps = 0", &["solve.steps", "1 to 1000"]),
        ("steps = 2", "tolerance = 0.1", &["solve.tolerance", "0.001"]),
        ("[solve]", "[solver]", &["unknown field `solver`"]),
        ("steps = 2", "steps = ", &["not valid TOML"]),
    ];
    for (from, to, fragments) in cases {
        assert!(CASE.contains(from), "`{from}` is not in the case");
        let text = CASE.replacen(from, to, 1);
        let message = check_and_build(&text).expect_err(to).to_string();
        assert!(message.starts_with("bad.toml:") && !message.contains('\n'), "{message}");
        let named: usize = message.split(':').nth(1).unwrap().parse().unwrap();
        if message.contains("outside the allowed range") {
            let line = 1 + text[..text.find(to).unwrap() + to.len()].matches('\n').count();
            assert_eq!(named, line, "{message}");
        }
        for fragment in *fragments {
            assert!(message.contains(fragment), "`{fragment}` is missing in: {message}");
        }
    }
    let missing = Case::from_file(Path::new("no/such.toml")).unwrap_err().to_string();
    assert!(missing.contains("no/such.toml: cannot be read"), "{missing}");
}

#[test]
fn what_leaves_a_body_free_is_named() {
    let held = |supports: &str| {
        let begin = CASE.find("[[supports]]").unwrap();
        let end = CASE.find("[[loads]]").unwrap();
        let without_force_probe =
            CASE[end..].replace("[[probes]]\nname = \"held\"\nquantity = \"force\"\nsupport = \"wall\"\n", "");
        check_and_build(&format!("{}{supports}{without_force_probe}", &CASE[..begin]))
    };
    let support = |name: &str, face: &str, axes: &str| {
        format!("[[supports]]\nname = \"{name}\"\nselect = {{ face = \"{face}\" }}\naxes = {axes}\n")
    };
    let planes = support("x", "x_min", "[\"x\"]") + &support("y", "y_min", "[\"y\"]");
    assert!(held("").unwrap_err().to_string().contains("is free to"));
    assert!(held(&planes).unwrap_err().to_string().contains("free to slide along z"));
    held(&(planes + &support("z", "z_min", "[\"z\"]"))).unwrap();
    let hinge = "[[supports]]\nname = \"hinge\"\nselect = { where = \"x == 0 && z == 0\" }\n";
    assert!(held(hinge).unwrap_err().to_string().contains("free to turn about y"));
}
