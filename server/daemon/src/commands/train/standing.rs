//! `state.json` of a job that is run by hand; of others the daemon writes it.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use plica_training::write_atomically;
use serde_json::json;

/// Where a job stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    Running,
    Paused,
    Done,
    Failed,
}

impl State {
    fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Done => "done",
            Self::Failed => "failed",
        }
    }
}

/// Writes where the job stands; returns when it was begun \[s since 1970\].
pub(super) fn write(folder: &Path, state: State, reason: Option<String>, begun: Option<u64>) -> anyhow::Result<u64> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let is_over = state != State::Running;
    let value = json!({
        "state": state.name(),
        "reason": reason,
        "started_unix_s": begun.unwrap_or(now),
        "finished_unix_s": is_over.then_some(now),
        "pid": (!is_over).then(std::process::id),
    });
    let path = folder.join("state.json");
    let text = format!("{}\n", serde_json::to_string_pretty(&value)?);
    write_atomically(&path, text.as_bytes()).with_context(|| path.display().to_string())?;
    Ok(begun.unwrap_or(now))
}
