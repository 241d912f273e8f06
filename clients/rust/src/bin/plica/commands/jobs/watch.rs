//! `jobs watch`: progress of a job until it ends.

use std::io::{IsTerminal, stderr};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use indicatif::{HumanDuration, ProgressBar};
use plica_client::protocol::jobs::{Job, JobProgressMessage, JobState};
use plica_client::{Client, ClientError};
use serde_json::json;

use super::list::examples;
use crate::commands::Stop;
use crate::output::{Output, progress};

/// Most waiting messages, of all jobs.
const WAITING: usize = 64;
const LOOK: Duration = Duration::from_millis(100);
/// Interval between queries of the job, since published messages may be lost.
const ASK: Duration = Duration::from_secs(2);
/// Longest absence of a daemon, for instance while it restarts.
const PATIENCE: Duration = Duration::from_secs(60);
/// Exit code of a shell for Ctrl-C.
const INTERRUPTED: u8 = 130;

pub(super) fn run(client: &Client, id: Option<&str>, output: Output) -> anyhow::Result<ExitCode> {
    let stop = Stop::on_signals()?;
    let messages = client.subscribe_job_progress(WAITING)?;
    let mut watched = Watched::new(first(client, id)?, output);
    let mut asked = Instant::now();
    while !watched.job.state.is_over() && !stop.is_set() {
        if let Some(message) = messages.next(LOOK) {
            watched.update(message);
        }
        if asked.elapsed() >= ASK || watched.job.state.is_over() {
            watched.learn(client.job(&watched.job.id))?;
            asked = Instant::now();
        }
    }
    watched.bar.finish_and_clear();
    end(&watched.job, output)
}

/// The job with the given id, or the oldest that has not ended.
fn first(client: &Client, id: Option<&str>) -> anyhow::Result<Job> {
    if let Some(id) = id {
        return Ok(client.job(id)?);
    }
    let unfinished = client.jobs()?.jobs.into_iter().find(|job| !job.state.is_over());
    unfinished.context("no job is queued or running; name one of `plica jobs list`")
}

/// Last known state of the job, and its progress bar.
struct Watched {
    job: Job,
    bar: ProgressBar,
    output: Output,
    /// Time since which the daemon has not answered.
    lost: Option<Instant>,
    /// Last state printed where there is no bar.
    printed: Option<JobState>,
}

impl Watched {
    fn new(job: Job, output: Output) -> Self {
        let bar = progress(Some(u64::from(job.progress.total.max(1))), "examples");
        let mut watched = Self { job, bar, output, lost: None, printed: None };
        watched.show();
        watched
    }

    fn update(&mut self, message: JobProgressMessage) {
        if message.id != self.job.id {
            return;
        }
        let JobProgressMessage { state, reason, progress, .. } = message;
        self.job = Job { state, reason, progress, ..self.job.clone() };
        self.show();
    }

    /// Tolerates a daemon that does not answer, since jobs continue after its restart. A refusal is final.
    fn learn(&mut self, answer: Result<Job, ClientError>) -> anyhow::Result<()> {
        match answer {
            Ok(job) => {
                (self.job, self.lost) = (job, None);
                self.show();
            }
            Err(error @ ClientError::Refused(_)) => return Err(error.into()),
            Err(error) => {
                let id = &self.job.id;
                let since = *self.lost.get_or_insert_with(Instant::now);
                if since.elapsed() >= PATIENCE {
                    let advice = format!("the daemon has stopped; job {id} continues when it is started again");
                    return Err(anyhow::Error::new(error).context(advice));
                }
                self.bar.set_message("the daemon does not answer; waiting for it");
            }
        }
        Ok(())
    }

    fn show(&mut self) {
        let p = &self.job.progress;
        self.bar.set_length(u64::from(p.total.max(1)));
        self.bar.set_position(u64::from(p.done) + u64::from(p.rejected));
        let left = p.seconds_left.and_then(|s| Duration::try_from_secs_f64(s).ok());
        let left = left.map_or_else(String::new, |left| format!(", {} left", HumanDuration(left)));
        let rejected = if p.rejected == 0 { String::new() } else { format!(", {} rejected", p.rejected) };
        self.bar.set_message(format!("{}{rejected}{left}", self.job.state.name()));
        if !stderr().is_terminal() && self.printed != Some(self.job.state) {
            self.printed = Some(self.job.state);
            self.output.note(&format!("job {} is {}", self.job.id, self.job.state.name()));
        }
    }
}

fn end(job: &Job, output: Output) -> anyhow::Result<ExitCode> {
    let id = &job.id;
    match job.state {
        JobState::Done => {
            let text = format!("job {id} is done: {}; `plica jobs fetch {id}` gets the result", examples(job));
            output.result(&json!(job), &text);
            Ok(ExitCode::SUCCESS)
        }
        JobState::Failed | JobState::Cancelled => {
            let reason = job.reason.as_deref().map_or_else(String::new, |reason| format!(": {reason}"));
            bail!(
                "job {id} is {}{reason}; `plica jobs resume {id}` continues it with its finished examples",
                job.state.name()
            )
        }
        JobState::Queued | JobState::Running | JobState::Paused => {
            let text = format!("job {id} continues; `plica jobs watch {id}` shows it again");
            output.note(&text);
            output.result(&json!(job), &format!("job {id} is {}: {}", job.state.name(), examples(job)));
            Ok(ExitCode::from(INTERRUPTED))
        }
    }
}
