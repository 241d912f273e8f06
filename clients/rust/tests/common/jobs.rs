//! Jobs of the small daemon, each with a fate of its own.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use plica_client::protocol::chunk::{ChunkHeader, offset_of, piece};
use plica_client::protocol::jobs::{
    Job, JobFetchRequest, JobKind, JobListReply, JobProgress, JobRequest, JobState, JobSubmitReply, JobSubmitRequest,
};
use plica_client::protocol::rpc::{ErrorCode, ErrorReply, Method, decode_request};
use serde_json::Value;
use sha2::{Digest, Sha256};
use zenoh::Wait;
use zenoh::query::Query;

use super::mesh_bytes;

/// Done.
pub(crate) const DONE: &str = "0001";
/// Failed, with a reason.
pub(crate) const FAILED: &str = "0002";
/// Runs when it is asked for twice, and is done then.
pub(crate) const ENDS: &str = "0003";
/// Runs for ever.
pub(crate) const ENDLESS: &str = "0004";
/// Done; its result has another check-sum than announced.
pub(crate) const BROKEN: &str = "0005";

static ASKED: AtomicU32 = AtomicU32::new(0);

fn job(id: &str, state: JobState) -> Job {
    let done = if state == JobState::Done { 8 } else { 3 };
    Job {
        id: id.to_owned(),
        client_id: format!("client-{id}"),
        kind: JobKind::Training,
        scene_name: "wedge".to_owned(),
        examples: Some(8),
        seed: None,
        threads: 1,
        submitted_unix_s: 1_700_000_000,
        state,
        reason: (state == JobState::Failed).then(|| "exit code 1: disk full".to_owned()),
        started_unix_s: None,
        finished_unix_s: None,
        progress: JobProgress { done, total: 8, seconds_left: Some(12.0), ..JobProgress::default() },
    }
}

pub(crate) fn find(id: &str) -> Result<Job, ErrorReply> {
    let state = match id {
        DONE | BROKEN => JobState::Done,
        FAILED => JobState::Failed,
        ENDS if ASKED.fetch_add(1, Relaxed) >= 2 => JobState::Done,
        ENDS | ENDLESS => JobState::Running,
        _ => return Err(ErrorReply::new(ErrorCode::UnknownJob, format!("no job `{id}`"))),
    };
    Ok(job(id, state))
}

pub(crate) fn answer(method: Method, payload: &[u8]) -> Result<Value, ErrorReply> {
    let id = || decode_request::<JobRequest>(payload).map(|request| request.id);
    let reply = match method {
        Method::JobSubmit => serde_json::to_value(submit(&decode_request(payload)?)?),
        Method::JobList => {
            let jobs = vec![find(DONE)?, find(FAILED)?, find(ENDLESS)?];
            serde_json::to_value(JobListReply { jobs, older: 2, removed: 1 })
        }
        Method::JobCancel => find(&id()?).map(|_| serde_json::to_value(job(ENDLESS, JobState::Cancelled)))?,
        Method::JobResume => find(&id()?).map(|_| serde_json::to_value(job(FAILED, JobState::Queued)))?,
        _ => serde_json::to_value(find(&id()?)?),
    };
    Ok(reply.unwrap())
}

/// The request comes back inside the job.
fn submit(request: &JobSubmitRequest) -> Result<JobSubmitReply, ErrorReply> {
    request.check()?;
    if request.scene.as_deref() == Some("bad") {
        return Err(ErrorReply::new(ErrorCode::BadScene, "mine.toml:1: not valid TOML"));
    }
    let JobSubmitRequest { client_id, kind, examples, seed, threads, scene_name, .. } = request.clone();
    let job = Job {
        kind,
        examples,
        seed,
        threads: threads.unwrap_or(1),
        scene_name: scene_name.unwrap_or_else(|| "served".to_owned()),
        client_id: client_id.clone(),
        ..job(ENDLESS, JobState::Queued)
    };
    Ok(JobSubmitReply { created: client_id != "again", job })
}

pub(crate) fn fetch(query: &Query, payload: &[u8]) {
    let request: JobFetchRequest = decode_request(payload).unwrap();
    let whole = mesh_bytes();
    let offset = offset_of(query.parameters().as_str()).unwrap();
    if find(&request.id).map(|job| job.state) != Ok(JobState::Done) {
        let error = ErrorReply::new(ErrorCode::JobState, "not done");
        return query.reply_err(error.to_json()).wait().unwrap();
    }
    let mut sha256: String = Sha256::digest(&whole).iter().map(|b| format!("{b:02x}")).collect();
    if request.id == BROKEN {
        sha256 = "0".repeat(64);
    }
    let header = ChunkHeader { total_bytes: whole.len() as u64, offset, sha256 };
    let reply = query.reply(query.key_expr().clone(), piece(&whole, offset).unwrap().to_vec());
    reply.attachment(header.to_json()).wait().unwrap();
}
