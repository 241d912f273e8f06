//! Tool motions in files: CSV of this project, and TUM trajectories of trackers and SLAM systems.
//!
//! * CSV: header `time_s,tool,px,py,pz,qx,qy,qz,qw` in any order; `time_ms`, `time_us`, `time_ns` for other units. The
//!   column `tool` may be missing, or empty: the only tool of the scene.
//! * TUM: `timestamp tx ty tz qx qy qz qw` without a header.
//!
//! Columns are separated by commas, semicolons, tabs or blanks; `#` or `%` starts a comment; a byte-order mark and line ends of
//! any system are read. Metres, quaternions `xyzw` unless [`ReadOptions`] says otherwise.
//!
//! Times have any origin and rise within each tool; the first pose plays at 0. Seconds, milliseconds, microseconds and
//! nanoseconds are told apart by a plausible rate. Rows that cannot be played (NaN, a tool out of sight, a time that repeats or
//! goes back) refuse the file, or are left out and counted: [`OnBadRow`].
//!
//! The crate knows no bus: the caller passes the [`Gate`] that checks poses.

mod error;
mod fit;
mod gate;
mod layout;
mod options;
mod order;
mod pose;
mod read;
mod report;
mod rows;
mod terrain;
mod time;
mod workspace;

pub use error::TrajectoryError;
pub use fit::{FIT_HELP, Fit, fit, fit_above, fitted_depth_m};
pub use gate::Gate;
pub use options::{OnBadRow, QuaternionOrder, ReadOptions};
pub use pose::TrackedPose;
pub use read::{Trajectory, read};
pub use report::{BadRow, MotionReport};
pub use terrain::Terrain;
pub use time::TimeUnit;
pub use workspace::Workspace;
