//! Jobs as clients see them.

use plica_protocol::jobs::{Job, JobKind, Progress};
use plica_training::TrainingStage;

use crate::folder::Standing;

/// What a job makes.
pub(crate) fn training_kind(kind: JobKind) -> plica_training::DatabaseKind {
    match kind {
        JobKind::Training => plica_training::DatabaseKind::Training,
        JobKind::Evaluation => plica_training::DatabaseKind::Evaluation,
    }
}

/// A job: what was asked, where it stands, what its process has said.
pub(crate) fn job(
    order: &plica_training::TrainingJob,
    standing: &Standing,
    progress: Option<plica_training::TrainingProgress>,
) -> Job {
    Job {
        id: order.id.clone(),
        client_id: order.client_id.clone(),
        kind: match order.kind {
            plica_training::DatabaseKind::Training => JobKind::Training,
            plica_training::DatabaseKind::Evaluation => JobKind::Evaluation,
        },
        scene_name: order.scene_name.clone(),
        examples: order.examples,
        seed: order.seed,
        threads: order.threads.unwrap_or(1),
        submitted_unix_s: order.submitted_unix_s,
        state: standing.state,
        reason: standing.reason.clone(),
        started_unix_s: standing.started_unix_s,
        finished_unix_s: standing.finished_unix_s,
        progress: progress.map(job_progress).unwrap_or_default(),
    }
}

fn job_progress(progress: plica_training::TrainingProgress) -> Progress {
    let plica_training::TrainingProgress { stage, done, rejected, total, seconds_left } = progress;
    let stage = match stage {
        TrainingStage::Interactions => "interactions",
        TrainingStage::Examples => "examples",
        TrainingStage::Database => "database",
    };
    Progress { stage: Some(stage.to_owned()), done, rejected, total, seconds_left }
}
