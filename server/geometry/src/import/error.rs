//! Error of a mesh file: place, cause and advice.

use std::fmt;
use std::path::{Path, PathBuf};

pub(super) const CONVERT: &str =
    "convert it: `meshio convert FILE mesh.vtu` (Python), or save it from Gmsh or ParaView as .msh or .vtu";
pub(super) const DAMAGED: &str = "the file is damaged or incomplete: save it again";

/// Error of reading a mesh file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}{place}: {problem}; {advice}", path.display())]
pub struct ImportError {
    /// The file.
    pub path: PathBuf,
    /// Place in the file.
    pub place: Place,
    /// Cause, with numbers.
    pub problem: String,
    /// Advice.
    pub advice: String,
}

/// A place in a mesh file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A one-based line.
    Line(usize),
    /// An offset in bytes, in the binary part of a file.
    Byte(usize),
    /// A named array or section, with its first line if known.
    Field(String, Option<usize>),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) | Self::Field(_, Some(line)) => write!(f, ":{line}"),
            Self::Byte(byte) => write!(f, ", byte {byte}"),
            Self::Field(_, None) => Ok(()),
        }?;
        match self {
            Self::Field(name, _) => write!(f, ": {name}"),
            _ => Ok(()),
        }
    }
}

impl ImportError {
    pub(super) fn new(path: &Path, fault: Fault) -> Self {
        let Fault { place, problem, advice } = fault;
        Self { path: path.to_owned(), place, problem, advice }
    }
}

/// An [`ImportError`] without the path of its file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    place: Place,
    problem: String,
    advice: String,
}

impl Fault {
    pub(super) fn new(place: Place, problem: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { place, problem: problem.into(), advice: advice.into() }
    }
}

pub(super) fn fault<T>(place: Place, problem: impl Into<String>, advice: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::new(place, problem, advice))
}
