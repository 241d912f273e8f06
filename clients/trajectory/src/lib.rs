//! Tool motions in files: CSV of this project, and TUM trajectories of trackers and SLAM systems.
//!
//! * CSV: header `time_s,tool,px,py,pz,qx,qy,qz,qw`; times never decrease, and rise within one tool; an empty tool
//!   means the only tool of the scene.
//! * TUM: `timestamp tx ty tz qx qy qz qw`, separated by blanks, `#` starts a comment; times rise. The first
//!   timestamp becomes 0.
//!
//! A file whose name ends in `.csv`, or whose first line has commas, is CSV. Metres, quaternions `xyzw`. The crate knows
//! no bus: the caller passes the [`Gate`] that checks poses.

mod error;
mod fit;
mod pose;
mod read;
mod terrain;
mod workspace;

pub use error::TrajectoryError;
pub use fit::{FIT_HELP, Fit, fit, fit_above, fitted_depth_m};
pub use pose::{CSV_HEADER, TrackedPose};
pub use read::{Gate, read};
pub use terrain::Terrain;
pub use workspace::Workspace;
