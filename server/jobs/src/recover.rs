//! Jobs in the data folder when a daemon starts.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use plica_protocol::jobs::JobState;
use plica_training::Writer;

use crate::folder::{JobFolder, StoredStatus};
use crate::keep::REMOVING;
use crate::store::{Entry, Found, Store};

/// Folder of an incomplete submission; one that a daemon finds at its start was never acknowledged.
pub(crate) const SUBMITTING: &str = ".submitting";

/// Numbers of jobs stay below.
const MAX_NUMBER: u32 = 1 << 30;

/// Reads all jobs. Jobs that were queued, running or paused are queued again, however the last daemon ended.
pub(crate) fn recover(jobs: &Path) -> std::io::Result<Store> {
    if jobs.join(SUBMITTING).exists() {
        fs::remove_dir_all(jobs.join(SUBMITTING))?;
    }
    let mut found = BTreeMap::new();
    let mut last_number = 0;
    for entry in fs::read_dir(jobs)?.flatten() {
        let name = entry.file_name();
        if name.to_str().is_some_and(|name| name.starts_with(REMOVING)) {
            fs::remove_dir_all(entry.path())?;
        }
        let Some(number) = name.to_str().and_then(|name| name.parse().ok()).filter(|n| *n < MAX_NUMBER) else {
            continue;
        };
        last_number = last_number.max(number);
        match read(&entry.path()) {
            Ok(job) => drop(found.insert(number, job)),
            Err(problem) => tracing::warn!("{} is not a job: {problem}", entry.path().display()),
        }
    }
    Ok(Store::new(jobs.to_owned(), found, last_number))
}

fn read(path: &Path) -> Result<Found, String> {
    let folder = JobFolder::new(path.to_owned());
    let job = folder.job()?;
    if path.file_name().is_none_or(|name| name != job.id.as_str()) {
        return Err(format!("its job.json is that of job {}", job.id));
    }
    if let Err(problem) = folder.paths().sweep(Writer::Submitter) {
        tracing::warn!("{}: unfinished files cannot be removed: {problem}", path.display());
    }
    let written = folder.status();
    if let Err(problem) = &written {
        tracing::warn!("{problem}; the job is queued");
    }
    let status = written.clone().map_or_else(|_| StoredStatus::queued(), resumed);
    let changed = written.ok().as_ref() != Some(&status);
    let progress = folder.progress();
    Ok(Found { entry: Entry { folder, job, status, progress }, changed })
}

fn resumed(status: StoredStatus) -> StoredStatus {
    match status.state {
        JobState::Done | JobState::Failed | JobState::Cancelled => status,
        JobState::Queued | JobState::Running | JobState::Paused => {
            StoredStatus { started_unix_s: status.started_unix_s, ..StoredStatus::queued() }
        }
    }
}
