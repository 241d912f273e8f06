//! `state.json` of a job that is run by hand; of others the daemon writes it.

use std::path::Path;

use anyhow::Context;
use plica_protocol::jobs::JobState;
use plica_training::{TrainingError, TrainingReport, now_unix_s};

use crate::jobs::{JobFolder, Standing};

/// Notes that this process works on the job.
pub(super) fn begin(root: &Path) -> anyhow::Result<Standing> {
    let standing = Standing {
        state: JobState::Running,
        reason: None,
        started_unix_s: Some(now_unix_s()),
        finished_unix_s: None,
        pid: Some(std::process::id()),
    };
    write(root, &standing)?;
    Ok(standing)
}

/// Notes how it ended, and why.
pub(super) fn end(root: &Path, begun: Standing, result: &anyhow::Result<TrainingReport>) -> anyhow::Result<()> {
    let (state, reason) = match result {
        Ok(_) => (JobState::Done, None),
        Err(error) => match error.downcast_ref() {
            Some(TrainingError::Interrupted) => (JobState::Paused, Some("interrupted".to_owned())),
            _ => (JobState::Failed, Some(format!("{error:#}"))),
        },
    };
    write(root, &Standing { state, reason, finished_unix_s: Some(now_unix_s()), pid: None, ..begun })
}

fn write(root: &Path, standing: &Standing) -> anyhow::Result<()> {
    JobFolder::new(root.to_owned()).write_standing(standing).with_context(|| root.display().to_string())
}
