//! Ranges of numbers. Each range is written once, as an attribute of the key in the raw type; the JSON Schema of that type
//! carries it as `minimum` and `maximum`, with which every number of a document is compared here.

use serde_json::Value;

use crate::document::Document;
use crate::error::ConfigError;

/// Allowed numbers of a key, and its meaning.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Range {
    /// Least allowed number.
    pub(crate) least: f64,
    /// Largest allowed number.
    pub(crate) most: f64,
    /// First line of the key's documentation.
    pub(crate) meaning: String,
}

impl Range {
    /// Whether `value` is allowed; false for numbers that are not finite.
    pub(crate) fn contains(&self, value: f64) -> bool {
        (self.least..=self.most).contains(&value)
    }
}

/// Refuses the first number of `document` outside the range that `schema` gives its key.
pub(crate) fn check(document: &Document, schema: &Value) -> Result<(), ConfigError> {
    for (path, value) in document.numbers() {
        if let Some(range) = range(schema, &path).filter(|range| !range.contains(value)) {
            let problem = format!("{value} is outside the allowed range {} to {}", range.least, range.most);
            return Err(document.error(&path.join("."), problem, range.meaning));
        }
    }
    Ok(())
}

/// Range of the number at `path` (keys and array indices); `None` where the schema gives none.
pub(crate) fn range(schema: &Value, path: &[impl AsRef<str>]) -> Option<Range> {
    descend(schema, schema, path, "")
}

/// `meaning` is the documentation of the innermost key above `node`, since elements of arrays have none.
fn descend(root: &Value, node: &Value, path: &[impl AsRef<str>], meaning: &str) -> Option<Range> {
    let meaning = node["description"].as_str().unwrap_or(meaning);
    let here = path.is_empty().then(|| own_range(node, meaning)).flatten();
    let below =
        || path.split_first().and_then(|(step, rest)| descend(root, child(node, step.as_ref())?, rest, meaning));
    let target = || descend(root, root.pointer(node["$ref"].as_str()?.strip_prefix('#')?)?, path, meaning);
    let choice = || choices(node).find_map(|choice| descend(root, choice, path, meaning));
    here.or_else(below).or_else(target).or_else(choice)
}

fn own_range(node: &Value, meaning: &str) -> Option<Range> {
    let meaning = meaning.lines().next().unwrap_or_default().trim_end_matches('.').to_owned();
    Some(Range { least: node["minimum"].as_f64()?, most: node["maximum"].as_f64()?, meaning })
}

/// Schema of a key of a table, of any name in a table by names, or of an array's elements.
fn child<'a>(node: &'a Value, step: &str) -> Option<&'a Value> {
    let element = || node.get("items").filter(|_| step.parse::<usize>().is_ok());
    let named = || node.get("additionalProperties").filter(|names| names.is_object());
    node["properties"].get(step).or_else(named).or_else(element)
}

/// Alternatives of an enum or an optional key.
fn choices(node: &Value) -> impl Iterator<Item = &Value> {
    ["oneOf", "anyOf", "allOf"].into_iter().filter_map(|word| node[word].as_array()).flatten()
}

#[cfg(test)]
mod tests;
