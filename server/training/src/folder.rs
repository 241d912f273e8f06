//! The folder of a job as the process that trains holds it: locked, its request checked, its results stored atomically.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::atomic_file::write_json_atomically;
use crate::database::{About, Database, DatabaseKind};
use crate::database_error::DatabaseError;
use crate::error::TrainingError;
use crate::example::{Example, Outcome, Rejection};
use crate::job_folder::{JobPaths, MAX_RECORD_BYTES, Writer};
use crate::regular_file::{FileFault, RegularFile};

/// What a job was asked for, `job.json`. What is left out is the scene's to say.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrainingJob {
    /// Name of the job.
    pub id: String,
    /// Chosen by the client that submitted it.
    pub client_id: String,
    /// What the examples are for.
    pub kind: DatabaseKind,
    /// Name of the scene, for people.
    pub scene_name: String,
    /// How many examples; of an evaluation: in the trained region.
    #[serde(default)]
    pub examples: Option<u32>,
    /// Seed of the interactions.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Threads.
    #[serde(default)]
    pub threads: Option<u32>,
    /// When it was submitted \[s since 1970\].
    pub submitted_unix_s: u64,
}

/// Where a job stands, `progress.json`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingProgress {
    /// What it is at.
    pub stage: TrainingStage,
    /// Examples that are on the disk.
    pub done: u32,
    /// Interactions that gave none.
    pub rejected: u32,
    /// Interactions in all.
    pub total: u32,
    /// Estimate \[s\]; `None` before the first interaction of this run is finished.
    pub seconds_left: Option<f64>,
}

/// What a job is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrainingStage {
    /// Draws interactions and builds the models.
    Interactions,
    /// Solves them.
    Examples,
    /// Writes the database.
    Database,
}

/// The folder of a job.
#[derive(Debug)]
pub struct TrainingFolder {
    paths: JobPaths,
    /// Held while the folder is open: two processes at one job would do everything twice.
    _lock: File,
}

impl TrainingFolder {
    /// Opens the folder, makes what it lacks, and clears away what a killed process left half written.
    ///
    /// # Errors
    /// It cannot be written, or another process works in it.
    pub fn open(root: &Path) -> Result<Self, TrainingError> {
        let paths = JobPaths::new(root.to_owned());
        let examples = paths.examples();
        let at = |path: &Path| {
            let path = path.to_owned();
            move |error| TrainingError::Io { path, error }
        };
        fs::create_dir_all(&examples).map_err(at(&examples))?;
        let lock_path = paths.lock();
        let lock = File::create(&lock_path).map_err(at(&lock_path))?;
        lock.try_lock().map_err(|e| match e {
            TryLockError::WouldBlock => TrainingError::File {
                path: root.to_owned(),
                problem: "another process works in this folder; wait for it or stop it".into(),
            },
            TryLockError::Error(error) => TrainingError::Io { path: lock_path.clone(), error },
        })?;
        paths.sweep(Writer::Process).map_err(at(root))?;
        Ok(Self { paths, _lock: lock })
    }

    /// Paths of its files.
    pub fn paths(&self) -> &JobPaths {
        &self.paths
    }

    /// What was asked.
    ///
    /// # Errors
    /// `job.json` is missing or not what it should be.
    pub fn job(&self) -> Result<TrainingJob, TrainingError> {
        let path = self.paths.job();
        match read_json(&path)? {
            Some(job) => Ok(job),
            None => Err(TrainingError::File { path, problem: "is missing: this is no job folder".into() }),
        }
    }

    /// States what is asked. A folder that holds another job already is refused.
    ///
    /// # Errors
    /// It cannot be written, or belongs to another job.
    pub fn set_job(&self, job: &TrainingJob) -> Result<(), TrainingError> {
        let path = self.paths.job();
        let asks = |j: &TrainingJob| (j.kind, j.examples, j.seed);
        if let Some(found) = read_json::<TrainingJob>(&path)?.filter(|found| asks(found) != asks(job)) {
            let or_scene = |n: Option<String>| n.unwrap_or_else(|| "the scene's number of".into());
            let problem = format!(
                "the folder holds another job ({}, {} examples, {}); choose another folder, or remove this one",
                found.kind.name(),
                or_scene(found.examples.map(|n| n.to_string())),
                found.seed.map_or_else(|| "the scene's seed".to_owned(), |seed| format!("seed {seed}"))
            );
            return Err(TrainingError::File { path, problem });
        }
        write_json(&path, job)
    }

