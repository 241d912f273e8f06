//! Tool motions in files: CSV of this project, and TUM trajectories as trackers and SLAM systems write them.
//!
//! * CSV: header `time_s,tool,px,py,pz,qx,qy,qz,qw`; times never decrease, and rise within one tool; an empty tool
//!   means the only tool of the scene.
//! * TUM: `timestamp tx ty tz qx qy qz qw`, parted by blanks, `#` starts a comment; times rise. The first
//!   timestamp becomes 0.
//!
//! A file whose name ends in `.csv`, or whose first line has commas, is CSV. Metres, quaternions `xyzw`, which are
//! normalised as poses on the bus are. Needs no bus.

mod fit;
mod read;
mod terrain;

use std::path::PathBuf;

use thiserror::Error;

pub use fit::{Fit, Workspace, fit, fit_above, fitted_depth_m};
pub use read::read;
pub use terrain::Terrain;

/// The header of a CSV trajectory.
pub const CSV_HEADER: [&str; 9] = ["time_s", "tool", "px", "py", "pz", "qx", "qy", "qz", "qw"];

/// Where a tool was at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedPose {
    /// Time in seconds.
    pub time_s: f64,
    /// Name of the tool; None for a file that names none.
    pub tool: Option<String>,
    /// Position in metres.
    pub position_m: [f64; 3],
    /// Unit quaternion `x y z w`.
    pub orientation_xyzw: [f64; 4],
}

/// Why a trajectory cannot be used.
#[derive(Debug, Error)]
pub enum TrajectoryError {
    /// The file cannot be read.
    #[error("{}: cannot be read", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A line that is not what it should be.
    #[error("{}:{line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, from 1 on.
        line: u64,
        /// What is wrong.
        message: String,
    },
    /// No pose in it.
    #[error("{}: no poses in it", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A workspace without room.
    #[error("workspace from {min_m:?} to {max_m:?} m has no room: each min must be below its max, all finite")]
    Workspace {
        /// Lower corner.
        min_m: [f64; 3],
        /// Upper corner.
        max_m: [f64; 3],
    },
}
