//! Bounds of the finished jobs that are kept, and the removal of those beyond.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::store::Store;

/// Beginning of the name of a folder that is being removed; a daemon that finds one at its start goes on.
pub(crate) const REMOVING: &str = ".removing-";

/// Bounds of the jobs in a data folder. Beyond them finished jobs are removed: cancelled and failed ones first, then those
/// that are done, each time the oldest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Keep {
    /// Finished jobs.
    pub jobs: usize,
    /// Bytes of all finished jobs; unfinished ones have as much room again.
    pub bytes: u64,
}

impl Default for Keep {
    fn default() -> Self {
        Self { jobs: 200, bytes: 8 << 30 }
    }
}

/// Removes finished jobs beyond the bounds. Jobs that wait or run, whose process has not ended, or whose examples are in use
/// stay, and so does the newest, so that no id is given twice.
pub(crate) fn prune(store: &Store, keep: Keep) {
    let mut staying = BTreeSet::new();
    while let Some((number, folder)) = store.excess(keep, &staying) {
        if folder.is_busy() || !store.forget(number) {
            staying.insert(number);
            continue;
        }
        match remove(store.jobs(), folder.path()) {
            Ok(()) => tracing::info!(
                "finished job {number:04} is removed: {} jobs and {} bytes are kept (--keep-jobs, --keep-bytes)",
                keep.jobs,
                keep.bytes
            ),
            Err(e) => tracing::warn!("finished job {number:04} cannot be removed, {}: {e}", folder.path().display()),
        }
    }
}

/// Renames the folder first, so that it is a whole job or none.
fn remove(jobs: &Path, folder: &Path) -> std::io::Result<()> {
    let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let leaving = jobs.join(format!("{REMOVING}{name}"));
    fs::rename(folder, &leaving)?;
    fs::remove_dir_all(&leaving)
}
