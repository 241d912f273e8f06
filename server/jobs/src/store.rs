//! All jobs of a data folder: in memory for queries, on disk for the next daemon.
//!
//! Queries lock memory only, so that a disk that hangs blocks no status. Writers take the disk's lock first.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use plica_protocol::jobs::{Job, JobListReply, JobState, MAX_LISTED};
use plica_training::{TrainingJob, TrainingProgress};

use crate::error::JobError;
use crate::folder::{JobFolder, StoredStatus};
use crate::keep::Keep;
use crate::view;

/// One job.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) folder: JobFolder,
    pub(crate) job: TrainingJob,
    pub(crate) status: StoredStatus,
    /// Last progress that the process has written.
    pub(crate) progress: Option<TrainingProgress>,
}

/// A job that an earlier daemon has left.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) entry: Entry,
    /// Whether its status differs from `state.json`.
    pub(crate) changed: bool,
}

/// An entry with the versions of its changes.
#[derive(Debug)]
struct Row {
    entry: Entry,
    /// Version of the last change.
    version: u64,
    /// Version in `state.json`.
    saved: u64,
    /// Bytes of its folder when they were counted last.
    bytes: u64,
    /// Whether they were counted since the job is over.
    measured: bool,
    /// Whether its process has not ended.
    has_process: bool,
}

#[derive(Debug, Default)]
struct Table {
    rows: BTreeMap<u32, Row>,
    version: u64,
    last_number: u32,
    /// Jobs that were removed since the start.
    removed: u32,
    /// Job whose examples enrich the skin.
    in_use: Option<u32>,
    /// Job whose examples are being read.
    being_read: Option<u32>,
}

impl Row {
    fn new(entry: Entry, version: u64, saved: u64, bytes: u64) -> Self {
        Self { entry, version, saved, bytes, measured: false, has_process: false }
    }

    fn is_over(&self) -> bool {
        self.entry.status.state.is_over()
    }
}

/// All jobs.
#[derive(Debug)]
pub(crate) struct Store {
    jobs: PathBuf,
    table: Mutex<Table>,
    disk: Mutex<()>,
}

impl Store {
    /// Store of the jobs found. `last_number`: largest number of any folder, whether it is a job or not.
    pub(crate) fn new(jobs: PathBuf, found: BTreeMap<u32, Found>, last_number: u32) -> Self {
        let row = |(number, Found { entry, changed })| (number, Row::new(entry, 1, (!changed).into(), 0));
        let rows = found.into_iter().map(row).collect();
        let table = Table { rows, version: 1, last_number, ..Table::default() };
        Self { jobs, table: Mutex::new(table), disk: Mutex::new(()) }
    }

    /// Parent of the job folders.
    pub(crate) fn jobs(&self) -> &PathBuf {
        &self.jobs
    }

    /// Next number that no job has used.
    pub(crate) fn next_number(&self) -> u32 {
        let mut table = self.lock();
        table.last_number += 1;
        table.last_number
    }

    /// Adds a job whose folder is complete and has `bytes`.
    pub(crate) fn insert(&self, number: u32, entry: Entry, bytes: u64) -> Job {
        let mut table = self.lock();
        table.version += 1;
        let row = Row::new(entry, table.version, table.version, bytes);
        let view = row.entry.view();
        table.rows.insert(number, row);
        view
    }

    /// Number of the job with an id.
    pub(crate) fn find(&self, id: &str) -> Result<u32, JobError> {
        let number = id.parse().ok().filter(|n| self.lock().rows.get(n).is_some_and(|row| row.entry.job.id == id));
        number.ok_or_else(|| self.unknown(id))
    }

    fn unknown(&self, id: &str) -> JobError {
        let shown: String = id.chars().take(64).collect();
        let table = self.lock();
        let was_given = id.parse().is_ok_and(|n: u32| n > 0 && n <= table.last_number);
        if was_given && table.removed > 0 { JobError::Removed(shown) } else { JobError::Unknown(shown) }
    }

    /// Bytes of the jobs that are not over.
    pub(crate) fn unfinished_bytes(&self) -> u64 {
        self.lock().rows.values().filter(|row| !row.is_over()).map(|row| row.bytes).sum()
    }

    /// Counts the bytes of jobs that are over since.
    pub(crate) fn measure(&self) {
        let is_new =
            |(number, row): (&u32, &Row)| (row.is_over() && !row.measured).then(|| (*number, row.entry.folder.clone()));
        let new: Vec<_> = self.lock().rows.iter().filter_map(is_new).collect();
        for (number, folder) in new {
            let bytes = folder.bytes();
            if let Some(row) = self.lock().rows.get_mut(&number).filter(|row| row.is_over()) {
                (row.bytes, row.measured) = (bytes, true);
            }
        }
    }

    /// The next finished job beyond the bounds, none of `staying`.
    pub(crate) fn excess(&self, keep: Keep, staying: &BTreeSet<u32>) -> Option<(u32, JobFolder)> {
        let table = self.lock();
        let over = || table.rows.iter().filter(|(_, row)| row.is_over());
        if over().count() <= keep.jobs && over().map(|(_, row)| row.bytes).sum::<u64>() <= keep.bytes {
            return None;
        }
        let removable = over().filter(|(number, _)| table.is_removable(**number) && !staying.contains(number));
        let (number, row) =
            removable.min_by_key(|(number, row)| (row.entry.status.state == JobState::Done, **number))?;
        Some((*number, row.entry.folder.clone()))
    }

