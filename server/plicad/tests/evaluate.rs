//! `plicad evaluate` and `plicad chart` from outside.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// A block with few elements: an interaction takes a fraction of a second.
const SCENE: &str = r#"
[objects.block]
mesh = { generator = "block", size_m = [0.04, 0.04, 0.02] }
material = { young_modulus_pa = 3e4, poisson_ratio = 0.45, density_kg_per_m3 = 1000.0 }
supports = { fixed = { faces = ["z_min"] } }
coarse = { divisions = [3, 3, 2] }
skin = { spacing_m = 0.002 }
accurate = { divisions = [8, 8, 4], poisson_ratio = 0.48 }
[objects.block.training]
examples = 17
contact_regions = [{ min_m = [0.012, 0.012, 0.0], max_m = [0.028, 0.028, 1.0] }]
depth_share = [0.1, 0.25]
drag_m = [0.0, 0.002]
evaluation = { examples = 3, outside = [{ name = "lift", action = "lift", examples = 2, depth_share = [0.05, 0.1] }] }
[tools.rod]
shape = { capsule = { radius_m = 0.006, length_m = 0.1 } }
friction = 0.8
[bench]
motion = [
    { tool = "rod", time_s = 0.0, position_m = [0.02, 0.02, 0.027] },
    { tool = "rod", time_s = 0.1, position_m = [0.02, 0.02, 0.024] },
]
"#;

/// A folder with the scene in it.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("block.toml"), SCENE).unwrap();
        Self(folder)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_plicad")).args(arguments).current_dir(self.0.path()).output().unwrap()
    }

    fn train(&self) {
        for kind in ["training", "evaluation"] {
            json(&self.run(&["train", "block.toml", "--kind", kind, "--threads", "2", "--json"]));
        }
    }
}

/// The one JSON object on the last line.
fn json(output: &Output) -> Value {
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{errors}");
    serde_json::from_str(text.lines().last().unwrap_or_default()).unwrap_or_else(|e| panic!("{e}: {text}"))
}

fn errors(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn an_evaluation_is_a_table_and_json() {
    let place = Place::new();
    place.train();
    let output = place.run(&["evaluate", "block.toml", "--methods", "kriging-stamp,rescale,ssh12-blend", "--json"]);
    let found = json(&output);
    assert_eq!((&found["scene"], &found["default"]), (&"block".into(), &"kriging-stamp".into()));
    assert_eq!((&found["held_out"]["in_region"], &found["held_out"]["outside"]), (&3.into(), &2.into()));
    let methods = found["methods"].as_array().unwrap();
    let names: Vec<&str> = methods.iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["coarse", "kriging-stamp", "rescale", "ssh12-blend"]);
    for m in methods {
        for key in ["correlator", "interpolator"] {
            assert!(m[key].is_string(), "{m}");
        }
        for group in ["in_region", "near_contact", "outside"] {
            for key in ["median", "p95", "worst", "median_mm", "independent_median_mm"] {
                assert!(m[group][key].as_f64().is_some(), "{group}.{key}: {m}");
            }
        }
        assert!(m["tick_us"].is_number() && m["examples"].is_u64());
    }
    assert_eq!((&methods[0]["in_region"]["median"], &methods[0]["examples"]), (&1.0.into(), &0.into()));
    assert_eq!((&methods[1]["correlator"], &methods[1]["interpolator"]), (&"kriging".into(), &"stamp".into()));
    assert!(methods[1]["in_region"]["median"].as_f64().unwrap() < 0.7);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("kriging-stamp*") && text.contains("3 held-out states"), "{text}");

    let few = json(&place.run(&["evaluate", "block.toml", "--methods", "kriging-vector", "--examples", "5", "--json"]));
    assert_eq!(few["methods"][1]["examples"], 5);
    assert!(few["slide"].is_null() && few["by_examples"].as_array().unwrap().is_empty());

    let output = place.run(&["evaluate", "block.toml", "--methods", "rescale", "--slide", "--json"]);
    let slide = &json(&output)["slide"];
    assert!(slide["states"].as_u64().unwrap() >= 3 && slide["accurate"]["rms_mm"].as_f64().unwrap() > 0.0, "{slide}");
    assert_eq!(slide["methods"][0]["name"], "rescale");
    assert!(String::from_utf8_lossy(&output.stdout).contains("accurate (tied)"));
}

