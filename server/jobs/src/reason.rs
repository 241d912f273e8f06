//! Reason of a process's end, as a sentence.

use std::path::Path;
use std::process::ExitStatus;

/// Exit code of a process that stopped on request.
const INTERRUPTED: i32 = plica_training::INTERRUPTED as i32;
/// Exit code of a Rust program that panicked.
const PANICKED: i32 = 101;
/// Free space below which a disk counts as full.
const FULL_BELOW_BYTES: u64 = 1 << 20;

/// Reason of a failed job: exit code or signal, last line of the log, and a hint if the disk is full.
pub(crate) fn reason(status: ExitStatus, last_log_line: Option<&str>, folder: &Path) -> String {
    let mut reason = ending(status, last_log_line);
    if let Some(hint) = disk_full(last_log_line.unwrap_or_default(), free_bytes(folder)) {
        reason.push_str("; ");
        reason.push_str(hint);
    }
    reason
}

fn ending(status: ExitStatus, last_log_line: Option<&str>) -> String {
    match (status.code(), signal_of(status)) {
        (_, Some(signal)) => with(&format!("killed by signal {}", of_signal(signal)), quoted(signal, last_log_line)),
        (Some(INTERRUPTED), _) => "interrupted from outside (exit code 75); resume it to go on".to_owned(),
        (Some(PANICKED), _) => with("exit code 101, a fault of plicad, please report it", last_log_line),
        (Some(code), _) => with(&format!("exit code {code}"), last_log_line),
        (None, None) => with("ended in an unknown way", last_log_line),
    }
}

fn with(what: &str, last_log_line: Option<&str>) -> String {
    last_log_line.map_or_else(|| format!("{what}; its log is empty"), |line| format!("{what}: {line}"))
}

/// Likely cause of a signal; the last line of the log would mislead for signals from outside.
fn quoted(signal: i32, last_log_line: Option<&str>) -> Option<&str> {
    match signal {
        libc::SIGKILL => Some("out of memory, or by hand"),
        libc::SIGTERM | libc::SIGINT | libc::SIGHUP => Some("by hand"),
        _ => last_log_line,
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

fn disk_full(last_log_line: &str, free_bytes: Option<u64>) -> Option<&'static str> {
    let is_logged = last_log_line.contains("No space left on device") || last_log_line.contains("Disk quota exceeded");
    let is_measured = free_bytes.is_some_and(|free| free < FULL_BELOW_BYTES);
    (is_logged || is_measured).then_some("the disk is full: make room at the data folder, then resume the job")
}

fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    fn code(code: i32, last_log_line: Option<&str>) -> String {
        ending(ExitStatus::from_raw(code << 8), last_log_line)
    }

    fn signal(signal: i32, last_log_line: Option<&str>) -> String {
        ending(ExitStatus::from_raw(signal), last_log_line)
    }

    #[test]
    fn every_ending_has_a_reason() {
        assert_eq!(code(1, Some("scene.toml:3: no such key")), "exit code 1: scene.toml:3: no such key");
        assert_eq!(code(2, None), "exit code 2; its log is empty");
        assert!(code(75, None).starts_with("interrupted from outside"));
        assert!(code(101, Some("boom")).ends_with("please report it: boom"));
        assert_eq!(signal(9, Some("example 3")), "killed by signal 9 (SIGKILL): out of memory, or by hand");
        assert_eq!(signal(15, None), "killed by signal 15 (SIGTERM): by hand");
        assert_eq!(signal(11, Some("example 3")), "killed by signal 11 (SIGSEGV, a crash): example 3");
        assert_eq!(signal(40, None), "killed by signal 40; its log is empty");
    }

    #[test]
    fn a_full_disk_is_recognised_by_its_error_or_by_its_free_space() {
        let hint = "the disk is full: make room at the data folder, then resume the job";
        assert_eq!(disk_full("write: No space left on device (os error 28)", None), Some(hint));
        assert_eq!(disk_full("", Some(4096)), Some(hint));
        assert_eq!(disk_full("no such file", Some(1 << 30)), None);
    }
}
