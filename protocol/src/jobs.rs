//! Jobs: long-running work that a daemon queues, supervises and keeps on disk.
//!
//! `queued -> running -> (done | failed | cancelled)`, and `paused` while no daemon runs. Requests are JSON under
//! `rpc/job_...`; progress is JSON on the key `job_progress`. These types say what may stand in a request; whether a
//! scene is good and a job exists is the daemon's to say.

use serde::{Deserialize, Serialize};

use crate::keys::check_name;
use crate::rpc::{ErrorCode, ErrorReply};

/// Most bytes of a job request, the scene included (1 MiB).
pub const MAX_REQUEST_BYTES: usize = 1 << 20;
/// Most examples of one job.
pub const MAX_EXAMPLES: u32 = 100_000;
/// Most threads of one job.
pub const MAX_THREADS: u32 = 1024;
/// Jobs that `job_list` returns: the newest ones.
pub const MAX_LISTED: usize = 256;
/// Jobs that the status names: the newest ones.
pub const MAX_IN_STATUS: usize = 16;

/// What a job makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// Examples to learn from.
    Training,
    /// Held-out interactions, drawn in the same way, that are never trained on.
    Evaluation,
}

/// Where a job stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits for its turn: one job runs at a time.
    Queued,
    /// Its process is at work.
    Running,
    /// The daemon was stopped while it ran; it goes on when the daemon starts again.
    Paused,
    /// The result can be fetched.
    Done,
    /// It ended without a result; `reason` says why. `job_resume` keeps what is finished.
    Failed,
    /// Somebody ended it. `job_resume` keeps what is finished.
    Cancelled,
}

impl JobState {
    /// All states.
    pub const ALL: [Self; 6] = [Self::Queued, Self::Running, Self::Paused, Self::Done, Self::Failed, Self::Cancelled];

    /// The state as it stands in JSON.
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

    /// True if the job changes no more by itself.
    pub fn is_over(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Cancelled)
    }
}

/// Request of `job_submit`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JobSubmitRequest {
    /// Chosen by the client: submitting twice with the same one is one job. A name as in keys.
    pub client_id: String,
    /// What to make.
    pub kind: JobKind,
    /// How many examples, 1 to [`MAX_EXAMPLES`]; left out: what the scene says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub examples: Option<u32>,
    /// Seed of the interactions; left out: what the scene says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Threads, 1 to [`MAX_THREADS`]; left out: all cores of the daemon's machine but one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threads: Option<u32>,
    /// Text of a scene file (TOML); left out: the scene that the daemon serves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Name of that scene, for people; only beside `scene`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_name: Option<String>,
}

impl JobSubmitRequest {
    /// A request that leaves everything to the daemon.
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
            return Err(malformed("scene_name without scene; it names the scene that is sent".to_owned()));
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
    /// What `job_submit` returned.
    pub id: String,
}

/// A file that a job leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobFile {
    /// The examples: a safetensors file.
    Database,
    /// Times, counts, rejections: JSON.
    Report,
}

/// Request of `job_fetch`, which is answered in pieces (see [`crate::chunk`]).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JobFetchRequest {
    /// What `job_submit` returned.
    pub id: String,
    /// Which file.
    #[serde(rename = "what")]
    pub file: JobFile,
}

/// All about one job. Reply of `job_get`, `job_cancel` and `job_resume`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Given by the daemon; ids of later jobs come later in the alphabet.
    pub id: String,
    /// Given by the client.
    pub client_id: String,
    /// What it makes.
    pub kind: JobKind,
    /// Name of the scene.
    pub scene_name: String,
    /// Examples asked for; null: what the scene says.
    pub examples: Option<u32>,
    /// Seed asked for; null: what the scene says.
    pub seed: Option<u64>,
    /// Threads.
    pub threads: u32,
    /// When it was submitted, in seconds since 1970.
    pub submitted_unix_s: u64,
    /// Where it stands.
    pub state: JobState,
    /// Why it is where it is, in words, if there is anything to say.
    pub reason: Option<String>,
    /// When its process was last started, in seconds since 1970.
    pub started_unix_s: Option<u64>,
    /// When it ended, in seconds since 1970.
    pub finished_unix_s: Option<u64>,
    /// How far it is.
    #[serde(flatten)]
    pub progress: Progress,
}

/// How far a job is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Progress {
    /// What it does at the moment: `interactions`, `examples`, `database`, perhaps others later; null before the start.
    pub stage: Option<String>,
    /// Examples that are on disk.
    pub done: u32,
    /// Interactions that gave no example: they did not converge, or came out too distorted. The report lists them.
    pub rejected: u32,
    /// Interactions in all, `done + rejected` at the end; 0 while it is not known.
    pub total: u32,
    /// Estimate of the time left in seconds.
    pub seconds_left: Option<f64>,
}

/// Reply of `job_submit`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobSubmitReply {
    /// False if this client id had been submitted before: then this is that job.
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
    /// How many older ones there are; `job_get` knows them by id.
    #[serde(default)]
    pub older: u32,
}

/// What is published on `job_progress` when something has changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobProgress {
    /// Which job.
    pub id: String,
    /// Where it stands.
    pub state: JobState,
    /// Why, if there is anything to say.
    pub reason: Option<String>,
    /// How far it is.
    #[serde(flatten)]
    pub progress: Progress,
}

impl JobProgress {
    /// Reads a message.
    pub fn from_json(bytes: &[u8]) -> Result<Self, crate::error::DecodeError> {
        serde_json::from_slice(bytes).map_err(|error| crate::error::DecodeError::Json(error.to_string()))
    }
}

impl From<&Job> for JobProgress {
    fn from(job: &Job) -> Self {
        Self { id: job.id.clone(), state: job.state, reason: job.reason.clone(), progress: job.progress.clone() }
    }
}

/// A job in the status.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobStatus {
    /// Which job.
    pub id: String,
    /// Where it stands.
    pub state: JobState,
    /// See [`Progress::done`].
    pub done: u32,
    /// See [`Progress::rejected`].
    pub rejected: u32,
    /// See [`Progress::total`].
    pub total: u32,
}

impl From<&Job> for JobStatus {
    fn from(job: &Job) -> Self {
        let Progress { done, rejected, total, .. } = job.progress;
        Self { id: job.id.clone(), state: job.state, done, rejected, total }
    }
}
