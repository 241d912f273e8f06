//! What a daemon finds in its data folder when it starts.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use plica_protocol::jobs::JobState;
use plica_training::Writer;

use crate::folder::{JobFolder, Standing};
use crate::store::{Entry, Found, Store};

/// Folder of a job that is being submitted; what is in it when a daemon starts was never acknowledged.
pub(crate) const SUBMITTING: &str = ".submitting";

/// Reads all jobs. Those that waited or ran when the last daemon ended, however it ended, are queued again.
pub(crate) fn recover(jobs: &Path) -> std::io::Result<Store> {
    if jobs.join(SUBMITTING).exists() {
        fs::remove_dir_all(jobs.join(SUBMITTING))?;
    }
    let mut found = BTreeMap::new();
    let mut last_number = 0;
    for entry in fs::read_dir(jobs)?.flatten() {
        let Some(number) = entry.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
        last_number = last_number.max(number);
        match read(&entry.path()) {
            Ok(job) => drop(found.insert(number, job)),
            Err(problem) => tracing::warn!("{} is not taken for a job: {problem}", entry.path().display()),
        }
    }
    Ok(Store::new(jobs.to_owned(), found, last_number))
}

fn read(path: &Path) -> Result<Found, String> {
    let folder = JobFolder::new(path.to_owned());
    let order = folder.job()?;
    if path.file_name().is_none_or(|name| name != order.id.as_str()) {
        return Err(format!("its job.json says that it is job {}", order.id));
    }
    if let Err(problem) = folder.paths().sweep(Writer::Submitter) {
        tracing::warn!("{}: leftovers cannot be removed: {problem}", path.display());
    }
    let written = folder.standing();
    if let Err(problem) = &written {
        tracing::warn!("{problem}; the job is queued");
    }
    let standing = written.clone().map_or_else(|_| Standing::queued(), resumed);
    let changed = written.ok().as_ref() != Some(&standing);
    let progress = folder.progress();
    Ok(Found { entry: Entry { folder, order, standing, progress }, changed })
}

fn resumed(standing: Standing) -> Standing {
    match standing.state {
        JobState::Done | JobState::Failed | JobState::Cancelled => standing,
        JobState::Queued | JobState::Running | JobState::Paused => {
            Standing { started_unix_s: standing.started_unix_s, ..Standing::queued() }
        }
    }
}
