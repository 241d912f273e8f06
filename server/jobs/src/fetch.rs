//! Results in chunks, each with the checksum of the whole file.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

use plica_protocol::chunk::{CHUNK_BYTES, ChunkHeader, check_offset};
use plica_protocol::rpc::ErrorReply;
use plica_training::RegularFile;
use sha2::{Digest, Sha256};

use crate::error::JobError;

/// Largest result that is handed out.
const MAX_RESULT_BYTES: u64 = 1 << 40;
/// Checksums that are remembered.
const MAX_SUMS: usize = 1024;

/// Checksums of files, computed once for each size and time of modification.
#[derive(Debug, Default)]
pub(crate) struct Sums(Mutex<HashMap<PathBuf, Sum>>);

#[derive(Debug, Clone, PartialEq)]
struct Sum {
    bytes: u64,
    modified: SystemTime,
    sha256: String,
}

impl Sums {
    /// Chunk of a file from `offset` on.
    pub(crate) fn piece(&self, path: &Path, offset: u64) -> Result<(ChunkHeader, Vec<u8>), ErrorReply> {
        let failed = |e: io::Error| JobError::Result(format!("cannot be read: {e}"));
        let open = RegularFile::open_unlinked(path, MAX_RESULT_BYTES);
        let mut open = open.map_err(|fault| JobError::Result(fault.to_string()))?;
        let file = open.file();
        let Sum { bytes, sha256, .. } = self.of(file, path).map_err(failed)?;
        check_offset(offset, bytes)?;
        let piece = read(file, offset).map_err(failed)?;
        Ok((ChunkHeader { total_bytes: bytes, offset, sha256 }, piece))
    }

    fn of(&self, file: &mut File, path: &Path) -> io::Result<Sum> {
        let metadata = file.metadata()?;
        let (bytes, modified) = (metadata.len(), metadata.modified()?);
        let mut sums = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sum) = sums.get(path).filter(|sum| (sum.bytes, sum.modified) == (bytes, modified)) {
            return Ok(sum.clone());
        }
        let sum = Sum { bytes, modified, sha256: sha256(file, bytes)? };
        if sums.len() >= MAX_SUMS {
            sums.clear();
        }
        sums.insert(path.to_owned(), sum.clone());
        Ok(sum)
    }
}

fn sha256(file: &mut File, bytes: u64) -> io::Result<String> {
    let mut file = file.take(bytes);
    let (mut hash, mut buffer) = (Sha256::new(), vec![0; CHUNK_BYTES]);
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(plica_training::hexadecimal(&hash.finalize())),
            n => hash.update(&buffer[..n]),
        }
    }
}

fn read(file: &mut File, offset: u64) -> io::Result<Vec<u8>> {
    let mut piece = Vec::with_capacity(CHUNK_BYTES);
    file.seek(SeekFrom::Start(offset))?;
    file.take(CHUNK_BYTES as u64).read_to_end(&mut piece)?;
    Ok(piece)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn pieces_make_the_whole_and_a_changed_file_another_sum() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("database");
        let whole: Vec<u8> = (0..CHUNK_BYTES + 10).map(|i| (i / 7) as u8).collect();
        std::fs::write(&path, &whole).unwrap();
        let sums = Sums::default();
        let (first, a) = sums.piece(&path, 0).unwrap();
        let (second, b) = sums.piece(&path, CHUNK_BYTES as u64).unwrap();
        assert_eq!((a.len(), b.len(), first.total_bytes), (CHUNK_BYTES, 10, whole.len() as u64));
        assert_eq!([a, b].concat(), whole);
        assert!(first.sha256 == second.sha256 && first.sha256.len() == 64);
        assert_eq!(sums.piece(&path, whole.len() as u64 + 1).unwrap_err().code, "bad_offset");
        std::fs::write(&path, b"other").unwrap();
        assert_ne!(sums.piece(&path, 0).unwrap().0.sha256, first.sha256);
        std::fs::remove_file(&path).unwrap();
        assert_eq!(sums.piece(&path, 0).unwrap_err().code, "jobs_unavailable");
    }
}
