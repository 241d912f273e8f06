//! Regular files, opened without ever blocking and read within a bound: the one way to read a file because a client asked.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use rustix::fs::OFlags;

/// Why a file is not read. The sentences name no path.
#[derive(Debug, thiserror::Error)]
pub enum FileFault {
    /// Error of the operating system.
    #[error("cannot be read: {0}")]
    Io(io::Error),
    /// A folder, pipe, device or socket.
    #[error("is no regular file")]
    NotRegular,
    /// A link where none is followed.
    #[error("is a link, which is not followed here")]
    Link,
    /// Larger than the bound.
    #[error("has {bytes} bytes; at most {most} are read")]
    Large {
        /// Size of the file.
        bytes: u64,
        /// The bound.
        most: u64,
    },
    /// More bytes than its size, as files of the kernel have, or a file that is being written.
    #[error("holds more than the {bytes} bytes that its size says")]
    Longer {
        /// Size of the file.
        bytes: u64,
    },
}

/// An open regular file whose size is within a bound.
#[derive(Debug)]
pub struct RegularFile {
    file: File,
    bytes: u64,
}

impl RegularFile {
    /// Opens a file of `most` bytes or fewer. Links are followed.
    ///
    /// # Errors
    /// See [`FileFault`].
    pub fn open(path: &Path, most: u64) -> Result<Self, FileFault> {
        Self::open_with(path, most, OFlags::empty())
    }

    /// Opens a file of `most` bytes or fewer, unless `path` is a link.
    ///
    /// # Errors
    /// See [`FileFault`].
    pub fn open_unlinked(path: &Path, most: u64) -> Result<Self, FileFault> {
        if fs::symlink_metadata(path).map_err(FileFault::Io)?.is_symlink() {
            return Err(FileFault::Link);
        }
        Self::open_with(path, most, OFlags::NOFOLLOW)
    }

    /// A look at the kind first, since to open a device can have effects; the open file decides. Without waiting, so that a
    /// pipe that takes the file's place in between blocks nothing.
    fn open_with(path: &Path, most: u64, flags: OFlags) -> Result<Self, FileFault> {
        if !fs::metadata(path).map_err(FileFault::Io)?.is_file() {
            return Err(FileFault::NotRegular);
        }
        let flags = flags | OFlags::NONBLOCK | OFlags::NOCTTY;
        let file = OpenOptions::new().read(true).custom_flags(flags.bits().cast_signed()).open(path);
        let file = file.map_err(FileFault::Io)?;
        let metadata = file.metadata().map_err(FileFault::Io)?;
        match metadata.len() {
            _ if !metadata.is_file() => Err(FileFault::NotRegular),
            bytes if bytes > most => Err(FileFault::Large { bytes, most }),
            bytes => Ok(Self { file, bytes }),
        }
    }

    /// Size when it was opened.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The open file. Reading from it is not bounded.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// The next `n` bytes, or fewer at the end of the file.
    ///
    /// # Errors
    /// [`FileFault::Io`].
    pub fn read_next(&mut self, n: u64) -> Result<Vec<u8>, FileFault> {
        let n = n.min(self.bytes);
        let mut bytes = Vec::with_capacity(n as usize);
        (&mut self.file).take(n).read_to_end(&mut bytes).map_err(FileFault::Io)?;
        Ok(bytes)
    }

    /// All that has not been read yet, appended to `bytes`, which holds the beginning of the file.
    ///
    /// # Errors
    /// [`FileFault::Io`], and [`FileFault::Longer`] for a file that goes on beyond its size.
    pub fn read_rest(mut self, bytes: &mut Vec<u8>) -> Result<(), FileFault> {
        let left = self.bytes.saturating_sub(bytes.len() as u64);
        bytes.reserve_exact(left as usize + 1);
        (&mut self.file).take(left + 1).read_to_end(bytes).map_err(FileFault::Io)?;
        if bytes.len() as u64 > self.bytes {
            return Err(FileFault::Longer { bytes: self.bytes });
        }
        Ok(())
    }

    /// The whole content.
    ///
    /// # Errors
    /// As [`RegularFile::read_rest`].
    pub fn read(self) -> Result<Vec<u8>, FileFault> {
        let mut bytes = Vec::new();
        self.read_rest(&mut bytes)?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use std::os::unix::fs::symlink;
    use std::process::Command;

    use super::*;

    #[test]
    fn a_regular_file_is_read_up_to_its_bound() {
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("a"), folder.path().join("link"));
        fs::write(&path, b"four").unwrap();
        symlink(&path, &link).unwrap();
        assert_eq!(RegularFile::open(&path, 4).unwrap().read().unwrap(), b"four");
        assert_eq!(RegularFile::open(&link, 4).unwrap().read().unwrap(), b"four");
        let mut open = RegularFile::open_unlinked(&path, 4).unwrap();
        let mut bytes = open.read_next(1).unwrap();
        open.read_rest(&mut bytes).unwrap();
        assert_eq!(bytes, b"four");
        let refused = RegularFile::open(&path, 3).unwrap_err().to_string();
        assert_eq!(refused, "has 4 bytes; at most 3 are read");
        assert!(matches!(RegularFile::open_unlinked(&link, 4), Err(FileFault::Link)));
    }

    #[test]
    fn nothing_else_is_opened_and_nothing_blocks() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [pipe.as_path(), Path::new("/dev/zero"), Path::new("/dev/null"), folder.path()] {
            let refused = RegularFile::open(path, u64::MAX).unwrap_err();
            assert!(matches!(refused, FileFault::NotRegular), "{}: {refused}", path.display());
        }
        assert!(matches!(RegularFile::open(&folder.path().join("none"), 1), Err(FileFault::Io(_))));
    }

    #[test]
    fn a_file_that_goes_on_beyond_its_size_is_refused() {
        // Its size is 0, as that of all files of the kernel.
        let open = RegularFile::open(Path::new("/proc/self/maps"), 1 << 20).unwrap();
        assert!(matches!(open.read(), Err(FileFault::Longer { bytes: 0 })));
    }
}
