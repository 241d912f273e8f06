//! Error of a scene or case file: place, problem and advice.

use std::fmt;
use std::path::PathBuf;

/// Error of a scene or case file, with file, line, key, problem and advice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigError {
    /// File.
    pub file: PathBuf,
    /// One-based line, where it is known.
    pub line: Option<usize>,
    /// Dotted path of the key; empty for a syntax error.
    pub key: String,
    /// Problem, with the allowed range if there is one.
    pub problem: String,
    /// Advice.
    pub advice: String,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}; {}", self.problem, self.advice)
    }
}

impl std::error::Error for ConfigError {}
