//! Text of a scene or case file with the positions of its keys, so that errors found after parsing can name a line.

use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::ConfigError;

/// Text of a file, its name, and the position of each key.
#[derive(Debug)]
pub struct Document {
    file: PathBuf,
    text: String,
    entries: Vec<Entry>,
}

/// One key or array element.
#[derive(Debug)]
struct Entry {
    /// Dotted path; array elements as numbers.
    path: String,
    /// Keys and array indices of the path.
    steps: Vec<String>,
    /// Bytes of the key's name, or of the element.
    name: Range<usize>,
    /// Bytes of the value.
    value: Range<usize>,
    /// The value, if it is a number.
    number: Option<f64>,
}

impl Document {
    /// Parses `text` as TOML. `file` is used in messages and to resolve relative paths.
    pub fn parse(file: &Path, text: &str) -> Result<Self, ConfigError> {
        let table = DeTable::parse(text).map_err(|e| syntax_error(file, text, &e))?;
        let mut entries = Vec::new();
        list_table(table.get_ref(), &[], &mut entries);
        entries.sort_by_key(|entry| entry.value.start);
        Ok(Self { file: file.to_owned(), text: text.to_owned(), entries })
    }

    /// Name of the file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Deserialises the document; a wrong type or an unknown key is an error with line and key.
    pub fn read<T: serde::de::DeserializeOwned>(&self) -> Result<T, ConfigError> {
        toml::from_str(&self.text).map_err(|e| {
            let offset = e.span().map(|s| s.start);
            ConfigError {
                file: self.file.clone(),
                line: offset.map(|o| line_of(&self.text, o)),
                key: offset.map(|o| self.key_at(o)).unwrap_or_default(),
                problem: e.message().trim().replace('\n', ", "),
                advice: "`plicad schema` lists every key with its meaning, unit and range".into(),
            }
        })
    }

    /// Every number with its path (keys and array indices), in the order of the file.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = (&[String], f64)> {
        self.entries.iter().filter_map(|entry| Some((entry.steps.as_slice(), entry.number?)))
    }

    /// An error about `key` (dotted path; array elements as numbers).
    pub fn error(&self, key: &str, problem: impl Into<String>, advice: impl Into<String>) -> ConfigError {
        ConfigError {
            file: self.file.clone(),
            line: self.line_of_key(key),
            key: key.to_owned(),
            problem: problem.into(),
            advice: advice.into(),
        }
    }

    /// Line of `key`, or of its nearest parent that the file holds.
    fn line_of_key(&self, key: &str) -> Option<usize> {
        let holds =
            |e: &&Entry| key.strip_prefix(e.path.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        let nearest = self.entries.iter().filter(holds).max_by_key(|e| e.path.len())?;
        Some(line_of(&self.text, nearest.name.start))
    }

    /// Path of the innermost key whose name or value covers the byte `offset`.
    fn key_at(&self, offset: usize) -> String {
        let covers = |e: &&Entry| e.name.contains(&offset) || e.value.contains(&offset);
        self.entries.iter().filter(covers).max_by_key(|e| e.path.len()).map(|e| e.path.clone()).unwrap_or_default()
    }
}

fn list_table(table: &DeTable<'_>, parent: &[String], entries: &mut Vec<Entry>) {
    for (key, value) in table {
        list_value(key.get_ref(), key.span(), value, parent, entries);
    }
}

fn list_value(
    key: &str,
    name: Range<usize>,
    value: &Spanned<DeValue<'_>>,
    parent: &[String],
    entries: &mut Vec<Entry>,
) {
    let steps = [parent, &[key.to_owned()]].concat();
    match value.get_ref() {
        DeValue::Table(table) => list_table(table, &steps, entries),
        DeValue::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                list_value(&i.to_string(), item.span(), item, &steps, entries);
            }
        }
        _ => {}
    }
    entries.push(Entry { path: steps.join("."), steps, name, value: value.span(), number: number(value.get_ref()) });
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(n) => i128::from_str_radix(n.as_str(), n.radix()).ok().map(|n| n as f64),
        DeValue::Float(x) => x.as_str().parse().ok(),
        _ => None,
    }
}

fn syntax_error(file: &Path, text: &str, e: &toml::de::Error) -> ConfigError {
    ConfigError {
        file: file.to_owned(),
        line: e.span().map(|s| line_of(text, s.start)),
        key: String::new(),
        problem: format!("not valid TOML: {}", e.message().trim().replace('\n', ", ")),
        advice: "see https://toml.io for the syntax, configs/scenes/wedge.toml for a complete scene".into(),
    }
}

/// One-based line of a byte offset.
fn line_of(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|b| **b == b'\n').count()
}
