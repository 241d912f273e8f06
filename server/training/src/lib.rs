//! The pre-computation phase of Plica: interactions, the tandem solve, and the database of examples.
//!
//! A [`Setup`] says as plain data what a scene is and what to train on it. [`run`] draws interactions from a seed, lets the
//! coarse model settle at each, ties the accurate model to its imprint, and leaves one [`Database`] in a job [`Folder`].
//! Interactions are solved in parallel, one thread each; a job that was ended goes on where it was, and its database is the
//! same, bit for bit.

mod accurate;
mod atomic_file;
mod band;
mod canonical;
mod coarse;
mod database;
mod error;
pub mod evaluation;
mod example;
mod examples_of;
mod farthest;
mod folder;
mod generate;
mod host;
mod interaction;
mod job_folder;
mod lift;
mod obstacle;
mod plan;
mod random;
mod recorded;
mod report;
mod sensitivity;
mod setup;
mod tandem;
mod way;

pub use accurate::{Accurate, AccurateFailure, AccurateResult, SolveInfo};
pub use atomic_file::{sync_folder, write_atomically, write_json_atomically};
pub use canonical::{fingerprint, hexadecimal, to_text};
pub use coarse::{Cancelled, Coarse, CoarseResult, Interrupted, Settling};
pub use database::{
    About, CONTACT_POINT, Database, DatabaseError, FORMAT, FORMAT_VERSION, JobKind, METADATA_KEY, SOLVER_VERSION,
    TANDEM_VERSION, versions,
};
pub use error::{BuildError, INTERRUPTED, PlanError, TrainingError};
pub use example::{Example, Outcome, Reason, Record, Rejection, SettlingRecord};
pub use folder::{Folder, Job, Progress, Stage};
pub use generate::{Watch, run};
pub use host::{default_threads, now_unix_s};
pub use interaction::{Action, Interaction};
pub use job_folder::{JobPaths, Writer};
pub use plan::plan;
pub use random::GENERATOR;
pub use report::{Report, Run, Solves, Spread, Summary, largest, rms};
pub use sensitivity::{Difference, Force, Sensitivity, Variations, sensitivity};
pub use setup::{
    AccurateDescription, Approach, DriveOptions, FeatureScales, InteractionSet, PressRanges, RecordedPose, Setup,
    Source,
};
pub use tandem::{CoarseHalf, Load, SMALLEST_JACOBIAN, Stop, Tandem};
pub use way::Way;
