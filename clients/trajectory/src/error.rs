//! Errors of trajectories.

use std::path::PathBuf;

use thiserror::Error;

/// Why a trajectory cannot be used.
#[derive(Debug, Error)]
pub enum TrajectoryError {
    /// The file cannot be read.
    #[error("{}: cannot be read", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A malformed line.
    #[error("{}:{line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, from 1 on.
        line: u64,
        /// What is wrong.
        message: String,
    },
    /// Times in a unit that cannot be told.
    #[error("{}: {message}", path.display())]
    TimeUnit {
        /// The file.
        path: PathBuf,
        /// What fits, and how to say it.
        message: String,
    },
    /// A file without poses.
    #[error("{}: the file has no poses", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// An empty workspace.
    #[error("workspace from {min_m:?} to {max_m:?} m has no room: each min must be below its max, all finite")]
    Workspace {
        /// Lower corner.
        min_m: [f64; 3],
        /// Upper corner.
        max_m: [f64; 3],
    },
}
