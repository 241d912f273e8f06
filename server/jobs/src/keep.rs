//! Bounds of the finished jobs that are kept.

/// Beginning of the name of a folder that is being removed; a daemon that finds one at its start goes on.
pub(crate) const REMOVING: &str = ".removing-";

/// Bounds of the jobs in a data folder. Beyond them finished jobs are removed: cancelled and failed ones first, then those
/// that are done, each time the oldest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Keep {
    /// Finished jobs.
    pub jobs: usize,
    /// Bytes of all finished jobs; unfinished ones have as much room again.
    pub bytes: u64,
}

impl Default for Keep {
    fn default() -> Self {
        Self { jobs: 200, bytes: 8 << 30 }
    }
}
