//! Data folder of a daemon, locked so that no other daemon uses it.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use plica_training::now_unix_s;
use serde::{Deserialize, Serialize};

/// Why a data folder cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DataFolderError {
    /// Locked by another daemon; this one must not start.
    #[error(
        "the data folder {folder} is in use by another plicad{owner}; stop that one, or choose another folder with --data"
    )]
    Locked {
        /// The folder.
        folder: String,
        /// Process and session, if known.
        owner: String,
    },
    /// Not readable or not writable; the daemon simulates, and accepts no jobs.
    #[error(
        "the data folder {folder} cannot be used: {problem}; make it writable, or choose another folder with --data"
    )]
    Unusable {
        /// The folder.
        folder: String,
        /// Error of the operating system.
        problem: String,
    },
}

/// A locked data folder. The lock is released with the value, or when the process ends in any way.
#[derive(Debug)]
pub struct DataFolder {
    path: PathBuf,
    _lock: File,
}

/// Content of the lock file: for people, and for the error message of a second daemon.
#[derive(Debug, Serialize, Deserialize)]
struct Owner {
    pid: u32,
    session: String,
    started_unix_s: u64,
}

impl DataFolderError {
    /// The error for clients, who are not told where the folder is.
    pub fn without_place(&self) -> String {
        match self {
            Self::Locked { .. } => "the data folder is in use by another plicad".to_owned(),
            Self::Unusable { problem, .. } => format!(
                "the data folder cannot be used: {problem}; make it writable, or start plicad with another one (--data)"
            ),
        }
    }
}

impl DataFolder {
    /// Locks the folder; makes it if it does not exist.
    pub fn open(path: &Path, session: &str) -> Result<Self, DataFolderError> {
        let folder = path.display().to_string();
        let unusable = |e: io::Error| DataFolderError::Unusable { folder: folder.clone(), problem: e.to_string() };
        fs::create_dir_all(path.join("jobs")).map_err(unusable)?;
        let path = path.canonicalize().map_err(unusable)?;
        let mut lock = open_lock(&path.join("lock")).map_err(unusable)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(DataFolderError::Locked { folder, owner: owner(&mut lock) }),
            Err(TryLockError::Error(e)) => return Err(unusable(e)),
        }
        sign(&mut lock, session).map_err(unusable)?;
        Ok(Self { path, _lock: lock })
    }

    /// The folder, absolute.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Parent of the job folders.
    pub fn jobs(&self) -> PathBuf {
        self.path.join("jobs")
    }
}

/// `$XDG_DATA_HOME/plica/<session>`, or `~/.local/share/plica/<session>`; the error is a sentence.
pub fn default_path(session: &str) -> Result<PathBuf, String> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let shared = absolute("XDG_DATA_HOME").or_else(|| absolute("HOME").map(|home| home.join(".local/share")));
    let shared = shared.ok_or("neither XDG_DATA_HOME nor HOME names a folder: choose a data folder with --data")?;
    if session.chars().all(|c| c == '.') {
        return Err(format!("no folder can be named after the session `{session}`: choose a data folder with --data"));
    }
    Ok(shared.join("plica").join(session))
}

fn open_lock(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)
}

fn sign(lock: &mut File, session: &str) -> io::Result<()> {
    let owner = Owner { pid: std::process::id(), session: session.to_owned(), started_unix_s: now_unix_s() };
    lock.set_len(0)?;
    lock.rewind()?;
    serde_json::to_writer_pretty(&*lock, &owner)?;
    lock.write_all(b"\n")
}

fn owner(lock: &mut File) -> String {
    let mut text = String::new();
    let read = lock.take(4096).read_to_string(&mut text).ok().and_then(|_| serde_json::from_str::<Owner>(&text).ok());
    read.map_or_else(String::new, |o| format!(" (process {}, session `{}`)", o.pid, o.session))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn a_folder_has_one_daemon() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/data");
        let first = DataFolder::open(&path, "main").unwrap();
        let error = DataFolder::open(&path, "other").unwrap_err().to_string();
        let pid = format!("process {}, session `main`", std::process::id());
        for part in [path.to_str().unwrap(), &pid, "stop that one", "--data"] {
            assert!(error.contains(part), "{part} in {error}");
        }
        drop(first);
        DataFolder::open(&path, "other").unwrap();
    }

    #[test]
    fn a_folder_below_a_file_is_unusable() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("file"), "").unwrap();
        let error = DataFolder::open(&folder.path().join("file/data"), "main").unwrap_err();
        assert!(matches!(&error, DataFolderError::Unusable { .. }), "{error}");
        assert!(error.to_string().contains("file/data cannot be used: "), "{error}");
    }

    #[test]
    fn each_session_has_its_own_default() {
        let (a, b) = (default_path("a").unwrap(), default_path("b").unwrap());
        assert!(a.ends_with("plica/a") && b.ends_with("plica/b") && a.is_absolute());
        default_path("..").unwrap_err();
    }
}