    /// Takes a finished job out of the table; false if it must stay.
    pub(crate) fn forget(&self, number: u32) -> bool {
        let mut table = self.lock();
        let removable = table.is_removable(number);
        if removable {
            table.rows.remove(&number);
            table.removed += 1;
        }
        removable
    }

    /// Notes whether the process of a job has not ended.
    pub(crate) fn set_process(&self, number: u32, has_process: bool) {
        if let Some(row) = self.lock().rows.get_mut(&number) {
            row.has_process = has_process;
        }
    }

    /// Keeps a job while its examples are read.
    pub(crate) fn begin_use(&self, number: u32) {
        self.lock().being_read = Some(number);
    }

    /// Ends the reading of examples: those of a job, or of a file, enrich the skin now, or nothing has changed.
    pub(crate) fn end_use(&self, enriches: bool) {
        let mut table = self.lock();
        let read = table.being_read.take();
        if enriches {
            table.in_use = read;
        }
    }

    /// Job with a client id.
    pub(crate) fn find_client_id(&self, client_id: &str) -> Option<Entry> {
        self.lock().rows.values().find(|row| row.entry.job.client_id == client_id).map(|row| row.entry.clone())
    }

    /// One job.
    pub(crate) fn entry(&self, number: u32) -> Option<Entry> {
        self.lock().rows.get(&number).map(|row| row.entry.clone())
    }

    /// State of a job.
    pub(crate) fn state(&self, number: u32) -> Option<JobState> {
        self.lock().rows.get(&number).map(|row| row.entry.status.state)
    }

    /// Queued jobs, oldest first.
    pub(crate) fn queued(&self) -> Vec<(u32, JobFolder)> {
        let table = self.lock();
        let queued = table.rows.iter().filter(|(_, row)| row.entry.status.state == JobState::Queued);
        queued.map(|(number, row)| (*number, row.entry.folder.clone())).collect()
    }

    /// Number of jobs that have not ended.
    pub(crate) fn n_unfinished(&self) -> usize {
        self.lock().rows.values().filter(|row| !row.entry.status.state.is_over()).count()
    }

    /// The newest `most` jobs, oldest of them first.
    pub(crate) fn newest(&self, most: usize) -> Vec<Job> {
        let table = self.lock();
        let older = table.rows.len().saturating_sub(most);
        table.rows.values().skip(older).map(|row| row.entry.view()).collect()
    }

    /// Reply of `job_list`.
    pub(crate) fn list(&self) -> JobListReply {
        let jobs = self.newest(MAX_LISTED);
        let older = self.lock().rows.len().saturating_sub(jobs.len()) as u32;
        let removed = self.lock().removed;
        JobListReply { jobs, older, removed }
    }

    /// Present version, and the jobs changed since `version`.
    pub(crate) fn changed_since(&self, version: u64) -> (u64, Vec<Job>) {
        let table = self.lock();
        let changed = table.rows.values().filter(|row| row.version > version);
        (table.version, changed.map(|row| row.entry.view()).collect())
    }

    /// Changes the status of a job in memory and returns the result of `change`.
    pub(crate) fn change<T>(&self, number: u32, change: impl FnOnce(&mut StoredStatus) -> T) -> Option<T> {
        let mut table = self.lock();
        let version = table.version + 1;
        let row = table.rows.get_mut(&number)?;
        let before = row.entry.status.clone();
        let answer = change(&mut row.entry.status);
        if row.entry.status != before {
            row.version = version;
            row.measured = false;
            table.version = version;
        }
        Some(answer)
    }

    /// Stores the progress of a job's process.
    pub(crate) fn set_progress(&self, number: u32, progress: TrainingProgress) {
        let mut table = self.lock();
        let version = table.version + 1;
        let Some(row) = table.rows.get_mut(&number).filter(|row| row.entry.progress != Some(progress)) else { return };
        // Not saved here: the process has written its progress itself.
        let was_saved = row.saved == row.version;
        row.entry.progress = Some(progress);
        row.version = version;
        row.saved = if was_saved { version } else { row.saved };
        table.version = version;
    }

    /// Writes `state.json` of a job if its status has changed.
    pub(crate) fn save(&self, number: u32) -> io::Result<()> {
        let _disk = self.disk.lock().unwrap_or_else(PoisonError::into_inner);
        let unsaved = |row: &&Row| row.saved != row.version;
        let row = self.lock().rows.get(&number).filter(unsaved).map(|row| (row.entry.clone(), row.version));
        let Some((entry, version)) = row else { return Ok(()) };
        entry.folder.write_status(&entry.status)?;
        if let Some(row) = self.lock().rows.get_mut(&number) {
            row.saved = row.saved.max(version);
        }
        Ok(())
    }

    /// Writes every `state.json` that could not be written before.
    pub(crate) fn save_all(&self) {
        let unsaved: Vec<u32> =
            self.lock().rows.iter().filter(|(_, row)| row.saved != row.version).map(|(n, _)| *n).collect();
        for number in unsaved {
            // A failure is tried again at the next call.
            let _ = self.save(number);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Table {
    fn is_removable(&self, number: u32) -> bool {
        let is_newest = self.rows.last_key_value().is_some_and(|(newest, _)| *newest == number);
        let is_used = [self.in_use, self.being_read].contains(&Some(number));
        self.rows.get(&number).is_some_and(|row| row.is_over() && !row.has_process) && !is_used && !is_newest
    }
}

impl Entry {
    /// The job as clients see it.
    pub(crate) fn view(&self) -> Job {
        view::job(&self.job, &self.status, self.progress)
    }
}
