//! The status message: JSON, at 2 Hz and on request.
//!
//! Maps are ordered, so that the same state gives the same bytes. A reader fills what it misses with defaults and
//! ignores what it does not know.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::jobs::JobStatus;

/// Counters by kind of event.
pub type Counters = BTreeMap<String, u64>;

/// Names of the stages of a tick, in the order in which a tick runs them.
pub const STAGES: [&str; 6] = ["poses", "contact", "solve", "embedding", "gates", "enrichment"];

/// Counter of a tool: a pose was good, but too many were waiting for the next tick.
pub const QUEUE_FULL: &str = "queue_full";
/// Counter of the daemon: a question got no answer, because too many answers were waiting.
pub const REPLY_DROPPED: &str = "reply_dropped";
/// Counter of the daemon: a skin frame was not published, because it was not finite.
pub const FRAME_REFUSED: &str = "frame_refused";
/// Counter of the daemon: another daemon answered for the same session.
pub const OTHER_DAEMON: &str = "other_daemon";

/// What the daemon says about itself.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Status {
    /// Versions of programs and formats: `plicad`, `protocol`, `zenoh`, ...
    pub versions: BTreeMap<String, String>,
    /// Session name of the keys.
    pub session: String,
    /// Name of the scene.
    pub scene: String,
    /// Seconds since the daemon started.
    pub uptime_s: f64,
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time in seconds.
    pub sim_time_s: f64,
    /// Whether the simulation's clock stands.
    pub paused: bool,
    /// What the operating system granted to the simulation thread.
    pub realtime: Realtime,
    /// Duration of a whole tick in microseconds.
    pub tick_us: Distribution,
    /// Duration of each stage of a tick in microseconds.
    pub stages: BTreeMap<String, Distribution>,
    /// How late the simulation thread woke up, in microseconds.
    pub lateness_us: Distribution,
    /// Ticks that ended after the next one was due.
    pub overruns: u64,
    /// Ticks given up because catching up is bounded.
    pub skipped_ticks: u64,
    /// Objects by name.
    pub objects: BTreeMap<String, ObjectStatus>,
    /// Tools by name.
    pub tools: BTreeMap<String, ToolStatus>,
    /// Rejected input that belongs to no tool of the scene, by kind.
    pub rejected: Counters,
    /// Messages that were made but not sent.
    pub drops: Drops,
    /// The newest [`crate::jobs::MAX_IN_STATUS`] jobs, oldest first.
    pub jobs: Vec<JobStatus>,
    /// Why the daemon takes no jobs; null if it does.
    pub jobs_unavailable: Option<String>,
}

/// What the operating system granted to the simulation thread.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Realtime {
    /// Class of the simulation thread.
    pub scheduling: Scheduling,
    /// Whether its memory is locked.
    pub memory_locked: bool,
    /// Timer slack in nanoseconds; 0 if unknown.
    pub timer_slack_ns: u64,
    /// Sentences on what was refused and what that means.
    pub warnings: Vec<String>,
}

/// Scheduling class of the simulation thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scheduling {
    /// SCHED_FIFO.
    Fifo,
    /// The fallback.
    #[default]
    Normal,
}

impl Scheduling {
    /// Name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fifo => "fifo",
            Self::Normal => "normal",
        }
    }
}

/// Summary of a histogram.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Distribution {
    /// Number of samples.
    pub count: u64,
    /// Least.
    pub min: f64,
    /// Median.
    pub p50: f64,
    /// 90th percentile.
    pub p90: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// Greatest.
    pub max: f64,
}

/// One object.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ObjectStatus {
    /// Vertices of the skin.
    pub n_vertices: u32,
    /// Triangles of the skin.
    pub n_triangles: u32,
    /// Whether it is at rest and not solved.
    pub sleeping: bool,
    /// Whether detail is being added.
    pub enriched: bool,
    /// Times that a non-finite state was rolled back.
    pub rollbacks: u64,
    /// Counts activations of examples; 0: none are active.
    pub database_generation: u32,
    /// Least confidence over the tools in contact; null without enrichment.
    pub confidence: Option<f64>,
    /// Frames handed to the bus.
    pub frames_published: u64,
    /// Deepest penetration since reset in metres.
    pub max_penetration_m: f64,
    /// Contacts found and left out since reset, a tick at a time, because a tool or plane had its `max_contacts`.
    pub dropped_contacts: u64,
    /// The implicit solve.
    pub solver: SolverStatus,
}

/// The implicit solve of an object.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SolverStatus {
    /// Iterations of the last tick.
    pub iterations: u64,
    /// Ticks since reset that needed the fall-back.
    pub fallbacks: u64,
}

/// One tool.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ToolStatus {
    /// Sequence of the newest accepted pose.
    pub pose_sequence: u64,
    /// Simulated seconds since it arrived; null before the first.
    pub pose_age_s: Option<f64>,
    /// Whether poses have stopped and the tool is held.
    pub stale: bool,
    /// Age of the newest pose at which the tool is stale and another source takes over, in simulated milliseconds.
    pub stale_after_ms: f64,
    /// How it follows its poses: `latest` or `interpolate`.
    pub sampling: String,
    /// Whether it touches something.
    pub in_contact: bool,
    /// Number of active contacts.
    pub n_contacts: u32,
    /// Force on the tool in newtons, world frame.
    pub force_n: [f64; 3],
    /// Largest change of that force from tick to tick within the last second of simulated time, in newtons.
    pub force_step_n: f64,
    /// Whether the coupling is at its limit.
    pub saturated: bool,
    /// Times that the tool was placed anew without a sweep, because the device jumped.
    pub placements: u64,
    /// Poses that were used.
    pub poses_accepted: u64,
    /// Poses that were not, by kind.
    pub poses_rejected: Counters,
}

/// Messages that were made but not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Drops {
    /// Wrenches.
    pub wrenches: u64,
    /// Skin frames.
    pub frames: u64,
}
