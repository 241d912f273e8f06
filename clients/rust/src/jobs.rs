//! Jobs: submit, watch, cancel, resume, fetch.

use std::io::{self, Write};
use std::time::Duration;

use plica_protocol::chunk::ChunkHeader;
use plica_protocol::jobs::{
    Job, JobFetchRequest, JobFile, JobListReply, JobProgressMessage, JobRequest, JobSubmitReply, JobSubmitRequest,
};
use sha2::{Digest, Sha256};

use crate::client::Client;
use crate::error::ClientError;
use crate::query::{check_piece, check_sum, chunk_header};
use crate::subscribe::Subscription;

/// How long a submission may take: the daemon reads the scene and writes it to disk.
const SUBMIT_TIMEOUT: Duration = Duration::from_secs(30);
/// How often a submission without an answer is repeated; the client id makes it one job.
const SUBMIT_ATTEMPTS: u32 = 3;

/// Why a result could not be fetched.
#[derive(Debug, thiserror::Error)]
pub enum FetchError {
    /// The daemon refused, or did not answer.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// What has arrived cannot be written.
    #[error("the result cannot be written: {0}")]
    Write(#[from] io::Error),
}

impl Client {
    /// Queues a job. An answer that got lost is asked for again: with one client id it is one job.
    pub fn submit_job(&self, request: &JobSubmitRequest) -> Result<JobSubmitReply, ClientError> {
        let mut attempt = 1;
        loop {
            match self.call_within("job_submit", request, SUBMIT_TIMEOUT) {
                Err(ClientError::TimedOut { .. }) if attempt < SUBMIT_ATTEMPTS => attempt += 1,
                answer => return answer,
            }
        }
    }

    /// The newest jobs, oldest first.
    pub fn jobs(&self) -> Result<JobListReply, ClientError> {
        self.call("job_list", &serde_json::json!({}))
    }

    /// One job.
    pub fn job(&self, id: &str) -> Result<Job, ClientError> {
        self.call("job_get", &JobRequest { id: id.to_owned() })
    }

    /// Ends a job.
    pub fn cancel_job(&self, id: &str) -> Result<Job, ClientError> {
        self.call("job_cancel", &JobRequest { id: id.to_owned() })
    }

    /// Queues a failed or cancelled job again; its finished examples are kept.
    pub fn resume_job(&self, id: &str) -> Result<Job, ClientError> {
        self.call("job_resume", &JobRequest { id: id.to_owned() })
    }

    /// Progress of all jobs as it is published. Messages may be lost, even the last one; [`Client::job`] returns the present state.
    pub fn subscribe_job_progress(&self, capacity: usize) -> Result<Subscription<JobProgressMessage>, ClientError> {
        self.subscribe_json(&self.keys.job_progress(), capacity, JobProgressMessage::from_json)
    }

    /// Writes a result of a job that is done into `out`, piece by piece, and checks its SHA-256. `progress` hears how
    /// many bytes are there, and how many there will be. On an error `out` holds part of it.
    pub fn fetch_job(
        &self,
        id: &str,
        file: JobFile,
        out: &mut dyn Write,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<ChunkHeader, FetchError> {
        let key = self.keys.rpc("job_fetch");
        let request = serde_json::to_vec(&JobFetchRequest { id: id.to_owned(), file });
        let request = request.map_err(|error| ClientError::Bus(error.to_string()))?;
        let (mut hash, mut have) = (Sha256::new(), 0);
        let mut announced: Option<String> = None;
        loop {
            let reply = self.ask(&format!("{key}?offset={have}"), Some(request.clone()))?;
            let (piece, header) = (reply.payload().to_bytes(), chunk_header(&key, &reply)?);
            let expected = announced.get_or_insert_with(|| header.sha256.clone());
            if *expected != header.sha256 {
                let (expected, got) = (expected.clone(), header.sha256);
                return Err(ClientError::Checksum { key, expected, got }.into());
            }
            check_piece(&key, &header, have, piece.len())?;
            out.write_all(&piece)?;
            hash.update(&piece);
            have += piece.len() as u64;
            progress(have, header.total_bytes);
            if have == header.total_bytes {
                check_sum(&key, &header, hash)?;
                return Ok(header);
            }
        }
    }
}
