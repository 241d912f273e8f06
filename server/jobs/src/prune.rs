//! Removes finished jobs beyond the bounds.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::keep::{Keep, REMOVING};
use crate::store::Store;

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
