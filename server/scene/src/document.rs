//! Text of a scene or case file with the positions of its keys, so that errors found after parsing can name a line.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

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
    place: Arc<Place>,
    /// Bytes of the key's name, or of the element.
    name: Range<usize>,
    /// Bytes of the value.
    value: Range<usize>,
    /// The value, if it is a number.
    number: Option<f64>,
}

/// Key or array index, below its parent. Shared by all below, so that a deep and wide text takes no more memory than a flat
/// one.
#[derive(Debug)]
struct Place {
    parent: Option<Arc<Place>>,
    step: String,
}

impl Place {
    fn below(parent: Option<&Arc<Self>>, step: &str) -> Arc<Self> {
        Arc::new(Self { parent: parent.cloned(), step: step.to_owned() })
    }

    /// Keys and array indices from the top.
    fn steps(&self) -> Vec<&str> {
        let chain = std::iter::successors(Some(self), |place| place.parent.as_deref());
        let mut steps: Vec<&str> = chain.map(|place| place.step.as_str()).collect();
        steps.reverse();
        steps
    }

    /// Dotted path; array elements as numbers.
    fn path(&self) -> String {
        self.steps().join(".")
    }
}

impl Document {
    /// Parses `text` as TOML. `file` is used in messages and to resolve relative paths.
    pub fn parse(file: &Path, text: &str) -> Result<Self, ConfigError> {
        let table = DeTable::parse(text).map_err(|e| syntax_error(file, text, &e))?;
        let mut entries = Vec::new();
        list_table(table.get_ref(), None, &mut entries);
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
    pub(crate) fn numbers(&self) -> impl Iterator<Item = (Vec<&str>, f64)> {
        self.entries.iter().filter_map(|entry| Some((entry.place.steps(), entry.number?)))
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
        let held = |e: &Entry| {
            let path = e.place.path();
            let holds = key.strip_prefix(path.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
            holds.then_some((path.len(), e.name.start))
        };
        let (_, start) = self.entries.iter().filter_map(held).max_by_key(|(length, _)| *length)?;
        Some(line_of(&self.text, start))
    }

    /// Path of the innermost key whose name or value covers the byte `offset`.
    fn key_at(&self, offset: usize) -> String {
        let covers = |e: &&Entry| e.name.contains(&offset) || e.value.contains(&offset);
        let paths = self.entries.iter().filter(covers).map(|e| e.place.path());
        paths.max_by_key(String::len).unwrap_or_default()
    }
}

fn list_table(table: &DeTable<'_>, parent: Option<&Arc<Place>>, entries: &mut Vec<Entry>) {
    for (key, value) in table {
        list_value(key.get_ref(), key.span(), value, parent, entries);
    }
}

fn list_value(
    key: &str,
    name: Range<usize>,
    value: &Spanned<DeValue<'_>>,
    parent: Option<&Arc<Place>>,
    entries: &mut Vec<Entry>,
) {
    let place = Place::below(parent, key);
    match value.get_ref() {
        DeValue::Table(table) => list_table(table, Some(&place), entries),
        DeValue::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                list_value(&i.to_string(), item.span(), item, Some(&place), entries);
            }
        }
        _ => {}
    }
    entries.push(Entry { place, name, value: value.span(), number: number(value.get_ref()) });
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
