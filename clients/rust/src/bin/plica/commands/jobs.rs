//! `jobs`: long-running work of the daemon.

mod fetch;
mod list;
mod watch;

use std::hash::{BuildHasher, RandomState};
use std::path::Path;
use std::process::ExitCode;

use anyhow::Context;
use plica_client::protocol::jobs::{Job, JobSubmitRequest};
use plica_client::protocol::keys::check_name;
use plica_client::protocol::rpc::{ErrorCode, ErrorReply};
use plica_client::{Client, ClientError};
use serde_json::json;

use crate::args::jobs::{Jobs, Resume, Submit};
use crate::output::Output;

pub(crate) fn run(client: &Client, jobs: &Jobs, output: Output) -> anyhow::Result<ExitCode> {
    match jobs {
        Jobs::Submit(submit) => self::submit(client, submit, output),
        Jobs::List => list::run(client, output),
        Jobs::Watch(watch) => watch::run(client, watch.id.as_deref(), output),
        Jobs::Cancel(which) => {
            let job = client.cancel_job(&which.id)?;
            report(&job, &format!("job {0} is cancelled; `plica jobs resume {0}` continues it", job.id), output)
        }
        Jobs::Resume(resume) => self::resume(client, resume, output),
        Jobs::Fetch(fetch) => fetch::run(client, fetch, output),
        Jobs::Activate(which) => activate(client, &which.id, output),
    }
}

fn activate(client: &Client, id: &str, output: Output) -> anyhow::Result<ExitCode> {
    let reply = client.activate(id).map_err(|error| unknown(id, error))?;
    let (examples, generation) = (reply.examples, reply.database_generation);
    let text = format!(
        "{examples} examples of {} enrich the skin from tick {} on, as generation {generation}",
        if id.bytes().all(|b| b.is_ascii_digit()) { format!("job {id}") } else { format!("file {id}") },
        reply.tick
    );
    output.result(&json!(reply), &text);
    Ok(ExitCode::SUCCESS)
}

/// An id that is neither a job nor a file.
fn unknown(id: &str, error: ClientError) -> ClientError {
    match error {
        ClientError::Refused(reply)
            if reply.code == ErrorCode::UnknownJob.name() || reply.message.contains("No such file") =>
        {
            let message = format!("no job and no file `{id}`; see `plica jobs list`");
            ClientError::Refused(ErrorReply { message, ..reply })
        }
        ClientError::Refused(reply) if reply.message.contains("no id of a job") => {
            let message = format!("{}; `plica jobs list` shows the jobs", reply.message);
            ClientError::Refused(ErrorReply { message, ..reply })
        }
        error => error,
    }
}

fn submit(client: &Client, submit: &Submit, output: Output) -> anyhow::Result<ExitCode> {
    let reply = client.submit_job(&request(submit)?)?;
    let (job, id) = (&reply.job, &reply.job.id);
    if !reply.created {
        output.note(&format!("`{}` was submitted before, as job {id}", job.client_id));
    }
    if submit.watch {
        return watch::run(client, Some(id), output);
    }
    let mut value = json!(job);
    value["created"] = reply.created.into();
    output.result(&value, &format!("job {id} is {}; `plica jobs watch {id}` shows its progress", job.state.name()));
    Ok(ExitCode::SUCCESS)
}

fn request(submit: &Submit) -> anyhow::Result<JobSubmitRequest> {
    let client_id = submit.client_id.clone().unwrap_or_else(random_name);
    check_name(&client_id).context("--client-id")?;
    let (scene, scene_name) = submit.scene.as_deref().map(read_scene).transpose()?.unzip();
    let Submit { examples, seed, threads, .. } = *submit;
    Ok(JobSubmitRequest { client_id, kind: submit.kind.into(), examples, seed, threads, scene, scene_name })
}

/// Text and name of a scene file.
fn read_scene(file: &Path) -> anyhow::Result<(String, String)> {
    let text = std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let name = file.file_stem().and_then(|stem| stem.to_str()).filter(|name| check_name(name).is_ok());
    Ok((text, name.unwrap_or("scene").to_owned()))
}

/// The standard library seeds each hasher at random.
fn random_name() -> String {
    format!("plica-{:016x}", RandomState::new().hash_one(0_u8))
}

fn resume(client: &Client, resume: &Resume, output: Output) -> anyhow::Result<ExitCode> {
    let job = client.resume_job(&resume.id)?;
    if resume.watch {
        return watch::run(client, Some(&job.id), output);
    }
    report(&job, &format!("job {0} is queued again; `plica jobs watch {0}` shows its progress", job.id), output)
}

fn report(job: &Job, text: &str, output: Output) -> anyhow::Result<ExitCode> {
    output.result(&json!(job), text);
    Ok(ExitCode::SUCCESS)
}
