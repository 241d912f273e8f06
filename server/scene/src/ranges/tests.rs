#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;

use plica_sim::SpringCoupling;

use super::*;
use crate::{BUILT_IN_SCENE, Config, case, scene};

const CASE: &str = include_str!("../../../../configs/cases/cantilever.toml");
/// Numbers without a range: any seed will do; of a quaternion the length is checked.
const WITHOUT_RANGE: [&str; 4] = ["seed", "rotation_xyzw", "orientation_xyzw", "seed"];

/// Number of a schema: its key, schema of the number, default of the key.
struct Number<'a> {
    key: &'a str,
    schema: &'a Value,
    default: &'a Value,
}

fn numbers(schema: &Value) -> Vec<Number<'_>> {
    let mut found = Vec::new();
    collect("", schema, &Value::Null, &mut found);
    found
}

fn collect<'a>(key: &'a str, node: &'a Value, default: &'a Value, found: &mut Vec<Number<'a>>) {
    let is_number = |t: &Value| t == "number" || t == "integer";
    if is_number(&node["type"]) || node["type"].as_array().is_some_and(|types| types.iter().any(is_number)) {
        found.push(Number { key, schema: node, default });
    }
    for (word, inner) in node.as_object().into_iter().flatten() {
        match word.as_str() {
            "properties" | "$defs" => {
                let keys = inner.as_object().into_iter().flatten();
                keys.for_each(|(key, value)| collect(key, value, &value["default"], found));
            }
            "oneOf" | "anyOf" | "allOf" => {
                inner.as_array().into_iter().flatten().for_each(|value| collect(key, value, default, found));
            }
            "items" | "additionalProperties" => collect(key, inner, default, found),
            _ => {}
        }
    }
}

#[test]
fn every_number_has_a_range() {
    for (schema, without) in [(scene::schema(), &WITHOUT_RANGE[..]), (case::schema(), &[])] {
        let numbers = numbers(schema.as_value());
        assert!(numbers.len() > 20);
        let bare = numbers.iter().filter(|n| own_range(n.schema, "").is_none());
        let mut bare: Vec<&str> = bare.map(|n| n.key).collect();
        let mut expected = without.to_vec();
        bare.sort_unstable();
        expected.sort_unstable();
        assert_eq!(bare, expected);
    }
}

fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}

#[test]
fn every_default_is_within_its_range() {
    let mut n_compared = 0;
    for schema in [scene::schema(), case::schema()] {
        for Number { key, schema, default } in numbers(schema.as_value()) {
            let Some(range) = own_range(schema, "") else { continue };
            for value in flat(default) {
                assert!(range.contains(value), "{key}: {value}, {range:?}");
                n_compared += 1;
            }
        }
    }
    assert!(n_compared > 40, "{n_compared}");
}

fn steps(path: &str) -> Vec<String> {
    path.split('.').map(str::to_owned).collect()
}

/// Defaults of optional keys are not in the schema.
#[test]
fn every_default_of_the_spring_is_within_its_range() {
    let d = SpringCoupling::default();
    for (key, value) in [
        ("coupling_stiffness_n_per_m", d.stiffness_n_per_m),
        ("proxy_mass_kg", d.mass_kg),
        ("coupling_lever_m", d.lever_m),
        ("max_force_n", d.max_force_n),
        ("max_torque_n_m", d.max_torque_n_m),
    ] {
        let range = range(scene::schema().as_value(), &steps(&format!("tools.probe.{key}"))).unwrap();
        assert!(range.contains(value), "{key}: {value}, {range:?}");
    }
}

/// Ranges that comments of a TOML file give, as `key = value # A to B ...`, also behind `#`: path of the key and the range.
fn documented(text: &str) -> Vec<(String, [f64; 2])> {
    let mut table = String::new();
    let mut found = Vec::new();
    for line in text.lines() {
        let line = line.trim_start_matches(['#', ' ']);
        if let Some(header) = line.strip_prefix('[') {
            table = header.trim_start_matches('[').split(']').next().unwrap().to_owned();
        }
        let Some((key, rest)) = line.split_once(" = ") else { continue };
        let Some((_, comment)) = rest.split_once('#') else { continue };
        let words: Vec<&str> = comment.split_whitespace().collect();
        let number = |word: &str| word.trim_end_matches([':', ',', ';']).parse::<f64>().ok();
        if let [least, "to", most, ..] = words[..]
            && let (Some(least), Some(most)) = (number(least), number(most))
        {
            found.push((format!("{table}.{key}"), [least, most]));
        }
    }
    found
}

/// Documented ranges that differ from the schema's.
fn mismatches(text: &str, schema: &Value) -> Vec<String> {
    let differs = |(path, documented): &(String, [f64; 2])| {
        let own = ["", ".0", ".0.0"].iter().find_map(|below| range(schema, &steps(&format!("{path}{below}"))));
        own.is_none_or(|own| [own.least, own.most] != *documented)
    };
    documented(text).into_iter().filter(differs).map(|(path, range)| format!("{path}: {range:?}")).collect()
}

#[test]
fn the_comments_of_the_examples_give_the_ranges_of_the_schema() {
    for (text, schema, n_least) in [(BUILT_IN_SCENE, scene::schema(), 50), (CASE, case::schema(), 6)] {
        let n = documented(text).len();
        assert!(n >= n_least, "{n} documented ranges");
        assert_eq!(mismatches(text, schema.as_value()), [""; 0]);
    }
}

#[test]
fn a_comment_with_another_range_is_found() {
    let text = "[objects.wedge.coarse]\nsubsteps = 1 # 1 to 17 implicit steps\n# divisions = [1, 1, 1] # 1 to 200\n";
    assert_eq!(mismatches(text, scene::schema().as_value()), ["objects.wedge.coarse.substeps: [1.0, 17.0]"]);
}

/// One number of each kind of place in a schema: arrays of arrays, tables by name, enums, lists of tables.
#[test]
fn a_number_is_found_wherever_it_stands() {
    let hull = "shape = { convex_hull = { points_m = [[0, 0, 0], [0, 0, 1], [0, 1, 0],\n[1, 0, nan]] } }";
    let shape = "shape = { capsule = { radius_m = 0.007, length_m = 0.1 } }";
    for (from, to, expected) in [
        (shape, hull, "tools.probe.shape.convex_hull.points_m.3.2: NaN is outside the allowed range -1000 to 1000"),
        ("approach = \"vertical\"", "approach = [0, 0, -inf]", "training.approach.2: -inf is outside"),
        ("min_m = [0.09,", "min_m = [2e3,", "evaluation.outside.0.contact_regions.0.min_m.0: 2000 is outside"),
        ("# cpu = 1 ", "cpu = 0x400 ", "runtime.cpu: 1024 is outside the allowed range 0 to 1023; Core"),
    ] {
        let text = BUILT_IN_SCENE.replacen(from, to, 1);
        let message = Config::parse(Path::new("bad.toml"), &text).expect_err(to).to_string();
        assert!(message.contains(expected), "`{expected}` is not in: {message}");
    }
}
