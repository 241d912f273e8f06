//! Folder of one job: request, status, log and results, in files that a person can read.
//!
//! The daemon writes `job.json`, `scene.toml` and `state.json`; the job's process writes everything else.

use std::fs;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use plica_protocol::jobs::{JobFile, JobState};
use plica_training::{JobPaths, TrainingJob, TrainingProgress, TrainingStage, write_json_atomically};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Bytes that are read from the end of a log.
const TAIL_BYTES: u64 = 4096;
/// Characters of a log's last line that clients get at most.
const LINE_CHARS: usize = 400;

/// Status of a job as `state.json` stores it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredStatus {
    /// State, as in the protocol.
    pub state: JobState,
    /// Reason of the state, as a sentence.
    pub reason: Option<String>,
    /// Last start of the process \[s since 1970\].
    pub started_unix_s: Option<u64>,
    /// End of the job \[s since 1970\].
    pub finished_unix_s: Option<u64>,
    /// Process id while it runs.
    pub pid: Option<u32>,
}

impl StoredStatus {
    /// Status of a waiting job.
    pub fn queued() -> Self {
        Self { state: JobState::Queued, reason: None, started_unix_s: None, finished_unix_s: None, pid: None }
    }
}

/// A job's folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobFolder(JobPaths);

impl JobFolder {
    /// The folder at a path, which need not exist yet.
    pub fn new(path: PathBuf) -> Self {
        Self(JobPaths::new(path))
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.0.root()
    }

    /// Paths of its files.
    pub fn paths(&self) -> &JobPaths {
        &self.0
    }

    /// Path of the scene.
    pub fn scene(&self) -> PathBuf {
        self.0.scene()
    }

    /// Path of the log of the process.
    pub fn log(&self) -> PathBuf {
        self.0.log()
    }

    /// Path of a result, which exists once the job is done.
    pub fn result(&self, file: JobFile) -> PathBuf {
        match file {
            JobFile::Database => self.0.database(),
            JobFile::Report => self.0.report(),
        }
    }

    /// Reads `job.json`; the error is a sentence.
    pub fn job(&self) -> Result<TrainingJob, String> {
        read_json(&self.0.job())
    }

    /// Writes `job.json`.
    pub fn write_job(&self, job: &TrainingJob) -> io::Result<()> {
        write_json_atomically(&self.0.job(), job)
    }

    /// Reads `state.json`; the error is a sentence.
    pub fn status(&self) -> Result<StoredStatus, String> {
        read_json(&self.0.state())
    }

    /// Writes `state.json`.
    pub fn write_status(&self, status: &StoredStatus) -> io::Result<()> {
        write_json_atomically(&self.0.state(), status)
    }

    /// Content of `progress.json`; `None` before it exists. A restarted process reports no example until it has read those on
    /// disk, so in its first stage the files are counted instead.
    pub fn progress(&self) -> Option<TrainingProgress> {
        let progress: TrainingProgress = read_json(&self.0.progress()).ok()?;
        if progress.stage != TrainingStage::Interactions {
            return Some(progress);
        }
        let (done, rejected) = self.0.count_finished();
        Some(TrainingProgress { done, rejected, ..progress })
    }

    /// Whether a process holds the folder's lock: one started by hand, or one that is still ending.
    pub fn is_busy(&self) -> bool {
        let lock = fs::File::open(self.0.lock());
        lock.is_ok_and(|lock| matches!(lock.try_lock(), Err(fs::TryLockError::WouldBlock)))
    }

    /// Last line of the log that is not blank.
    pub fn last_log_line(&self) -> Option<String> {
        let mut file = fs::File::open(self.log()).ok()?;
        let length = file.seek(SeekFrom::End(0)).ok()?;
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES))).ok()?;
        let mut tail = Vec::new();
        file.take(TAIL_BYTES).read_to_end(&mut tail).ok()?;
        last_line(&String::from_utf8_lossy(&tail))
    }
}

/// Reads a JSON file; the error is a sentence that names it.
fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, String> {
    let text = fs::read(path).map_err(|e| format!("{} cannot be read: {e}", path.display()))?;
    serde_json::from_slice(&text).map_err(|e| format!("{} is not what it should be: {e}", path.display()))
}

fn last_line(text: &str) -> Option<String> {
    let line = text.lines().rev().map(str::trim).find(|line| !line.is_empty())?;
    let line = line.strip_prefix("plicad: ").unwrap_or(line);
    Some(line.chars().filter(|c| !c.is_control()).take(LINE_CHARS).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn the_last_line_is_the_last_one_that_is_not_blank() {
        assert_eq!(last_line("one\nplicad: two \n\n  \n").as_deref(), Some("two"));
        assert_eq!(last_line("\u{1b}[31mred\n").as_deref(), Some("[31mred"));
        assert_eq!(last_line("\n \n"), None);
        assert_eq!(last_line(&"x".repeat(9999)).unwrap().len(), LINE_CHARS);
    }

    #[test]
    fn files_have_the_keys_of_the_page() {
        let folder = tempfile::tempdir().unwrap();
        let job = JobFolder::new(folder.path().to_owned());
        job.write_status(&StoredStatus::queued()).unwrap();
        let text = fs::read_to_string(job.paths().state()).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let keys: Vec<_> = json.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(keys, ["finished_unix_s", "pid", "reason", "started_unix_s", "state"]);
        assert_eq!(job.status().unwrap(), StoredStatus::queued());
        let progress = r#"{"stage": "examples", "done": 3, "rejected": 1, "total": 8, "seconds_left": null}"#;
        fs::write(job.paths().progress(), progress).unwrap();
        let progress = job.progress().unwrap();
        assert_eq!((progress.done, progress.rejected, progress.total), (3, 1, 8));
        let beginning = r#"{"stage": "interactions", "done": 0, "rejected": 0, "total": 8, "seconds_left": null}"#;
        fs::write(job.paths().progress(), beginning).unwrap();
        fs::create_dir(job.paths().examples()).unwrap();
        for name in ["00000.safetensors", "00003.safetensors", "00001.rejected.json", ".00002.safetensors.tmp"] {
            fs::write(job.paths().examples().join(name), "").unwrap();
        }
        let progress = job.progress().unwrap();
        assert_eq!((progress.done, progress.rejected, progress.total), (2, 1, 8), "what is on disk");
        assert!(job.job().unwrap_err().contains("job.json cannot be read"));
        assert_eq!(job.last_log_line(), None);
    }

    #[test]
    fn a_folder_is_busy_while_a_process_holds_its_lock() {
        let folder = tempfile::tempdir().unwrap();
        let job = JobFolder::new(folder.path().to_owned());
        assert!(!job.is_busy());
        let held = plica_training::TrainingFolder::open(folder.path()).unwrap();
        assert!(job.is_busy());
        drop(held);
        assert!(!job.is_busy());
    }
}
