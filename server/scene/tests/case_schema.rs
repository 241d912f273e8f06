//! The JSON Schema of case files: all examples conform, and what a case refuses does not.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::path::{Path, PathBuf};

use serde_json::Value;

fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/cases");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files.filter(|file| file.extension().is_some_and(|ending| ending == "toml")).collect()
}

fn value_of(text: &str) -> Value {
    serde_json::to_value(toml::from_str::<toml::Value>(text).unwrap()).unwrap()
}

/// First breach of the words of JSON Schema that the schema of cases has; any other word is a breach itself.
fn breach(root: &Value, schema: &Value, value: &Value, place: &str) -> Option<String> {
    let Some(words) = schema.as_object() else {
        return (schema == &Value::Bool(false)).then(|| format!("{place}: not allowed"));
    };
    words.iter().find_map(|(word, rule)| {
        let at = |step: &str| format!("{place}.{step}");
        let first_of = |mut results: Vec<Option<String>>| -> Option<String> {
            results.retain(Option::is_some);
            results.into_iter().next().flatten()
        };
        let fails = |holds: bool| (!holds).then(|| format!("{place}: {word} {rule} does not hold for {value}"));
        let length = value.as_array().map(|items| items.len() as u64);
        match word.as_str() {
            "$schema" | "$defs" | "title" | "description" | "default" | "format" => None,
            "$ref" => breach(root, root.pointer(rule.as_str()?.strip_prefix('#')?).unwrap(), value, place),
            "type" => {
                let allowed: Vec<&str> = match rule {
                    Value::Array(kinds) => kinds.iter().filter_map(Value::as_str).collect(),
                    kind => vec![kind.as_str()?],
                };
                fails(allowed.iter().any(|kind| is_of(kind, value)))
            }
            "const" => fails(rule == value),
            "enum" => fails(rule.as_array().unwrap().contains(value)),
            "minimum" => fails(value.as_f64().is_none_or(|v| v >= rule.as_f64().unwrap())),
            "maximum" => fails(value.as_f64().is_none_or(|v| v <= rule.as_f64().unwrap())),
            "minItems" => fails(length.is_none_or(|n| n >= rule.as_u64().unwrap())),
            "maxItems" => fails(length.is_none_or(|n| n <= rule.as_u64().unwrap())),
            "required" => {
                let names = rule.as_array().unwrap().iter().filter_map(Value::as_str);
                fails(value.as_object().is_none_or(|keys| names.clone().all(|name| keys.contains_key(name))))
            }
            "items" => {
                let items = value.as_array().into_iter().flatten().enumerate();
                first_of(items.map(|(i, item)| breach(root, rule, item, &at(&i.to_string()))).collect())
            }
            "properties" => {
                let keys = value.as_object().into_iter().flatten();
                let rules = rule.as_object().unwrap();
                first_of(keys.map(|(key, v)| rules.get(key).and_then(|rule| breach(root, rule, v, &at(key)))).collect())
            }
            "additionalProperties" => {
                let known = |key: &str| words.get("properties").is_some_and(|known| known.get(key).is_some());
                let others = value.as_object().into_iter().flatten().filter(|(key, _)| !known(key));
                first_of(others.map(|(key, v)| breach(root, rule, v, &at(key))).collect())
            }
            "anyOf" => {
                let results: Vec<_> =
                    rule.as_array().unwrap().iter().map(|choice| breach(root, choice, value, place)).collect();
                if results.iter().any(Option::is_none) { None } else { first_of(results) }
            }
            "oneOf" => {
                let results = rule.as_array().unwrap().iter().map(|choice| breach(root, choice, value, place));
                fails(results.filter(Option::is_none).count() == 1)
            }
            other => Some(format!("{place}: the validator of this test does not know `{other}`")),
        }
    })
}

fn is_of(kind: &str, value: &Value) -> bool {
    match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        _ => false,
    }
}

#[test]
fn the_examples_conform() {
    let schema = plica_scene::case::schema().as_value();
    let examples = examples();
    assert!(examples.len() >= 10, "{examples:?}");
    for file in examples {
        let found = breach(schema, schema, &value_of(&std::fs::read_to_string(&file).unwrap()), "case");
        assert_eq!(found, None, "{}", file.display());
    }
}

#[test]
fn what_a_case_refuses_does_not_conform() {
    let schema = plica_scene::case::schema().as_value();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/cases/torsion.toml");
    let text = std::fs::read_to_string(file).unwrap();
    for (from, to, place) in [
        ("angle_deg = 0.1", "angle_deg = 4000", "angle_deg"),
        ("angle_deg = 0.1", "angle = 0.1", "turn"),
        ("model = \"linear\"", "model = \"rubber\"", "model"),
        ("generator = \"block\"", "generator = 3", "generator"),
        ("divisions = [8, 16, 16]", "divisions = [8, 16]", "divisions"),
        ("[material]", "[materials]", "case"),
    ] {
        assert!(text.contains(from), "{from}");
        let found = breach(schema, schema, &value_of(&text.replacen(from, to, 1)), "case");
        assert!(found.as_ref().is_some_and(|found| found.contains(place)), "{to}: {found:?}");
    }
}
