//! Methods under `rpc/<method>`: JSON in, JSON out.
//!
//! An empty payload counts as `{}`. Unknown keys are errors, so that a misspelt key does not become a silent default.

use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::DecodeError;
use crate::object::{self, from_object};
use crate::pose::{JsonPose, Pose, yes};

/// Most ticks of one `step`.
pub const MAX_STEP_TICKS: u32 = 10_000;
/// Most poses of one `step`.
pub const MAX_STEP_POSES: usize = 1024;
/// Snapshots that are kept; the oldest is overwritten.
pub const MAX_SNAPSHOTS: u64 = 8;
/// Time from the arrival of a request after which a `step` stops early and a request that still waits is refused. Shorter than
/// the time-out of a client, so that no client is left without an answer.
pub const ANSWER_WITHIN: Duration = Duration::from_secs(4);

/// Methods of a daemon.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// Returns to the rest state and tick 0; tools are unplaced, pose order is forgotten. Request `{}`, reply [`StateReply`].
    Reset,
    /// Stops the clock of the simulation. Request `{}`, reply [`StateReply`].
    Pause,
    /// Starts the clock again. Request `{}`, reply [`StateReply`].
    Resume,
    /// Runs ticks while paused. Request [`StepRequest`], reply [`StepReply`].
    Step,
    /// Ends the `step` that runs, after its present tick. Request `{}`, reply [`StateReply`].
    Interrupt,
    /// Stores the present state. Request `{}`, reply [`SnapshotReply`].
    Snapshot,
    /// Returns to a stored state. Request [`RestoreRequest`], reply [`StateReply`].
    Restore,
    /// Queues a job. Request [`crate::jobs::JobSubmitRequest`], reply [`crate::jobs::JobSubmitReply`].
    JobSubmit,
    /// Lists all jobs. Request `{}`, reply [`crate::jobs::JobListReply`].
    JobList,
    /// Returns one job. Request [`crate::jobs::JobRequest`], reply [`crate::jobs::Job`].
    JobGet,
    /// Cancels a queued or running job. Request [`crate::jobs::JobRequest`], reply [`crate::jobs::Job`].
    JobCancel,
    /// Queues a failed, cancelled or paused job again. Request [`crate::jobs::JobRequest`], reply [`crate::jobs::Job`].
    JobResume,
    /// Returns a result in chunks. Request [`crate::jobs::JobFetchRequest`], reply bytes with a [`crate::chunk::ChunkHeader`].
    JobFetch,
    /// Activates other examples for enrichment. Request [`ActivateRequest`], reply [`ActivateReply`].
    Activate,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 14] = [
        Self::Reset,
        Self::Pause,
        Self::Resume,
        Self::Step,
        Self::Interrupt,
        Self::Snapshot,
        Self::Restore,
        Self::JobSubmit,
        Self::JobList,
        Self::JobGet,
        Self::JobCancel,
        Self::JobResume,
        Self::JobFetch,
        Self::Activate,
    ];

    /// Last part of the key.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reset => "reset",
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Step => "step",
            Self::Interrupt => "interrupt",
            Self::Snapshot => "snapshot",
            Self::Restore => "restore",
            Self::JobSubmit => "job_submit",
            Self::JobList => "job_list",
            Self::JobGet => "job_get",
            Self::JobCancel => "job_cancel",
            Self::JobResume => "job_resume",
            Self::JobFetch => "job_fetch",
            Self::Activate => "activate",
        }
    }

    /// Whether the method concerns jobs, not the simulation.
    pub fn is_about_jobs(self) -> bool {
        self.name().starts_with("job_")
    }

    /// Method with a name. Errors with `rpc_unknown`.
    pub fn parse(name: &str) -> Result<Self, ErrorReply> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            ErrorReply::new(ErrorCode::RpcUnknown, format!("no method `{name}`; there are {known}"))
        })
    }
}

/// Decodes a request, which is a JSON object. Errors with `rpc_malformed`.
pub fn decode_request<T: DeserializeOwned>(payload: &[u8]) -> Result<T, ErrorReply> {
    let payload = if payload.is_empty() { b"{}" } else { payload };
    from_object(payload).map_err(|error| ErrorReply::new(ErrorCode::RpcMalformed, error.to_string()))
}

/// Request of a method without arguments, `{}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmptyRequest {}

/// Lock-step: applies the poses in order, then runs the ticks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepRequest {
    /// Number of ticks, 0 to [`MAX_STEP_TICKS`].
    pub ticks: u32,
    /// Poses to apply before the first tick, at most [`MAX_STEP_POSES`].
    #[serde(default, deserialize_with = "object::list")]
    pub poses: Vec<StepPose>,
    /// Tick at which the simulation must be, else the step is refused with `wrong_tick`. Makes repeating a step harmless.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_tick: Option<u64>,
}

