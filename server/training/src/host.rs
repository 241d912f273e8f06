//! Clock and cores of the machine.

use std::time::{SystemTime, UNIX_EPOCH};

/// Wall clock \[s since 1970\].
pub fn now_unix_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

/// Threads of a job without a number of its own: all cores but one, which a simulation may need.
pub fn default_threads() -> u32 {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    u32::try_from(cores.saturating_sub(1)).unwrap_or(1).max(1)
}
