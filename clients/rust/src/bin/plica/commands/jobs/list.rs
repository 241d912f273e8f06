//! `jobs list`.

use std::process::ExitCode;

use plica_client::Client;
use plica_client::protocol::jobs::{Job, JobListReply};
use serde_json::json;

use crate::output::Output;

pub(super) fn run(client: &Client, output: Output) -> anyhow::Result<ExitCode> {
    let reply = client.jobs()?;
    output.result(&json!(reply), &table(&reply));
    Ok(ExitCode::SUCCESS)
}

fn table(reply: &JobListReply) -> String {
    if reply.jobs.is_empty() {
        return "no jobs; `plica jobs submit` queues one".to_owned();
    }
    let mut lines = vec![line(["job", "state", "kind", "scene", "examples"], "")];
    lines.extend(reply.jobs.iter().map(describe));
    lines.extend((reply.older > 0).then(|| format!("and {} older ones", reply.older)));
    lines.extend(
        (reply.removed > 0).then(|| format!("finished and removed since the daemon's start: {}", reply.removed)),
    );
    lines.join("\n")
}

fn describe(job: &Job) -> String {
    let kind = json!(job.kind);
    let columns = [&job.id, job.state.name(), kind.as_str().unwrap_or("?"), &job.scene_name, &examples(job)];
    line(columns, job.reason.as_deref().unwrap_or_default())
}

fn line([id, state, kind, scene, examples]: [&str; 5], rest: &str) -> String {
    format!("{id:<6} {state:<10} {kind:<11} {scene:<16} {examples:<26} {rest}").trim_end().to_owned()
}

/// Progress of a job: `40 of 128, 1 rejected`.
pub(super) fn examples(job: &Job) -> String {
    let p = &job.progress;
    let total =
        if p.total == 0 { job.examples.map_or_else(|| "?".to_owned(), |n| n.to_string()) } else { p.total.to_string() };
    let rejected = if p.rejected == 0 { String::new() } else { format!(", {} rejected", p.rejected) };
    format!("{} of {total}{rejected}", p.done)
}
