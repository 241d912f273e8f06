//! Why a file is no database of examples.

use std::path::PathBuf;

use crate::regular_file::FileFault;

/// Why a file is no database that can be used.
#[derive(Debug, thiserror::Error)]
pub enum DatabaseError {
    /// It is no regular file, cannot be read, or is too large.
    #[error("{path}: {fault}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        fault: FileFault,
    },
    /// It cannot be written.
    #[error("{path}: {error}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// It is cut off, or no safetensors file.
    #[error("{path}: truncated, or not a safetensors file: {problem}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// It is a safetensors file of something else.
    #[error("{path}: not an example database: {problem}", path = path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What is missing.
        problem: String,
    },
    /// It was written by another version.
    #[error("{path}: {what} version {found}, this program reads {known}; train again", path = path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Of what.
        what: String,
        /// The file's.
        found: String,
        /// The program's.
        known: u32,
    },
    /// It belongs to another scene.
    #[error(
        "{path}: belongs to another scene (hash {found:.12}..., this scene has {expected:.12}...): object, materials, \
         coarse or accurate model, friction, tie or tool differ; train again",
        path = path.display()
    )]
    OtherScene {
        /// The file.
        path: PathBuf,
        /// The file's.
        found: String,
        /// The scene's.
        expected: String,
    },
    /// Bytes have changed since it was written.
    #[error("{path}: damaged: SHA-256 is {found:.12}..., the file says {expected:.12}...", path = path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Of the bytes.
        found: String,
        /// What the file says.
        expected: String,
    },
    /// Tensors and metadata do not fit each other.
    #[error("{path}: inconsistent: {problem}", path = path.display())]
    Inconsistent {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}
