//! Why a request about jobs is refused.

use plica_protocol::jobs::{JobFile, JobState};
use plica_protocol::rpc::{ErrorCode, ErrorReply};

/// Why a request about jobs is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JobError {
    /// The daemon has no data folder.
    #[error("this daemon takes no jobs: {0}")]
    Unavailable(String),
    /// A job cannot be written to disk.
    #[error("the job cannot be stored: {0}")]
    Disk(String),
    /// A result cannot be read.
    #[error("the result {0}")]
    Result(String),
    /// The job had this id, and was removed.
    #[error("no job `{0}` any more: the daemon keeps a limited number of finished jobs (--keep-jobs, --keep-bytes)")]
    Removed(String),
    /// Unfinished jobs fill the room for jobs.
    #[error(
        "the jobs that are not over have {bytes} bytes with this one; at most {most} are kept; cancel some, or wait until some are over"
    )]
    NoRoom {
        /// Bytes of all of them.
        bytes: u64,
        /// Bound of the data folder's jobs.
        most: u64,
    },
    /// No job has this id.
    #[error("no job `{0}`; `job_list` names them")]
    Unknown(String),
    /// Two different requests with one client id.
    #[error("client_id `{client_id}` belongs to job {id}, which asks for another {what}; choose a new client_id")]
    Conflict {
        /// Client id of both requests.
        client_id: String,
        /// Existing job.
        id: String,
        /// The first key that differs.
        what: &'static str,
    },
    /// The job has ended already.
    #[error("job {id} is {} already", .state.name())]
    Over {
        /// The job.
        id: String,
        /// Its state.
        state: JobState,
    },
    /// The job is queued, running or done.
    #[error("job {id} is {}; only failed, cancelled and paused jobs can be resumed", .state.name())]
    NotResumable {
        /// The job.
        id: String,
        /// Its state.
        state: JobState,
    },
    /// The job has no result yet.
    #[error("job {id} is {}; its {} can be fetched when it is done", .state.name(), name_of(*.file))]
    NotDone {
        /// The job.
        id: String,
        /// Its state.
        state: JobState,
        /// Requested file.
        file: JobFile,
    },
    /// The queue is full.
    #[error("{0} jobs wait already; cancel some, or wait until some are over")]
    TooMany(usize),
    /// The scene cannot be used.
    #[error("{0}")]
    Scene(String),
}

fn name_of(file: JobFile) -> &'static str {
    match file {
        JobFile::Database => "database",
        JobFile::Report => "report",
    }
}

impl JobError {
    fn code(&self) -> ErrorCode {
        match self {
            Self::Unavailable(_) | Self::Disk(_) | Self::Result(_) => ErrorCode::JobsUnavailable,
            Self::Unknown(_) | Self::Removed(_) => ErrorCode::UnknownJob,
            Self::Conflict { .. } => ErrorCode::JobConflict,
            Self::Over { .. } | Self::NotResumable { .. } | Self::NotDone { .. } => ErrorCode::JobState,
            Self::TooMany(_) | Self::NoRoom { .. } => ErrorCode::TooManyJobs,
            Self::Scene(_) => ErrorCode::BadScene,
        }
    }
}

impl From<JobError> for ErrorReply {
    fn from(error: JobError) -> Self {
        let passes = matches!(error, JobError::Disk(_));
        let reply = Self::new(error.code(), error.to_string());
        if passes { reply.nothing_done_yet() } else { reply }
    }
}
