//! What is wrong with a scene file, told once and completely.

use std::fmt;
use std::path::PathBuf;

/// One thing wrong with a scene file: where, which key, what, and what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigError {
    /// File.
    pub file: PathBuf,
    /// One-based line, where it is known.
    pub line: Option<usize>,
    /// Dotted path of the key; empty for a syntax error.
    pub key: String,
    /// What is wrong, with the allowed range where there is one.
    pub problem: String,
    /// What to do.
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
