//! Accepts a job: the request is checked completely and written to disk before the client gets an id.

use std::fs;
use std::io;
use std::path::Path;

use plica_protocol::jobs::{JobSubmitReply, JobSubmitRequest, MAX_REQUEST_BYTES};
use plica_training::{RegularFile, TrainingJob, default_threads, now_unix_s, sync_folder};

use crate::error::JobError;
use crate::folder::{JobFolder, StoredStatus};
use crate::keep::Keep;
use crate::recover::SUBMITTING;
use crate::scene::{JobScene, ServedScene};
use crate::store::{Entry, Store};
use crate::view;

/// Most jobs that have not ended.
const MAX_UNFINISHED: usize = 100;

/// New job of a request that has passed [`JobSubmitRequest::check`], or the existing job with its client id.
pub(crate) fn submit(
    store: &Store,
    request: &JobSubmitRequest,
    served: &ServedScene,
    keep: Keep,
) -> Result<JobSubmitReply, JobError> {
    if let Some(entry) = store.find_client_id(&request.client_id) {
        check_same(&entry, request)?;
        return Ok(JobSubmitReply { created: false, job: entry.view() });
    }
    if store.n_unfinished() >= MAX_UNFINISHED {
        return Err(JobError::TooMany(MAX_UNFINISHED));
    }
    let scene = JobScene::new(request, served)?;
    let number = store.next_number();
    let job = training_job(request, &scene, format!("{number:04}"));
    let folder = JobFolder::new(store.jobs().join(&job.id));
    let status = StoredStatus::queued();
    let room = Room { unfinished_bytes: store.unfinished_bytes(), most_bytes: keep.bytes };
    let bytes = make(store.jobs(), &folder, &scene, &job, &status, room)?;
    let entry = Entry { folder, job, status, progress: None };
    Ok(JobSubmitReply { created: true, job: store.insert(number, entry, bytes) })
}

/// Refuses a request that differs from the job with its client id. Keys that the request leaves out are not compared.
fn check_same(entry: &Entry, request: &JobSubmitRequest) -> Result<(), JobError> {
    let job = &entry.job;
    let stored = || RegularFile::open_unlinked(&entry.folder.scene(), MAX_REQUEST_BYTES as u64)?.read();
    let scene = request.scene.as_ref().map(|text| stored().is_ok_and(|stored| stored == text.as_bytes()));
    let differs = [
        ("kind", job.kind != view::training_kind(request.kind)),
        ("examples", job.examples != request.examples),
        ("seed", job.seed != request.seed),
        ("threads", request.threads.is_some() && request.threads != job.threads),
        ("scene", scene == Some(false)),
    ];
    match differs.iter().find(|(_, differs)| *differs) {
        None => Ok(()),
        Some((what, _)) => Err(JobError::Conflict { client_id: request.client_id.clone(), id: job.id.clone(), what }),
    }
}

fn training_job(request: &JobSubmitRequest, scene: &JobScene<'_>, id: String) -> TrainingJob {
    TrainingJob {
        id,
        client_id: request.client_id.clone(),
        kind: view::training_kind(request.kind),
        scene_name: scene.name.clone(),
        examples: request.examples,
        seed: request.seed,
        threads: request.threads.or_else(|| Some(default_threads())),
        submitted_unix_s: now_unix_s(),
    }
}

/// Room for jobs that have not ended.
#[derive(Debug, Clone, Copy)]
struct Room {
    unfinished_bytes: u64,
    most_bytes: u64,
}

impl Room {
    fn check(self, new_bytes: u64) -> Result<(), JobError> {
        let bytes = self.unfinished_bytes.saturating_add(new_bytes);
        if bytes > self.most_bytes { Err(JobError::NoRoom { bytes, most: self.most_bytes }) } else { Ok(()) }
    }
}

/// Fills the folder under another name and renames it, so that it is complete or absent. Returns its bytes.
fn make(
    jobs: &Path,
    folder: &JobFolder,
    scene: &JobScene<'_>,
    job: &TrainingJob,
    status: &StoredStatus,
    room: Room,
) -> Result<u64, JobError> {
    let submitting = JobFolder::new(jobs.join(SUBMITTING));
    let disk = |e: io::Error| JobError::Disk(e.to_string());
    let made = fill(&submitting, scene, job, status).and_then(|()| {
        let bytes = submitting.bytes();
        room.check(bytes)?;
        fs::rename(submitting.path(), folder.path()).and_then(|()| sync_folder(jobs)).map_err(disk)?;
        Ok(bytes)
    });
    if let Err(error) = &made {
        if let JobError::Disk(problem) = error {
            tracing::warn!("{}: a job cannot be stored: {problem}", jobs.display());
        }
        let _ = fs::remove_dir_all(submitting.path());
    }
    made
}

fn fill(folder: &JobFolder, scene: &JobScene<'_>, job: &TrainingJob, status: &StoredStatus) -> Result<(), JobError> {
    let disk = |e: io::Error| JobError::Disk(e.to_string());
    if folder.path().exists() {
        fs::remove_dir_all(folder.path()).map_err(disk)?;
    }
    fs::create_dir(folder.path()).map_err(disk)?;
    scene.write(folder.paths())?;
    folder.write_status(status).and_then(|()| folder.write_job(job)).map_err(disk)
}
