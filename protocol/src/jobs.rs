//! Jobs: long-running work that a daemon queues, supervises and stores on disk.
//!
//! `queued -> running -> (done | failed | cancelled)`, and `paused` while no daemon runs. Requests are JSON under
//! `rpc/job_...`; progress is JSON on the key `job_progress`. These types check the form of a request; the daemon
//! checks scenes and ids.

use serde::{Deserialize, Serialize};

use crate::keys::check_name;
use crate::object;
use crate::rpc::{ErrorCode, ErrorReply};

/// Largest job request in bytes, with its scene (1 MiB).
pub const MAX_REQUEST_BYTES: usize = 1 << 20;
/// Most examples of one job.
pub const MAX_EXAMPLES: u32 = 100_000;
/// Most threads of one job.
pub const MAX_THREADS: u32 = 1024;
/// Jobs that `job_list` returns: the newest ones.
pub const MAX_LISTED: usize = 256;
/// Jobs that the status names: the newest ones.
pub const MAX_IN_STATUS: usize = 16;

/// Kind of the database that a job makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// Examples to train on.
    Training,
    /// Held-out interactions, drawn in the same way and never trained on.
    Evaluation,
}

/// State of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits in the queue; one job runs at a time.
    Queued,
    /// Its process runs.
    Running,
    /// Its daemon was stopped while it ran; the next daemon continues it.
    Paused,
    /// The result can be fetched.
    Done,
    /// Ended without a result, for `reason`. `job_resume` keeps finished examples.
    Failed,
    /// Cancelled by a client. `job_resume` keeps finished examples.
    Cancelled,
}

impl JobState {
    /// All states.
    pub const ALL: [Self; 6] = [Self::Queued, Self::Running, Self::Paused, Self::Done, Self::Failed, Self::Cancelled];

    /// Name of the state in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Whether the job has ended: done, failed or cancelled.
    pub fn is_over(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Cancelled)
    }
}

/// Request of `job_submit`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JobSubmitRequest {
    /// Name chosen by the client, as in keys; two submissions with the same id are one job.
    pub client_id: String,
    /// Kind of the database.
    #[serde(deserialize_with = "object::name")]
    pub kind: JobKind,
    /// Number of examples, 1 to [`MAX_EXAMPLES`]; left out: the scene's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub examples: Option<u32>,
    /// Seed of the interactions; left out: the scene's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Threads, 1 to [`MAX_THREADS`]; left out: all cores of the daemon's machine but one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threads: Option<u32>,
    /// Text of a scene file (TOML); left out: the scene that the daemon serves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Name of `scene`, for people; only together with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_name: Option<String>,
}

impl JobSubmitRequest {
    /// Request with defaults for everything else.
    pub fn new(client_id: impl Into<String>, kind: JobKind) -> Self {
        let client_id = client_id.into();
        Self { client_id, kind, examples: None, seed: None, threads: None, scene: None, scene_name: None }
    }

    /// Checks names and ranges. Errors with `rpc_malformed`.
    pub fn check(&self) -> Result<(), ErrorReply> {
        check_name(&self.client_id).map_err(|e| malformed(format!("client_id: {e}")))?;
        in_range("examples", self.examples, MAX_EXAMPLES)?;
        in_range("threads", self.threads, MAX_THREADS)?;
        let Some(name) = &self.scene_name else { return Ok(()) };
        if self.scene.is_none() {
            return Err(malformed("scene_name without scene; it names the scene in the request".to_owned()));
        }
        check_name(name).map_err(|e| malformed(format!("scene_name: {e}")))
    }
}

fn in_range(field: &str, value: Option<u32>, most: u32) -> Result<(), ErrorReply> {
    match value {
        Some(value) if !(1..=most).contains(&value) => {
            Err(malformed(format!("{field} is {value}; the allowed range is 1 to {most}")))
        }
        _ => Ok(()),
    }
}

fn malformed(message: String) -> ErrorReply {
    ErrorReply::new(ErrorCode::RpcMalformed, message)
}

/// Request of `job_get`, `job_cancel` and `job_resume`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JobRequest {
    /// Id that `job_submit` returned.
    pub id: String,
}

