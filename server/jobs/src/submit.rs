//! Accepts a job: the request is checked completely and written to disk before the client gets an id.

use std::fs;
use std::io;
use std::path::Path;

use plica_protocol::jobs::{JobSubmitReply, JobSubmitRequest};
use plica_training::{TrainingJob, default_threads, now_unix_s, sync_folder};

use crate::error::JobError;
use crate::folder::{JobFolder, StoredStatus};
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
    make(store.jobs(), &folder, &scene, &job, &status)
        .map_err(|e| JobError::Disk(format!("{}: {e}", folder.path().display())))?;
    let entry = Entry { folder, job, status, progress: None };
    Ok(JobSubmitReply { created: true, job: store.insert(number, entry) })
}

/// Refuses a request that differs from the job with its client id. Keys that the request leaves out are not compared.
fn check_same(entry: &Entry, request: &JobSubmitRequest) -> Result<(), JobError> {
    let job = &entry.job;
    let scene = request.scene.as_ref().map(|text| fs::read(entry.folder.scene()).is_ok_and(|t| t == text.as_bytes()));
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

fn training_job(request: &JobSubmitRequest, scene: &JobScene, id: String) -> TrainingJob {
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

/// Fills the folder under another name and renames it, so that it is complete or absent.
fn make(jobs: &Path, folder: &JobFolder, scene: &JobScene, job: &TrainingJob, status: &StoredStatus) -> io::Result<()> {
    let path = jobs.join(SUBMITTING);
    let made = fill(&JobFolder::new(path.clone()), scene, job, status);
    let made = made.and_then(|()| fs::rename(&path, folder.path())).and_then(|()| sync_folder(jobs));
    if made.is_err() {
        let _ = fs::remove_dir_all(&path);
    }
    made
}

fn fill(folder: &JobFolder, scene: &JobScene, job: &TrainingJob, status: &StoredStatus) -> io::Result<()> {
    if folder.path().exists() {
        fs::remove_dir_all(folder.path())?;
    }
    fs::create_dir(folder.path())?;
    scene.write(folder.paths())?;
    folder.write_status(status)?;
    folder.write_job(job)
}