impl StepRequest {
    /// Checks counts. Errors with `rpc_malformed`.
    pub fn check(&self) -> Result<(), ErrorReply> {
        let malformed = |message| Err(ErrorReply::new(ErrorCode::RpcMalformed, message));
        if self.ticks > MAX_STEP_TICKS {
            return malformed(format!("ticks is {}; the allowed range is 0 to {MAX_STEP_TICKS}", self.ticks));
        }
        if self.poses.len() > MAX_STEP_POSES {
            return malformed(format!("{} poses; at most {MAX_STEP_POSES} fit into one step", self.poses.len()));
        }
        Ok(())
    }
}

/// Pose of a named tool: `{"tool": name, ...}` with the keys of the JSON pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepPose {
    /// Name of the tool.
    pub tool: String,
    /// See [`Pose::sequence`].
    #[serde(default)]
    pub sequence: u64,
    /// See [`Pose::source_time_ns`].
    #[serde(default)]
    pub source_time_ns: u64,
    /// See [`Pose::source_id`].
    #[serde(default)]
    pub source_id: u32,
    /// See [`Pose::valid`]; true if left out.
    #[serde(default = "yes")]
    pub valid: bool,
    /// Position in metres.
    pub position: [f64; 3],
    /// Quaternion `x y z w`.
    pub orientation: [f64; 4],
    /// See [`Pose::buttons`].
    #[serde(default)]
    pub buttons: u32,
    /// See [`Pose::grip`].
    #[serde(default)]
    pub grip: f32,
}

impl StepPose {
    /// A pose for a tool.
    pub fn new(tool: &str, pose: &Pose) -> Self {
        let JsonPose { sequence, source_time_ns, source_id, valid, position, orientation, buttons, grip } = pose.into();
        let tool = tool.to_owned();
        Self { tool, sequence, source_time_ns, source_id, valid, position, orientation, buttons, grip }
    }

    /// Applies the gate of [`Pose::checked_for`].
    pub fn to_pose(&self, position_scale: f64) -> Result<Pose, DecodeError> {
        let Self { sequence, source_time_ns, source_id, valid, position, orientation, buttons, grip, .. } = *self;
        JsonPose { sequence, source_time_ns, source_id, valid, position, orientation, buttons, grip }
            .to_pose(position_scale)
    }
}

/// Request of `restore`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RestoreRequest {
    /// Id that `snapshot` returned.
    pub id: String,
}

impl RestoreRequest {
    /// Number of the snapshot; `None` if the text is not exactly an id that `snapshot` can have returned.
    pub fn number(&self) -> Option<u64> {
        self.id.parse().ok().filter(|number: &u64| number.to_string() == self.id)
    }
}

/// Request of `activate`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActivateRequest {
    /// Id of a finished job (digits only), or name of a file in the folder of databases that the daemon was started with.
    pub database: String,
}

impl ActivateRequest {
    /// Id of the job, if it names one.
    pub fn job(&self) -> Option<&str> {
        let is_id = !self.database.is_empty() && self.database.bytes().all(|b| b.is_ascii_digit());
        is_id.then_some(self.database.as_str())
    }
}

/// Reply of `activate`: the examples that are active now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActivateReply {
    /// Tick of the change: frames of later ticks use them.
    pub tick: u64,
    /// Generation in the header of those frames.
    pub database_generation: u32,
    /// Number of examples.
    pub examples: u32,
}

/// State of the simulation after `reset`, `pause`, `resume` or `restore`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StateReply {
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time in seconds.
    pub sim_time_s: f64,
    /// Whether the simulation is paused.
    pub paused: bool,
}

/// State of the simulation after `step`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StepReply {
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time in seconds.
    pub sim_time_s: f64,
}

/// Reply of `snapshot`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SnapshotReply {
    /// Id for `restore`.
    pub id: String,
}

/// Whether a request that was answered with an error was carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Done {
    /// Nothing was done.
    No,
    /// A part was done: a step stopped early, at [`ErrorReply::tick`].
    Partly,
    /// Not known, also to readers of a value from later versions.
    #[default]
    #[serde(other)]
    Unknown,
}

/// Error in place of a reply.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorReply {
    /// One of [`ErrorCode::name`]; readers must expect unknown codes.
    pub code: String,
    /// A sentence for a person.
    pub message: String,
    /// True if nothing was done and the same request may succeed later.
    pub retryable: bool,
    /// Whether the request was carried out.
    #[serde(default)]
    pub done: Done,
    /// Tick that the simulation has reached; of steps only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u64>,
    /// Ticks that the step has run; of steps only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ticks_done: Option<u32>,
}

impl ErrorReply {
    /// Error with a known code.
    pub fn new(code: ErrorCode, message: impl Into<String>) -> Self {
        Self {
            code: code.name().to_owned(),
            message: message.into(),
            retryable: code.retryable(),
            done: code.done(),
            tick: None,
            ticks_done: None,
        }
    }