    /// States where the job stands.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn set_progress(&self, progress: &TrainingProgress) -> Result<(), TrainingError> {
        write_json(&self.paths.progress(), progress)
    }

    /// Writes the report.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn set_report(&self, report: &impl Serialize) -> Result<(), TrainingError> {
        write_json(&self.paths.report(), report)
    }

    /// Puts a finished interaction on the disk.
    ///
    /// # Errors
    /// It cannot be written; a full disk is the usual cause.
    pub fn store(&self, about: &About, outcome: &Outcome) -> Result<(), TrainingError> {
        match outcome {
            Outcome::Accepted(example) => {
                let path = self.paths.example(example.record.index);
                let one = Database { about: about.clone(), examples: vec![(**example).clone()], rejected: Vec::new() };
                one.write(&path).map_err(from_database)
            }
            Outcome::Rejected(rejection) => {
                let stored = StoredRejection { about: about.clone(), rejection: rejection.clone() };
                write_json(&self.paths.rejection(rejection.index), &stored)
            }
        }
    }

    /// What became of an interaction, if it is finished. A file that is damaged counts as not finished.
    ///
    /// # Errors
    /// It belongs to another scene, version or plan: going on would mix two jobs.
    pub fn finished(&self, about: &About, index: u32, fingerprint: &str) -> Result<Option<Outcome>, TrainingError> {
        let path = self.paths.example(index);
        let (path, found, outcome) = if path.exists() {
            match self.read_example(&path)? {
                Some((found, example)) => {
                    (path, (found, example.record.interaction_sha256.clone()), Outcome::Accepted(Box::new(example)))
                }
                None => return Ok(None),
            }
        } else {
            let path = self.paths.rejection(index);
            match read_json::<StoredRejection>(&path) {
                Ok(Some(StoredRejection { about, rejection })) => {
                    (path, (about, rejection.interaction_sha256.clone()), Outcome::Rejected(rejection))
                }
                Ok(None) | Err(TrainingError::File { .. }) => return Ok(None),
                Err(error) => return Err(error),
            }
        };
        if found == (about.clone(), fingerprint.to_owned()) {
            return Ok(Some(outcome));
        }
        let problem = if found.0.scene_hash == about.scene_hash {
            "was made for another plan or version; choose another folder, or remove this one"
        } else {
            "was made for another scene; choose another folder, or remove this one"
        };
        Err(TrainingError::File { path, problem: problem.into() })
    }

    fn read_example(&self, path: &Path) -> Result<Option<(About, Example)>, TrainingError> {
        match Database::read(path, None) {
            Ok(mut one) if one.examples.len() == 1 => Ok(Some((one.about, one.examples.remove(0)))),
            Ok(_) | Err(DatabaseError::Malformed { .. } | DatabaseError::Damaged { .. }) => Ok(None),
            Err(error) => Err(from_database(error)),
        }
    }
}

/// A rejection as it lies beside the examples.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredRejection {
    about: About,
    rejection: Rejection,
}

/// An error of writing keeps the advice for a full disk.
pub(crate) fn from_database(error: DatabaseError) -> TrainingError {
    match error {
        DatabaseError::Io { path, error } => TrainingError::Io { path, error },
        other => TrainingError::Database(other),
    }
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), TrainingError> {
    write_json_atomically(path, value).map_err(|error| TrainingError::Io { path: path.to_owned(), error })
}

/// `None` if there is no such file.
fn read_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, TrainingError> {
    let read = RegularFile::open_unlinked(path, MAX_RECORD_BYTES).and_then(RegularFile::read);
    let file = |problem| TrainingError::File { path: path.to_owned(), problem };
    let text = match read {
        Err(FileFault::Io(e)) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(FileFault::Io(error)) => return Err(TrainingError::Io { path: path.to_owned(), error }),
        Err(fault) => return Err(file(fault.to_string())),
        Ok(text) => text,
    };
    let value = serde_json::from_slice(&text);
    value.map(Some).map_err(|e| file(format!("is damaged: {e}")))
}