/// Result file of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobFile {
    /// The examples: a safetensors file.
    Database,
    /// Times, counts, rejections: JSON.
    Report,
}

/// Request of `job_fetch`; the reply comes in chunks (see [`crate::chunk`]).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JobFetchRequest {
    /// Id that `job_submit` returned.
    pub id: String,
    /// Requested file.
    #[serde(rename = "what", deserialize_with = "object::name")]
    pub file: JobFile,
}

/// A job with its status and progress. Reply of `job_get`, `job_cancel` and `job_resume`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Id from the daemon: a number of four digits or more. Later jobs have larger numbers; as text, `10000` is before `9999`.
    pub id: String,
    /// Id from the client.
    pub client_id: String,
    /// Kind of the database.
    pub kind: JobKind,
    /// Name of the scene.
    pub scene_name: String,
    /// Requested number of examples; null: the scene's.
    pub examples: Option<u32>,
    /// Requested seed; null: the scene's.
    pub seed: Option<u64>,
    /// Number of threads.
    pub threads: u32,
    /// Time of submission, in seconds since 1970.
    pub submitted_unix_s: u64,
    /// State.
    pub state: JobState,
    /// Reason of the state as a sentence, if there is one.
    pub reason: Option<String>,
    /// Last start of its process, in seconds since 1970.
    pub started_unix_s: Option<u64>,
    /// End, in seconds since 1970.
    pub finished_unix_s: Option<u64>,
    /// Progress.
    #[serde(flatten)]
    pub progress: JobProgress,
}

/// Progress of a job.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct JobProgress {
    /// Present stage: `interactions`, `examples`, `database`, in later versions perhaps others; null before the start.
    pub stage: Option<String>,
    /// Finished examples, all of them on disk.
    pub done: u32,
    /// Interactions without an example, since a solve did not converge or an element is too distorted. The report lists them.
    pub rejected: u32,
    /// Interactions in all, `done + rejected` at the end; 0 while unknown.
    pub total: u32,
    /// Estimate of the time left in seconds.
    pub seconds_left: Option<f64>,
}

/// Reply of `job_submit`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobSubmitReply {
    /// False if the client id was submitted before; `job` is then the existing job.
    pub created: bool,
    /// The job.
    #[serde(flatten)]
    pub job: Job,
}

/// Reply of `job_list`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JobListReply {
    /// The newest [`MAX_LISTED`], oldest first.
    pub jobs: Vec<Job>,
    /// Number of older jobs that the list leaves out; `job_get` returns them by id.
    #[serde(default)]
    pub older: u32,
    /// Number of finished jobs that the daemon has removed since its start, beyond those that it keeps.
    #[serde(default)]
    pub removed: u32,
}

/// Message on `job_progress`, published when a job has changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobProgressMessage {
    /// Id of the job.
    pub id: String,
    /// State.
    pub state: JobState,
    /// Reason of the state as a sentence, if there is one.
    pub reason: Option<String>,
    /// Progress.
    #[serde(flatten)]
    pub progress: JobProgress,
}

impl JobProgressMessage {
    /// Decodes a message.
    pub fn from_json(bytes: &[u8]) -> Result<Self, crate::error::DecodeError> {
        serde_json::from_slice(bytes).map_err(|error| crate::error::DecodeError::Json(error.to_string()))
    }
}

impl From<&Job> for JobProgressMessage {
    fn from(job: &Job) -> Self {
        Self { id: job.id.clone(), state: job.state, reason: job.reason.clone(), progress: job.progress.clone() }
    }
}

/// A job in the status.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobStatus {
    /// Id of the job.
    pub id: String,
    /// State.
    pub state: JobState,
    /// See [`JobProgress::done`].
    pub done: u32,
    /// See [`JobProgress::rejected`].
    pub rejected: u32,
    /// See [`JobProgress::total`].
    pub total: u32,
}

impl From<&Job> for JobStatus {
    fn from(job: &Job) -> Self {
        let JobProgress { done, rejected, total, .. } = job.progress;
        Self { id: job.id.clone(), state: job.state, done, rejected, total }
    }
}
