//! Thread that runs jobs, one at a time, each as a process. No other thread starts, ends or waits for processes; the queue is
//! the store's.
//!
//! A process ends with the thread that started it, so this thread must live as long as the daemon: panics inside a step are
//! caught.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitStatus;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use plica_protocol::jobs::{JobFile, JobState};
use plica_training::now_unix_s;

use crate::folder::{JobFolder, StoredStatus};
use crate::keep::Keep;
use crate::process::{Launch, Process};
use crate::prune::prune;
use crate::reason::reason;
use crate::store::Store;

/// Interval between checks of the process and its progress.
const PERIOD: Duration = Duration::from_millis(200);
/// Interval between attempts to write states that could not be written.
const SAVE_PERIOD: Duration = Duration::from_secs(2);

/// State of the thread.
pub(crate) struct Supervisor {
    store: Arc<Store>,
    launch: Launch,
    stop: Arc<AtomicBool>,
    keep: Keep,
    /// Number of the running job, and its process.
    running: Option<(u32, Process)>,
}

impl Supervisor {
    pub(crate) fn new(store: Arc<Store>, launch: Launch, stop: Arc<AtomicBool>, keep: Keep) -> Self {
        Self { store, launch, stop, keep, running: None }
    }

    /// Runs until a stop is requested and no process is left.
    pub(crate) fn run(mut self) {
        let mut save_due = Instant::now();
        loop {
            if catch_unwind(AssertUnwindSafe(|| self.step())).is_err() {
                tracing::error!("a fault in the supervision of jobs was contained; please report it");
            }
            if self.stopping() && self.running.as_ref().is_none_or(|(_, process)| process.is_stuck()) {
                break;
            }
            if Instant::now() >= save_due {
                self.store.save_all();
                save_due = Instant::now() + SAVE_PERIOD;
            }
            std::thread::park_timeout(PERIOD);
        }
        self.store.save_all();
    }

    fn step(&mut self) {
        if self.running.is_some() {
            self.watch();
        }
        if self.running.is_none() && !self.stopping() {
            let next = self.store.queued().into_iter().find(|(_, folder)| !folder.is_busy());
            next.into_iter().for_each(|(number, _)| self.start(number));
        }
        self.store.measure();
        prune(&self.store, self.keep);
    }

    fn start(&mut self, number: u32) {
        let Some(entry) = self.store.entry(number) else { return };
        // Before the state, so that a job that is cancelled meanwhile is not removed under its process.
        self.store.set_process(number, true);
        let started = self.store.change(number, |status| {
            let is_queued = status.state == JobState::Queued;
            if is_queued {
                let started_unix_s = Some(now_unix_s());
                *status = StoredStatus { state: JobState::Running, started_unix_s, ..StoredStatus::queued() };
            }
            is_queued
        });
        if started != Some(true) {
            self.store.set_process(number, false);
            return;
        }
        match self.launch(number, &entry.folder) {
            Ok(process) => {
                tracing::info!("job {} runs as process {}", entry.job.id, process.id());
                self.running = Some((number, process));
            }
            Err(problem) => {
                self.store.set_process(number, false);
                self.fail(number, problem);
            }
        }
    }

    /// Writes the state before the process starts, so that a folder that cannot be written is noticed first.
    fn launch(&self, number: u32, folder: &JobFolder) -> Result<Process, String> {
        let unwritable = |e| format!("{} cannot be written: {e}", folder.path().display());
        self.store.save(number).map_err(unwritable)?;
        let process = Process::start(&self.launch, folder)?;
        self.store.change(number, |status| status.pid = Some(process.id()));
        // The process id is for people; the job also runs without it.
        let _ = self.store.save(number);
        Ok(process)
    }

    fn watch(&mut self) {
        let stopping = self.stopping();
        let Some((number, process)) = &mut self.running else { return };
        let number = *number;
        let ended = process.ended();
        if let Some(progress) = self.store.entry(number).and_then(|entry| entry.folder.progress()) {
            self.store.set_progress(number, progress);
        }
        match ended {
            Ok(None) if stopping || process.was_asked() || self.store.state(number) != Some(JobState::Running) => {
                process.stop();
            }
            Ok(None) => {}
            Ok(Some(exit)) => {
                self.running = None;
                self.store.set_process(number, false);
                self.finish(number, exit);
            }
            Err(e) => {
                self.running = None;
                self.store.set_process(number, false);
                self.fail(number, format!("its process was lost: {e}"));
            }
        }
    }

    /// Writes the final state, unless the job was cancelled or queued again while its process was ending.
    fn finish(&self, number: u32, exit: ExitStatus) {
        let Some(entry) = self.store.entry(number) else { return };
        let (state, reason) = self.final_state(exit, &entry.folder);
        let reason = reason.map(|reason| entry.folder.without_place(&reason));
        self.store.change(number, |status| {
            if status.state == JobState::Running {
                let (reason, finished_unix_s) = (reason.clone(), state.is_over().then(now_unix_s));
                *status = StoredStatus { state, reason, finished_unix_s, pid: None, ..status.clone() };
            }
        });
        if let Some(now) = self.store.entry(number) {
            let reason = now.status.reason.map_or_else(String::new, |reason| format!(": {reason}"));
            tracing::info!("job {} is {}{reason}", now.job.id, now.status.state.name());
        }
        self.save(number);
    }

    /// State and reason of a job whose process has ended.
    fn final_state(&self, exit: ExitStatus, folder: &JobFolder) -> (JobState, Option<String>) {
        if exit.success() {
            let files = [JobFile::Database, JobFile::Report].map(|file| folder.result(file));
            return match files.iter().find(|file| !file.is_file()) {
                None => (JobState::Done, None),
                Some(file) => {
                    (JobState::Failed, Some(format!("it ended without a result: {} is missing", file.display())))
                }
            };
        }
        if self.stopping() {
            return (JobState::Paused, Some("the daemon was stopped".to_owned()));
        }
        (JobState::Failed, Some(reason(exit, folder.last_log_line().as_deref(), folder.path())))
    }

    fn fail(&self, number: u32, problem: String) {
        tracing::warn!("job {number:04} has failed: {problem}");
        let folder = self.store.entry(number).map(|entry| entry.folder);
        let problem = folder.map_or_else(String::new, |folder| folder.without_place(&problem));
        self.store.change(number, |status| {
            let (state, finished_unix_s) = (JobState::Failed, Some(now_unix_s()));
            *status = StoredStatus { state, reason: Some(problem), finished_unix_s, pid: None, ..status.clone() };
        });
        self.save(number);
    }

    fn save(&self, number: u32) {
        if let Err(e) = self.store.save(number) {
            tracing::warn!("the state of job {number:04} cannot be written, it is kept in memory: {e}");
        }
    }

    fn stopping(&self) -> bool {
        self.stop.load(Relaxed)
    }
}
