//! Atomic replacement of a file: readers, and a restart after a crash, find the old content or the new one, never a part.
//!
//! The temporary of `a/name` is `a/.name.tmp`. A process that is killed leaves it behind; [`remove_temporaries`] and
//! [`remove_temporary_of`] sweep.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

/// Ending of temporaries.
const TEMPORARY: &str = ".tmp";

/// Replaces `path` by `bytes`: temporary beside it, flush to disk, rename, flush of the folder. A failure removes the
/// temporary.
///
/// # Errors
/// The system's: missing folder, no permission, full disk.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let temporary = temporary_of(path);
    let write = || {
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        drop(file);
        fs::rename(&temporary, path)?;
        sync_folder(folder_of(path))
    };
    write().inspect_err(|_| drop(fs::remove_file(&temporary)))
}

/// Replaces `path` by indented JSON with a line end.
///
/// # Errors
/// As [`write_atomically`], and if `value` cannot be serialised.
pub fn write_json_atomically(path: &Path, value: &impl Serialize) -> io::Result<()> {
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    write_atomically(path, &text)
}

/// Flushes the names in a folder to disk.
///
/// # Errors
/// The system's.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

/// Removes all temporaries in `folder`. The caller is the only writer there.
///
/// # Errors
/// The system's.
pub(crate) fn remove_temporaries(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_str().is_some_and(is_temporary) {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// Removes the temporary of one file, if there is one. The caller is the only writer of that file.
///
/// # Errors
/// The system's.
pub(crate) fn remove_temporary_of(path: &Path) -> io::Result<()> {
    match fs::remove_file(temporary_of(path)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

fn is_temporary(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(TEMPORARY)
}

fn temporary_of(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}{TEMPORARY}"))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn a_file_is_replaced_and_nothing_is_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        write_atomically(&path, b"one").unwrap();
        write_atomically(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(write_atomically(&folder.path().join("no/such/folder"), b"x").is_err());
    }

    #[test]
    fn a_file_that_cannot_be_written_keeps_its_content() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.json");
        write_atomically(&path, b"1").unwrap();
        fs::create_dir(temporary_of(&path)).unwrap();
        write_atomically(&path, b"2").unwrap_err();
        assert_eq!(fs::read(&path).unwrap(), b"1");
    }

    #[test]
    fn a_failed_rename_leaves_no_temporary() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("taken");
        fs::create_dir(&path).unwrap();
        write_atomically(&path, b"1").unwrap_err();
        assert!(!temporary_of(&path).exists());
    }

    #[test]
    fn temporaries_are_swept_and_files_stay() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("00000.safetensors");
        fs::write(&whole, b"whole").unwrap();
        for half in ["00000.safetensors", "00001.safetensors", "00002.safetensors"] {
            fs::write(temporary_of(&folder.path().join(half)), b"half").unwrap();
        }
        remove_temporary_of(&whole).unwrap();
        remove_temporary_of(&whole).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
        remove_temporaries(folder.path()).unwrap();
        let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["00000.safetensors"]);
    }
}
