//! Folder of one job: request, status, log and results, in files that a person can read.
//!
//! The daemon writes `job.json`, `scene.toml` and `state.json`; the job's process writes everything else.

use std::fs;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use plica_protocol::jobs::{JobFile, JobState};
use plica_training::{
    JobPaths, MAX_RECORD_BYTES, RegularFile, TrainingJob, TrainingProgress, TrainingStage, write_json_atomically,
};
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
        let lock = RegularFile::open_unlinked(&self.0.lock(), u64::MAX);
        lock.is_ok_and(|mut lock| matches!(lock.file().try_lock(), Err(fs::TryLockError::WouldBlock)))
    }

    /// Sentence for clients, who are not told where the folder is.
    pub fn without_place(&self, sentence: &str) -> String {
        let place = self.path().display().to_string();
        sentence.replace(&format!("{place}/"), "").replace(&place, "the job's folder")
    }

    /// Bytes of all files in the folder.
    pub(crate) fn bytes(&self) -> u64 {
        bytes_below(self.path())
    }

    /// Last line of the log that is not blank.
    pub fn last_log_line(&self) -> Option<String> {
        let mut log = RegularFile::open_unlinked(&self.log(), u64::MAX).ok()?;
        let file = log.file();
        let length = file.seek(SeekFrom::End(0)).ok()?;
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES))).ok()?;
        let mut tail = Vec::new();
        file.take(TAIL_BYTES).read_to_end(&mut tail).ok()?;
        last_line(&String::from_utf8_lossy(&tail))
    }
}

fn bytes_below(folder: &Path) -> u64 {
    let bytes = |entry: fs::DirEntry| match entry.metadata() {
        Ok(metadata) if metadata.is_dir() => bytes_below(&entry.path()),
        Ok(metadata) => metadata.len(),
        Err(_) => 0,
    };
    fs::read_dir(folder).into_iter().flatten().flatten().map(bytes).sum()
}

/// Reads a JSON file; the error is a sentence that names it.
fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, String> {
    let read = RegularFile::open_unlinked(path, MAX_RECORD_BYTES).and_then(RegularFile::read);
    let text = read.map_err(|fault| format!("{} {fault}", path.display()))?;
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
    fn a_pipe_or_a_device_in_place_of_a_file_is_told_and_blocks_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let job = JobFolder::new(folder.path().to_owned());
        let paths = job.paths();
        for path in [paths.job(), paths.state(), paths.progress(), paths.log(), paths.lock()] {
            assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        }
        assert!(job.job().unwrap_err().contains("job.json is no regular file"));
        assert!(job.status().unwrap_err().contains("state.json is no regular file"));
        assert!(job.progress().is_none() && job.last_log_line().is_none() && !job.is_busy());
        fs::remove_file(paths.state()).unwrap();
        std::os::unix::fs::symlink("/dev/zero", paths.state()).unwrap();
        assert!(job.status().unwrap_err().contains("state.json is a link"));
        fs::remove_file(paths.state()).unwrap();
        fs::File::create(paths.state()).unwrap().set_len(1 << 40).unwrap();
        assert!(job.status().unwrap_err().contains("state.json has 1099511627776 bytes; at most 1048576 are read"));
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
