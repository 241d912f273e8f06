//! Takes a job: everything that can be checked at once is checked, and it is on disk before its id is told.

use std::fs;
use std::io;
use std::path::Path;

use plica_protocol::jobs::{JobSubmitReply, JobSubmitRequest};
use plica_training::{TrainingJob, default_threads, now_unix_s, sync_folder};

use crate::error::JobError;
use crate::folder::{JobFolder, Standing};
use crate::recover::SUBMITTING;
use crate::scene::{JobScene, ServedScene};
use crate::store::{Entry, Store};
use crate::view;

/// Jobs that may wait.
const MAX_UNFINISHED: usize = 100;

/// The job of a request that has passed [`JobSubmitRequest::check`]: a new one, or the one with the same client id.
pub(crate) fn submit(
    store: &Store,
    request: &JobSubmitRequest,
    served: &ServedScene,
) -> Result<JobSubmitReply, JobError> {
    if let Some(entry) = store.find_client_id(&request.client_id) {
        same(&entry, request)?;
        return Ok(JobSubmitReply { created: false, job: entry.job() });
    }
    if store.n_unfinished() >= MAX_UNFINISHED {
        return Err(JobError::TooMany(MAX_UNFINISHED));
    }
    let scene = JobScene::new(request, served)?;
    let number = store.next_number();
    let order = order(request, &scene, format!("{number:04}"));
    let folder = JobFolder::new(store.jobs().join(&order.id));
    let standing = Standing::queued();
    make(store.jobs(), &folder, &scene, &order, &standing)
        .map_err(|e| JobError::Disk(format!("{}: {e}", folder.path().display())))?;
    let entry = Entry { folder, order, standing, progress: None };
    Ok(JobSubmitReply { created: true, job: store.insert(number, entry) })
}

/// Refuses a request that differs from that of the job with its client id. What it leaves out is not compared.
fn same(entry: &Entry, request: &JobSubmitRequest) -> Result<(), JobError> {
    let order = &entry.order;
    let scene = request.scene.as_ref().map(|text| fs::read(entry.folder.scene()).is_ok_and(|t| t == text.as_bytes()));
    let differs = [
        ("kind", order.kind != view::training_kind(request.kind)),
        ("examples", order.examples != request.examples),
        ("seed", order.seed != request.seed),
        ("threads", request.threads.is_some() && request.threads != order.threads),
        ("scene", scene == Some(false)),
    ];
    match differs.iter().find(|(_, differs)| *differs) {
        None => Ok(()),
        Some((what, _)) => Err(JobError::Conflict { client_id: request.client_id.clone(), id: order.id.clone(), what }),
    }
}

fn order(request: &JobSubmitRequest, scene: &JobScene, id: String) -> TrainingJob {
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

/// Makes the folder beside its place and moves it there: it is complete, or not there.
fn make(jobs: &Path, folder: &JobFolder, scene: &JobScene, order: &TrainingJob, standing: &Standing) -> io::Result<()> {
    let path = jobs.join(SUBMITTING);
    let made = fill(&JobFolder::new(path.clone()), scene, order, standing);
    let made = made.and_then(|()| fs::rename(&path, folder.path())).and_then(|()| sync_folder(jobs));
    if made.is_err() {
        let _ = fs::remove_dir_all(&path);
    }
    made
}

fn fill(folder: &JobFolder, scene: &JobScene, order: &TrainingJob, standing: &Standing) -> io::Result<()> {
    if folder.path().exists() {
        fs::remove_dir_all(folder.path())?;
    }
    fs::create_dir(folder.path())?;
    scene.write(folder.paths())?;
    folder.write_standing(standing)?;
    folder.write_job(order)
}
