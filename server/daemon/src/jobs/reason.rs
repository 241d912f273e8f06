//! Why a process ended, in words.

use std::path::Path;
use std::process::ExitStatus;

/// Exit code of a process that was asked to stop, and did.
const INTERRUPTED: i32 = plica_training::INTERRUPTED as i32;
/// Exit code of a Rust program that panicked.
const PANICKED: i32 = 101;
/// With less room than this a disk counts as full.
const FULL_BELOW_BYTES: u64 = 1 << 20;

/// What a failed job says: how the process ended, the last line of its log, and whether the disk is full.
pub(super) fn reason(status: ExitStatus, last_words: Option<&str>, folder: &Path) -> String {
    let mut reason = ending(status, last_words);
    if let Some(hint) = disk_full(last_words.unwrap_or_default(), free_bytes(folder), folder) {
        reason.push_str("; ");
        reason.push_str(&hint);
    }
    reason
}

fn ending(status: ExitStatus, last_words: Option<&str>) -> String {
    match (status.code(), signal_of(status)) {
        (_, Some(signal)) => with(&format!("killed by signal {}", of_signal(signal)), quoted(signal, last_words)),
        (Some(INTERRUPTED), _) => "interrupted from outside (exit code 75); resume it to go on".to_owned(),
        (Some(PANICKED), _) => with("exit code 101, a fault of plicad, please report it", last_words),
        (Some(code), _) => with(&format!("exit code {code}"), last_words),
        (None, None) => with("ended in an unknown way", last_words),
    }
}

fn with(what: &str, last_words: Option<&str>) -> String {
    last_words.map_or_else(|| format!("{what}; it left no word in its log"), |words| format!("{what}: {words}"))
}

/// A process that is killed has nothing to say about it: its last words would mislead.
fn quoted(signal: i32, last_words: Option<&str>) -> Option<&str> {
    match signal {
        libc::SIGKILL => Some("out of memory, or by hand"),
        libc::SIGTERM | libc::SIGINT | libc::SIGHUP => Some("by hand"),
        _ => last_words,
    }
}

fn of_signal(signal: i32) -> String {
    let name = match signal {
        libc::SIGKILL => "SIGKILL",
        libc::SIGTERM => "SIGTERM",
        libc::SIGINT => "SIGINT",
        libc::SIGHUP => "SIGHUP",
        libc::SIGSEGV => "SIGSEGV, a crash",
        libc::SIGBUS => "SIGBUS, a crash",
        libc::SIGILL => "SIGILL, a crash",
        libc::SIGFPE => "SIGFPE, a crash",
        libc::SIGABRT => "SIGABRT, a crash",
        libc::SIGXFSZ => "SIGXFSZ, a file grew too large",
        _ => return signal.to_string(),
    };
    format!("{signal} ({name})")
}

#[cfg(unix)]
fn signal_of(status: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

fn disk_full(last_words: &str, free_bytes: Option<u64>, folder: &Path) -> Option<String> {
    let said = last_words.contains("No space left on device") || last_words.contains("Disk quota exceeded");
    let measured = free_bytes.is_some_and(|free| free < FULL_BELOW_BYTES);
    (said || measured).then(|| format!("the disk is full: make room at {}, then resume the job", folder.display()))
}

fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    fn code(code: i32, last_words: Option<&str>) -> String {
        ending(ExitStatus::from_raw(code << 8), last_words)
    }

    fn signal(signal: i32, last_words: Option<&str>) -> String {
        ending(ExitStatus::from_raw(signal), last_words)
    }

    #[test]
    fn every_ending_has_words() {
        assert_eq!(code(1, Some("scene.toml:3: no such key")), "exit code 1: scene.toml:3: no such key");
        assert_eq!(code(2, None), "exit code 2; it left no word in its log");
        assert!(code(75, None).starts_with("interrupted from outside"));
        assert!(code(101, Some("boom")).ends_with("please report it: boom"));
        assert_eq!(signal(9, Some("example 3")), "killed by signal 9 (SIGKILL): out of memory, or by hand");
        assert_eq!(signal(15, None), "killed by signal 15 (SIGTERM): by hand");
        assert_eq!(signal(11, Some("example 3")), "killed by signal 11 (SIGSEGV, a crash): example 3");
        assert_eq!(signal(40, None), "killed by signal 40; it left no word in its log");
    }

    #[test]
    fn a_full_disk_is_recognised_by_its_words_or_by_its_room() {
        let folder = Path::new("/data");
        let hint = "the disk is full: make room at /data, then resume the job";
        assert_eq!(disk_full("write: No space left on device (os error 28)", None, folder).as_deref(), Some(hint));
        assert_eq!(disk_full("", Some(4096), folder).as_deref(), Some(hint));
        assert_eq!(disk_full("no such file", Some(1 << 30), folder), None);
    }
}
