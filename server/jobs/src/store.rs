//! All jobs of a data folder: in memory for questions, on disk for the next daemon.
//!
//! Questions lock memory only, so that a disk that hangs holds up no status. Writers take the disk's lock first.

use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use plica_protocol::jobs::{Job, JobListReply, JobState, MAX_LISTED};
use plica_training::{TrainingJob, TrainingProgress};

use crate::error::JobError;
use crate::folder::{JobFolder, Standing};
use crate::view;

/// One job.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) folder: JobFolder,
    pub(crate) order: TrainingJob,
    pub(crate) standing: Standing,
    /// What the process has said of itself.
    pub(crate) progress: Option<TrainingProgress>,
}

/// A job of an earlier daemon.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) entry: Entry,
    /// Whether it stands elsewhere now than its `state.json` says.
    pub(crate) changed: bool,
}

/// An entry, and what has become of its changes.
#[derive(Debug)]
struct Row {
    entry: Entry,
    /// Version of the last change.
    version: u64,
    /// Version that `state.json` holds.
    saved: u64,
}

#[derive(Debug, Default)]
struct Table {
    rows: BTreeMap<u32, Row>,
    version: u64,
    last_number: u32,
}

/// All jobs.
#[derive(Debug)]
pub(crate) struct Store {
    jobs: PathBuf,
    table: Mutex<Table>,
    disk: Mutex<()>,
}

impl Store {
    /// `last_number`: the largest number that any folder has, a job or not.
    pub(crate) fn new(jobs: PathBuf, found: BTreeMap<u32, Found>, last_number: u32) -> Self {
        let row = |(number, Found { entry, changed })| (number, Row { entry, version: 1, saved: (!changed).into() });
        let table = Table { rows: found.into_iter().map(row).collect(), version: 1, last_number };
        Self { jobs, table: Mutex::new(table), disk: Mutex::new(()) }
    }

    /// The folder of all jobs.
    pub(crate) fn jobs(&self) -> &PathBuf {
        &self.jobs
    }

    /// A number that no job has had.
    pub(crate) fn next_number(&self) -> u32 {
        let mut table = self.lock();
        table.last_number += 1;
        table.last_number
    }

    /// A job whose folder is complete.
    pub(crate) fn insert(&self, number: u32, entry: Entry) -> Job {
        let mut table = self.lock();
        table.version += 1;
        let row = Row { entry, version: table.version, saved: table.version };
        let job = row.entry.job();
        table.rows.insert(number, row);
        job
    }

    /// Number of a job.
    pub(crate) fn find(&self, id: &str) -> Result<u32, JobError> {
        let number = id.parse().ok().filter(|n| self.lock().rows.get(n).is_some_and(|row| row.entry.order.id == id));
        number.ok_or_else(|| JobError::Unknown(id.chars().take(64).collect()))
    }

    /// The job that a client has submitted.
    pub(crate) fn find_client_id(&self, client_id: &str) -> Option<Entry> {
        self.lock().rows.values().find(|row| row.entry.order.client_id == client_id).map(|row| row.entry.clone())
    }

    /// One job.
    pub(crate) fn entry(&self, number: u32) -> Option<Entry> {
        self.lock().rows.get(&number).map(|row| row.entry.clone())
    }

    /// Where a job stands.
    pub(crate) fn state(&self, number: u32) -> Option<JobState> {
        self.lock().rows.get(&number).map(|row| row.entry.standing.state)
    }

    /// The queue.
    pub(crate) fn queued(&self) -> Vec<(u32, JobFolder)> {
        let table = self.lock();
        let queued = table.rows.iter().filter(|(_, row)| row.entry.standing.state == JobState::Queued);
        queued.map(|(number, row)| (*number, row.entry.folder.clone())).collect()
    }

    /// How many jobs are not over.
    pub(crate) fn n_unfinished(&self) -> usize {
        self.lock().rows.values().filter(|row| !row.entry.standing.state.is_over()).count()
    }

    /// The newest `most` jobs, oldest first.
    pub(crate) fn newest(&self, most: usize) -> Vec<Job> {
        let table = self.lock();
        let older = table.rows.len().saturating_sub(most);
        table.rows.values().skip(older).map(|row| row.entry.job()).collect()
    }

    /// Reply of `job_list`.
    pub(crate) fn list(&self) -> JobListReply {
        let jobs = self.newest(MAX_LISTED);
        let older = self.lock().rows.len().saturating_sub(jobs.len()) as u32;
        JobListReply { jobs, older }
    }

    /// Jobs that have changed since a version, and the version now.
    pub(crate) fn changed_since(&self, version: u64) -> (u64, Vec<Job>) {
        let table = self.lock();
        let changed = table.rows.values().filter(|row| row.version > version);
        (table.version, changed.map(|row| row.entry.job()).collect())
    }

    /// Changes where a job stands, in memory; `change` decides on the spot, and what it answers comes back.
    pub(crate) fn change<T>(&self, number: u32, change: impl FnOnce(&mut Standing) -> T) -> Option<T> {
        let mut table = self.lock();
        let version = table.version + 1;
        let row = table.rows.get_mut(&number)?;
        let before = row.entry.standing.clone();
        let answer = change(&mut row.entry.standing);
        if row.entry.standing != before {
            row.version = version;
            table.version = version;
        }
        Some(answer)
    }

    /// What a job's process says of itself.
    pub(crate) fn tell(&self, number: u32, progress: TrainingProgress) {
        let mut table = self.lock();
        let version = table.version + 1;
        let Some(row) = table.rows.get_mut(&number).filter(|row| row.entry.progress != Some(progress)) else { return };
        // Nothing to save: the process has written it.
        let was_saved = row.saved == row.version;
        row.entry.progress = Some(progress);
        row.version = version;
        row.saved = if was_saved { version } else { row.saved };
        table.version = version;
    }

    /// Writes `state.json` of a job, if it does not hold the present state already.
    pub(crate) fn save(&self, number: u32) -> io::Result<()> {
        let _disk = self.disk.lock().unwrap_or_else(PoisonError::into_inner);
        let unsaved = |row: &&Row| row.saved != row.version;
        let row = self.lock().rows.get(&number).filter(unsaved).map(|row| (row.entry.clone(), row.version));
        let Some((entry, version)) = row else { return Ok(()) };
        entry.folder.write_standing(&entry.standing)?;
        if let Some(row) = self.lock().rows.get_mut(&number) {
            row.saved = row.saved.max(version);
        }
        Ok(())
    }

    /// Tries again what could not be written before.
    pub(crate) fn save_all(&self) {
        let unsaved: Vec<u32> =
            self.lock().rows.iter().filter(|(_, row)| row.saved != row.version).map(|(n, _)| *n).collect();
        for number in unsaved {
            // What fails again is tried again.
            let _ = self.save(number);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entry {
    /// The job as clients see it.
    pub(crate) fn job(&self) -> Job {
        view::job(&self.order, &self.standing, self.progress)
    }
}