    /// A step that stopped before its last tick.
    #[must_use]
    pub fn stopped_at(self, tick: u64, ticks_done: u32) -> Self {
        Self { retryable: false, done: Done::Partly, tick: Some(tick), ticks_done: Some(ticks_done), ..self }
    }

    /// A request that was not carried out and may succeed later.
    #[must_use]
    pub fn nothing_done_yet(self) -> Self {
        Self { retryable: true, done: Done::No, ..self }
    }

    /// The payload of the reply.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("strings always serialise")
    }
}

/// Error codes of this version of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ErrorCode {
    /// No such method.
    RpcUnknown,
    /// A method called through a wildcard.
    RpcWildcard,
    /// Not JSON, an unknown or missing key, or a value out of range.
    RpcMalformed,
    /// `step` while the simulation's clock runs.
    NotPaused,
    /// `step` with a `from_tick` at which the simulation is not.
    WrongTick,
    /// A `step` that `interrupt` has stopped early.
    Interrupted,
    /// A pose inside a request did not pass the gate, or is out of order.
    BadPose,
    /// A tool that the scene does not have.
    UnknownTool,
    /// An object that the scene does not have.
    UnknownObject,
    /// A snapshot that does not exist, perhaps no longer.
    UnknownSnapshot,
    /// A submitted scene that cannot be used; the message names line, key and remedy.
    BadScene,
    /// A job that does not exist.
    UnknownJob,
    /// A client id that belongs to a job with another request.
    JobConflict,
    /// The job's state does not allow the request: cancelling an ended job, resuming a running one, fetching an unfinished one.
    JobState,
    /// Too many jobs have not ended.
    TooManyJobs,
    /// The daemon accepts no jobs, since its data folder cannot be used.
    JobsUnavailable,
    /// Examples that cannot be used: no such file, damaged, or of another scene, as the message says.
    BadDatabase,
    /// `?offset=` is not a number, or beyond the end.
    BadOffset,
    /// The answer does not exist yet, for instance no frame.
    NotReady,
    /// The queue of requests is full.
    Busy,
    /// A `step` that stopped early at its limit of time, or a simulation that did not answer.
    TimedOut,
    /// The daemon is stopping.
    ShuttingDown,
    /// A fault of the daemon.
    Internal,
}

impl ErrorCode {
    /// All codes.
    pub const ALL: [Self; 23] = [
        Self::RpcUnknown,
        Self::RpcWildcard,
        Self::RpcMalformed,
        Self::NotPaused,
        Self::WrongTick,
        Self::Interrupted,
        Self::BadPose,
        Self::UnknownTool,
        Self::UnknownObject,
        Self::UnknownSnapshot,
        Self::BadScene,
        Self::UnknownJob,
        Self::JobConflict,
        Self::JobState,
        Self::TooManyJobs,
        Self::JobsUnavailable,
        Self::BadDatabase,
        Self::BadOffset,
        Self::NotReady,
        Self::Busy,
        Self::TimedOut,
        Self::ShuttingDown,
        Self::Internal,
    ];

    /// `code` of the reply, and name of the counter in the status.
    pub fn name(self) -> &'static str {
        match self {
            Self::RpcUnknown => "rpc_unknown",
            Self::RpcWildcard => "rpc_wildcard",
            Self::RpcMalformed => "rpc_malformed",
            Self::NotPaused => "not_paused",
            Self::WrongTick => "wrong_tick",
            Self::Interrupted => "interrupted",
            Self::BadPose => "bad_pose",
            Self::UnknownTool => "unknown_tool",
            Self::UnknownObject => "unknown_object",
            Self::UnknownSnapshot => "unknown_snapshot",
            Self::BadScene => "bad_scene",
            Self::UnknownJob => "unknown_job",
            Self::JobConflict => "job_conflict",
            Self::JobState => "job_state",
            Self::TooManyJobs => "too_many_jobs",
            Self::JobsUnavailable => "jobs_unavailable",
            Self::BadDatabase => "bad_database",
            Self::BadOffset => "bad_offset",
            Self::NotReady => "not_ready",
            Self::Busy => "busy",
            Self::TimedOut => "timed_out",
            Self::ShuttingDown => "shutting_down",
            Self::Internal => "internal",
        }
    }

    /// True if nothing was done and the same request may succeed later.
    pub fn retryable(self) -> bool {
        matches!(self, Self::NotReady | Self::Busy | Self::TooManyJobs)
    }

    /// Whether a request with this error was carried out, unless the reply says otherwise.
    pub fn done(self) -> Done {
        match self {
            Self::TimedOut | Self::ShuttingDown | Self::Internal => Done::Unknown,
            Self::Interrupted => Done::Partly,
            _ => Done::No,
        }
    }
}
