//! One job's folder: what was asked, where it stands, what came of it. All of it is text that a person can read.
//!
//! The daemon writes `job.json`, `scene.toml` and `state.json`; the job's process writes everything else.

use std::fs;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use plica_protocol::jobs::{JobFile, JobKind, JobState};
use serde::{Deserialize, Serialize};

use super::files::{read_json, to_json, write_atomically};

/// How much of the end of a log is looked at.
const TAIL_BYTES: u64 = 4096;
/// Longest last line that is repeated to clients, in characters.
const LINE_CHARS: usize = 400;

/// `job.json`: what was asked; written once.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Order {
    /// Name of the folder.
    pub id: String,
    /// Chosen by the client.
    pub client_id: String,
    /// What to make.
    pub kind: JobKind,
    /// Name of the scene, for people.
    pub scene_name: String,
    /// How many examples; null: what the scene says.
    pub examples: Option<u32>,
    /// Seed of the interactions; null: what the scene says.
    pub seed: Option<u64>,
    /// Threads.
    pub threads: u32,
    /// Seconds since 1970.
    pub submitted_unix_s: u64,
}

/// `state.json`: where the job stands.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Standing {
    /// One of the states of the protocol.
    pub state: JobState,
    /// Why, in words.
    pub reason: Option<String>,
    /// When the process was last started, in seconds since 1970.
    pub started_unix_s: Option<u64>,
    /// When the job ended, in seconds since 1970.
    pub finished_unix_s: Option<u64>,
    /// The process, while it runs.
    pub pid: Option<u32>,
}

impl Standing {
    /// A job that waits.
    pub fn queued() -> Self {
        Self { state: JobState::Queued, reason: None, started_unix_s: None, finished_unix_s: None, pid: None }
    }
}

/// `progress.json`: what the process says of itself after each example.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Report {
    /// What it does.
    pub stage: Option<String>,
    /// Finished examples.
    pub done: u32,
    /// Rejected ones.
    pub rejected: u32,
    /// All.
    pub total: u32,
    /// Estimate \[s\].
    pub seconds_left: Option<f64>,
}

/// A job's folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobFolder(PathBuf);

impl JobFolder {
    /// The folder at a path, which need not exist yet.
    pub fn new(path: PathBuf) -> Self {
        Self(path)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Where the scene is.
    pub fn scene(&self) -> PathBuf {
        self.0.join("scene.toml")
    }

    /// Where the process writes its log.
    pub fn log(&self) -> PathBuf {
        self.0.join("log.txt")
    }

    /// Where a result is, once the job is done.
    pub fn result(&self, file: JobFile) -> PathBuf {
        self.0.join(match file {
            JobFile::Database => "database.safetensors",
            JobFile::Report => "report.json",
        })
    }

    /// Reads `job.json`; the error is a sentence.
    pub fn order(&self) -> Result<Order, String> {
        read_json(&self.0.join("job.json"))
    }

    /// Writes `job.json`.
    pub fn write_order(&self, order: &Order) -> io::Result<()> {
        write_atomically(&self.0.join("job.json"), &to_json(order))
    }

    /// Reads `state.json`; the error is a sentence.
    pub fn standing(&self) -> Result<Standing, String> {
        read_json(&self.0.join("state.json"))
    }

    /// Writes `state.json`.
    pub fn write_standing(&self, standing: &Standing) -> io::Result<()> {
        write_atomically(&self.0.join("state.json"), &to_json(standing))
    }

    /// Reads `progress.json`; `None` before there is one.
    pub fn report(&self) -> Option<Report> {
        read_json(&self.0.join("progress.json")).ok()
    }

    /// The last line of the log that says something.
    pub fn last_words(&self) -> Option<String> {
        let mut file = fs::File::open(self.log()).ok()?;
        let length = file.seek(SeekFrom::End(0)).ok()?;
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES))).ok()?;
        let mut tail = Vec::new();
        file.take(TAIL_BYTES).read_to_end(&mut tail).ok()?;
        last_line(&String::from_utf8_lossy(&tail))
    }
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
    fn the_last_line_is_the_last_that_says_something() {
        assert_eq!(last_line("one\nplicad: two \n\n  \n").as_deref(), Some("two"));
        assert_eq!(last_line("\u{1b}[31mred\n").as_deref(), Some("[31mred"));
        assert_eq!(last_line("\n \n"), None);
        assert_eq!(last_line(&"x".repeat(9999)).unwrap().len(), LINE_CHARS);
    }

    #[test]
    fn files_have_the_keys_of_the_page() {
        let folder = tempfile::tempdir().unwrap();
        let job = JobFolder::new(folder.path().to_owned());
        job.write_standing(&Standing::queued()).unwrap();
        let text = fs::read_to_string(folder.path().join("state.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let keys: Vec<_> = json.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(keys, ["finished_unix_s", "pid", "reason", "started_unix_s", "state"]);
        assert_eq!(job.standing().unwrap(), Standing::queued());
        fs::write(folder.path().join("progress.json"), r#"{"stage": "examples", "done": 3, "total": 8}"#).unwrap();
        let report = job.report().unwrap();
        assert_eq!((report.done, report.rejected, report.total), (3, 0, 8));
        assert!(job.order().unwrap_err().contains("job.json cannot be read"));
        assert_eq!(job.last_words(), None);
    }
}
