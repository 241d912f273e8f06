//! Errors of training.

use std::io::ErrorKind;
use std::path::PathBuf;

use plica_accurate::{SolidError, SolveError};
use plica_geometry::{EmbeddingError, HullError};
use plica_sim::ModelError;

use crate::database_error::DatabaseError;

/// Why there are no interactions.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// No part of the skin lies in the region and faces the tool.
    #[error("set `{set}`: no part of the skin lies in its region and faces the tool")]
    NoSkin {
        /// The set.
        set: String,
    },
    /// No recorded pose touches the object.
    #[error("set `{set}`: none of {n_poses} recorded poses of its tool presses the object at rest")]
    NothingTouched {
        /// The set.
        set: String,
        /// Poses of its tool.
        n_poses: usize,
    },
    /// Every interaction was rejected.
    #[error("all {n} interactions were rejected; the first one: {first}")]
    AllRejected {
        /// How many.
        n: usize,
        /// Why the first one was.
        first: String,
    },
}

/// Why a model of the scene cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The coarse model.
    #[error("coarse model")]
    Coarse(#[from] ModelError),
    /// The accurate model.
    #[error("accurate model")]
    Accurate(#[from] SolidError),
    /// The accurate model's matrix.
    #[error("accurate model")]
    Solver(#[from] SolveError),
    /// The skin does not lie in the accurate mesh.
    #[error("accurate model")]
    Embedding(#[from] EmbeddingError),
    /// A tool has no volume.
    #[error("tool `{tool}`")]
    Tool {
        /// The tool.
        tool: String,
        /// Why.
        source: HullError,
    },
    /// The accurate model lacks a feature of the scene.
    #[error("the accurate model does not support {what}; remove them from the scene to train on it")]
    Unsupported {
        /// What.
        what: &'static str,
    },
}

/// Why a job has no result.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// No interactions.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// No model.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A file of the job cannot be written or read. Finished examples are kept.
    #[error("{path}: {error}{advice}", path = path.display(), advice = advice(error))]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// A file of the job is malformed or belongs to another job.
    #[error("{path}: {problem}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Problem and advice.
        problem: String,
    },
    /// An example of the job cannot be used or stored.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// Ended by the observer. Finished examples are kept.
    #[error("interrupted; finished examples are kept, the same command continues from there")]
    Interrupted,
    /// Threads cannot be started.
    #[error("{n_threads} threads cannot be started: {reason}")]
    Threads {
        /// How many.
        n_threads: usize,
        /// Error of the operating system.
        reason: String,
    },
}

/// Exit code of a process that ends with [`TrainingError::Interrupted`].
pub const INTERRUPTED: u8 = 75;

/// Advice for a full disk.
fn advice(error: &std::io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            "; make room and run the job again: finished examples are kept"
        }
        _ => "",
    }
}