#[test]
fn what_cannot_be_evaluated_is_refused_in_words() {
    let place = Place::new();
    let message = errors(&place.run(&["evaluate", "block.toml"]));
    assert!(
        message.contains("out/train/block-training/database.safetensors")
            && message.contains("`plicad train block.toml`"),
        "{message}"
    );
    place.train();
    let message = errors(&place.run(&["evaluate", "block.toml", "--held-out", "none.safetensors"]));
    assert!(message.contains("`plicad train block.toml --kind evaluation --out none.safetensors`"), "{message}");
    let message = errors(&place.run(&["evaluate", "block.toml", "--methods", "magic"]));
    assert!(message.contains("no method `magic`") && message.contains("rescale"), "{message}");
    fs::write(place.0.path().join("block.toml"), SCENE.replace("3e4", "4e4")).unwrap();
    let message = errors(&place.run(&["evaluate", "block.toml"]));
    assert!(message.contains("belongs to another scene"), "{message}");
}

/// The names of the points with what they say, without what differs from run to run.
fn points(chart: &Value) -> Vec<(String, f64, f64)> {
    let point = |p: &Value| {
        let mm = p["independent_mm"].as_f64().unwrap();
        (p["name"].as_str().unwrap().to_owned(), mm, p["simulation_us"].as_f64().unwrap())
    };
    chart["points"].as_array().unwrap().iter().map(point).collect()
}

#[test]
fn a_chart_has_a_front_and_goes_on_where_it_was() {
    let place = Place::new();
    place.train();
    let arguments = ["chart", "block.toml", "--ticks", "100", "--json"];
    let first = json(&place.run(&arguments));
    let all = points(&first);
    let names: Vec<&str> = all.iter().map(|p| p.0.as_str()).collect();
    for name in [
        "coarse",
        "kriging-stamp",
        "ssh12-blend, 16 examples",
        "kriging-stamp, 64 texels",
        "kriging-stamp, f32",
        "coarse, full integration",
        "coarse, 2 substeps",
        "coarse, trilinear embedding",
        "coarse, 6x6x4",
    ] {
        assert!(names.contains(&name), "{name} is not in {names:?}");
    }
    let mm = |name: &str| all.iter().find(|p| p.0 == name).unwrap().1;
    assert!(mm("coarse, 6x6x4") < mm("coarse") && mm("kriging-stamp") < mm("coarse"));
    // The front falls in error as it rises in time, and every other point is beaten by one of it.
    let of = |name: &Value| first["points"].as_array().unwrap().iter().find(|p| p["name"] == *name).unwrap();
    let place_of = |p: &Value| {
        let tick = p["simulation_us"].as_f64().unwrap() + p["enrichment_us"].as_f64().unwrap();
        [tick, p["independent_mm"].as_f64().unwrap()]
    };
    let front: Vec<[f64; 2]> = first["front"].as_array().unwrap().iter().map(|name| place_of(of(name))).collect();
    assert!(!front.is_empty() && front.windows(2).all(|w| w[0][0] < w[1][0] && w[0][1] > w[1][1]), "{front:?}");
    for p in first["points"].as_array().unwrap() {
        let [tick, mm] = place_of(p);
        assert!(front.iter().any(|f| f[0] <= tick && f[1] <= mm), "{p}");
        assert_eq!(p["on_front"], first["front"].as_array().unwrap().contains(&p["name"]));
    }
    let svg = fs::read_to_string(place.0.path().join("out/chart/block/chart.svg")).unwrap();
    assert!(svg.contains("block: speed against accuracy") && svg.contains("front: none is both"), "{svg}");

    // What was measured is kept to the last bit; what is missing is made up for.
    let file = place.0.path().join("out/chart/block/chart.json");
    let mut stored: Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
    stored["points"].as_array_mut().unwrap().retain(|p| p["name"] != "rescale");
    fs::write(&file, stored.to_string()).unwrap();
    let again = json(&place.run(&arguments));
    assert_eq!(points(&again), all);
    // Other ticks are another measurement, and so is a fresh one.
    let quick = json(&place.run(&["chart", "block.toml", "--ticks", "120", "--quick", "--json"]));
    assert!(points(&quick).iter().all(|p| p.0 == "coarse" || !p.0.starts_with("coarse,")));
    assert_ne!(quick["identity"], first["identity"]);
    fs::write(&file, "{").unwrap();
    let message = errors(&place.run(&arguments));
    assert!(message.contains("chart.json: is not a chart") && message.contains("--fresh"), "{message}");
}
