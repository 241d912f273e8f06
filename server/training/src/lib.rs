//! The pre-computation phase of Plica: interactions, the tandem solve, and the database of examples.
//!
//! A [`Setup`] says as plain data what a scene is and what to train on it. [`run`] draws interactions from a seed, lets the
//! coarse model settle at each, ties the accurate model to its imprint, and leaves one [`Database`] in a job [`TrainingFolder`].
//! Interactions are solved in parallel, one thread each; a job that was ended goes on where it was, and its database is the
//! same, bit for bit.

mod accurate;
mod atomic_file;
mod canonical;
mod coarse;
mod database;
mod database_error;
mod error;
pub mod evaluation;
mod example;
mod farthest;
mod folder;
mod generate;
mod host;
mod interaction;
mod job_folder;
mod obstacle;
mod plan;
mod random;
mod recorded;
mod regular_file;
mod report;
mod sensitivity;
mod setup;
mod solve_info;
mod suction;
mod tandem;
mod tie_targets;
mod tool_path;
mod worth;

pub use accurate::{Accurate, AccurateFailure, AccurateResult, AccurateSize, Touch};
pub use atomic_file::{sync_folder, write_atomically, write_json_atomically};
pub use canonical::{fingerprint, hexadecimal, to_text};
pub use coarse::{Coarse, CoarseResult, Interrupted, Settling, SolveObserver};
pub use database::{
    About, CONTACT_POINT, Database, DatabaseKind, FORMAT, FORMAT_VERSION, MAX_DATABASE_BYTES, METADATA_KEY,
    SOLVER_VERSION, SceneLimits, TANDEM_VERSION, versions,
};
pub use database_error::DatabaseError;
pub use error::{BuildError, INTERRUPTED, PlanError, TrainingError};
pub use example::{Example, Outcome, Reason, Record, Rejection, SettlingRecord};
pub use folder::{TrainingFolder, TrainingJob, TrainingProgress, TrainingStage};
pub use generate::{Observer, run};
pub use host::{default_threads, now_unix_s};
pub use interaction::{Action, Interaction};
pub use job_folder::{JobPaths, MAX_RECORD_BYTES, Writer};
pub use plan::plan;
pub use random::GENERATOR;
pub use regular_file::{FileFault, RegularFile};
pub use report::{Guarded, Run, Solves, Spread, Summary, TrainingReport, largest, rms};
pub use sensitivity::{Difference, Force, Sensitivity, Variations, sensitivity};
pub use setup::{
    AccurateDescription, Approach, DriveOptions, FeatureScales, IN_REGION, InteractionSet, PressRanges, RecordedPose,
    Setup, Source,
};
pub use solve_info::{SMALLEST_JACOBIAN, SolveInfo};
pub use tandem::{CoarseHalf, Load, Stop, Tandem};
pub use tool_path::ToolPath;
pub use worth::{SkinDistance, Unguarded, Worth};
