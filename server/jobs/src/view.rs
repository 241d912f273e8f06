//! Jobs as clients see them.

use plica_protocol::jobs::{Job, JobKind, JobProgress};
use plica_training::TrainingStage;

use crate::folder::StoredStatus;

/// Kind of the database that a job makes.
pub(crate) fn training_kind(kind: JobKind) -> plica_training::DatabaseKind {
    match kind {
        JobKind::Training => plica_training::DatabaseKind::Training,
        JobKind::Evaluation => plica_training::DatabaseKind::Evaluation,
    }
}

/// Job of the protocol, from request, status and progress.
pub(crate) fn job(
    job: &plica_training::TrainingJob,
    status: &StoredStatus,
    progress: Option<plica_training::TrainingProgress>,
) -> Job {
    Job {
        id: job.id.clone(),
        client_id: job.client_id.clone(),
        kind: match job.kind {
            plica_training::DatabaseKind::Training => JobKind::Training,
            plica_training::DatabaseKind::Evaluation => JobKind::Evaluation,
        },
        scene_name: job.scene_name.clone(),
        examples: job.examples,
        seed: job.seed,
        threads: job.threads.unwrap_or(1),
        submitted_unix_s: job.submitted_unix_s,
        state: status.state,
        reason: status.reason.clone(),
        started_unix_s: status.started_unix_s,
        finished_unix_s: status.finished_unix_s,
        progress: progress.map(job_progress).unwrap_or_default(),
    }
}

fn job_progress(progress: plica_training::TrainingProgress) -> JobProgress {
    let plica_training::TrainingProgress { stage, done, rejected, total, seconds_left } = progress;
    let stage = match stage {
        TrainingStage::Interactions => "interactions",
        TrainingStage::Examples => "examples",
        TrainingStage::Database => "database",
    };
    JobProgress { stage: Some(stage.to_owned()), done, rejected, total, seconds_left }
}
