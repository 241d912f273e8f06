//! Names of the files in the folder of a job, for everybody who reads or writes one.
//!
//! ```text
//! job.json              the request; written once, by the submitter
//! scene.toml            the scene; beside it the files that it names
//! state.json            status of the job
//! progress.json         after every interaction
//! log.txt               standard error of the process
//! examples/00007.safetensors, examples/00007.rejected.json
//! database.safetensors, report.json
//! ```
//!
//! Two processes share the folder, and each file has one [`Writer`]: a process sweeps the temporaries of its own files only.

use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};

use crate::atomic_file::{remove_temporaries, remove_temporary_of};

const JOB: &str = "job.json";
const SCENE: &str = "scene.toml";
const STATE: &str = "state.json";
const PROGRESS: &str = "progress.json";
const LOG: &str = "log.txt";
const EXAMPLES: &str = "examples";
const DATABASE: &str = "database.safetensors";
const REPORT: &str = "report.json";
const LOCK: &str = ".lock";
/// Largest request, status or progress that is read.
pub const MAX_RECORD_BYTES: u64 = 1 << 20;
/// Ending of an accepted interaction.
const EXAMPLE: &str = ".safetensors";
/// Ending of a rejected interaction.
const REJECTION: &str = ".rejected.json";

/// Writer of a file in the folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writer {
    /// The submitter of the job, which keeps its status: the daemon, or the command that trains by hand.
    Submitter,
    /// The process that trains.
    Process,
}

/// Paths in the folder of a job, which need not exist.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobPaths(PathBuf);

impl JobPaths {
    /// Paths below `root`.
    pub fn new(root: PathBuf) -> Self {
        Self(root)
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.0
    }

    /// The request.
    pub fn job(&self) -> PathBuf {
        self.0.join(JOB)
    }

    /// The scene.
    pub fn scene(&self) -> PathBuf {
        self.0.join(SCENE)
    }

    /// Status of the job.
    pub fn state(&self) -> PathBuf {
        self.0.join(STATE)
    }

    /// TrainingProgress of the process.
    pub fn progress(&self) -> PathBuf {
        self.0.join(PROGRESS)
    }

    /// Log of the process.
    pub fn log(&self) -> PathBuf {
        self.0.join(LOG)
    }

    /// TrainingFolder of finished interactions.
    pub fn examples(&self) -> PathBuf {
        self.0.join(EXAMPLES)
    }

    /// An accepted interaction.
    pub fn example(&self, index: u32) -> PathBuf {
        self.examples().join(format!("{index:05}{EXAMPLE}"))
    }

    /// A rejected interaction.
    pub fn rejection(&self, index: u32) -> PathBuf {
        self.examples().join(format!("{index:05}{REJECTION}"))
    }

    /// The database.
    pub fn database(&self) -> PathBuf {
        self.0.join(DATABASE)
    }

    /// The report.
    pub fn report(&self) -> PathBuf {
        self.0.join(REPORT)
    }

    /// Locked by the process while it works.
    pub fn lock(&self) -> PathBuf {
        self.0.join(LOCK)
    }

    /// Counts finished interactions on disk: accepted, rejected.
    pub fn count_finished(&self) -> (u32, u32) {
        let mut counts = (0, 0);
        for entry in std::fs::read_dir(self.examples()).into_iter().flatten().flatten() {
            match entry.file_name().to_str() {
                Some(name) if name.starts_with('.') => {}
                Some(name) if name.ends_with(EXAMPLE) => counts.0 += 1,
                Some(name) if name.ends_with(REJECTION) => counts.1 += 1,
                _ => {}
            }
        }
        counts
    }

    /// Removes temporaries that a killed `writer` left. The caller is that writer's only successor.
    ///
    /// # Errors
    /// The system's.
    pub fn sweep(&self, writer: Writer) -> io::Result<()> {
        match writer {
            Writer::Submitter => {
                [self.job(), self.scene(), self.state()].iter().try_for_each(|f| remove_temporary_of(f))
            }
            Writer::Process => {
                [self.progress(), self.database(), self.report()].iter().try_for_each(|f| remove_temporary_of(f))?;
                remove_temporaries(&self.examples())
            }
        }
    }

    /// Whether `name`, the first part of a relative path, is a file or folder of the job itself: a scene may not bring it.
    pub fn is_reserved(name: &OsStr) -> bool {
        [JOB, SCENE, STATE, PROGRESS, LOG, EXAMPLES, DATABASE, REPORT, LOCK].iter().any(|own| name == *own)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use std::fs;

    use super::*;

    #[test]
    fn every_path_is_below_the_root_and_reserved() {
        let paths = JobPaths::new("job".into());
        for path in [
            paths.job(),
            paths.scene(),
            paths.state(),
            paths.progress(),
            paths.log(),
            paths.example(7),
            paths.rejection(7),
            paths.database(),
            paths.report(),
            paths.lock(),
        ] {
            let below = path.strip_prefix(paths.root()).unwrap();
            assert!(JobPaths::is_reserved(below.iter().next().unwrap()), "{}", path.display());
        }
        assert!(!JobPaths::is_reserved("tools".as_ref()));
    }

    #[test]
    fn a_writer_sweeps_its_own_temporaries_only() {
        let folder = tempfile::tempdir().unwrap();
        let paths = JobPaths::new(folder.path().to_owned());
        fs::create_dir(paths.examples()).unwrap();
        let (state, progress) = (folder.path().join(".state.json.tmp"), folder.path().join(".progress.json.tmp"));
        let example = paths.examples().join(".00002.safetensors.tmp");
        for half in [&state, &progress, &example] {
            fs::write(half, b"half").unwrap();
        }
        paths.sweep(Writer::Process).unwrap();
        assert!(state.exists() && !progress.exists() && !example.exists());
        paths.sweep(Writer::Submitter).unwrap();
        assert!(!state.exists());
    }

    #[test]
    fn finished_interactions_are_counted_and_temporaries_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let paths = JobPaths::new(folder.path().to_owned());
        assert_eq!(paths.count_finished(), (0, 0));
        fs::create_dir(paths.examples()).unwrap();
        for path in [paths.example(0), paths.example(3), paths.rejection(1)] {
            fs::write(path, "").unwrap();
        }
        fs::write(paths.examples().join(".00002.safetensors.tmp"), "").unwrap();
        assert_eq!(paths.count_finished(), (2, 1));
    }
}
