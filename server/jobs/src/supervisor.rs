//! The thread that runs jobs, one at a time, each as a process. It alone starts, ends and waits for processes; what it
//! is to do stands in the store.
//!
//! A process ends with the thread that started it, so this thread lives as long as the daemon: a panic inside a step is
//! caught.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitStatus;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use plica_protocol::jobs::{JobFile, JobState};
use plica_training::now_unix_s;

use crate::folder::{JobFolder, Standing};
use crate::process::{Launch, Process};
use crate::reason::reason;
use crate::store::Store;

/// How often the process and its progress are looked at.
const PERIOD: Duration = Duration::from_millis(200);
/// How often what could not be written is tried again.
const SAVE_PERIOD: Duration = Duration::from_secs(2);

/// The state of the thread.
pub(crate) struct Supervisor {
    store: Arc<Store>,
    launch: Launch,
    stop: Arc<AtomicBool>,
    /// The process, and the number of its job.
    running: Option<(u32, Process)>,
}

impl Supervisor {
    pub(crate) fn new(store: Arc<Store>, launch: Launch, stop: Arc<AtomicBool>) -> Self {
        Self { store, launch, stop, running: None }
    }

    /// Runs until it is told to stop and no process is left.
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
    }

    fn start(&mut self, number: u32) {
        let Some(entry) = self.store.entry(number) else { return };
        let started = self.store.change(number, |standing| {
            let queued = standing.state == JobState::Queued;
            if queued {
                let started_unix_s = Some(now_unix_s());
                *standing = Standing { state: JobState::Running, started_unix_s, ..Standing::queued() };
            }
            queued
        });
        if started != Some(true) {
            return;
        }
        match self.launch(number, &entry.folder) {
            Ok(process) => {
                tracing::info!("job {} runs as process {}", entry.order.id, process.id());
                self.running = Some((number, process));
            }
            Err(problem) => self.fail(number, problem),
        }
    }

    /// The state is on disk before the process is there, so that a folder that cannot be written is noticed first.
    fn launch(&self, number: u32, folder: &JobFolder) -> Result<Process, String> {
        let unwritable = |e| format!("{} cannot be written: {e}", folder.path().display());
        self.store.save(number).map_err(unwritable)?;
        let process = Process::start(&self.launch, folder)?;
        self.store.change(number, |standing| standing.pid = Some(process.id()));
        // The number of the process is for people; the job runs without it, too.
        let _ = self.store.save(number);
        Ok(process)
    }

    fn watch(&mut self) {
        let stopping = self.stopping();
        let Some((number, process)) = &mut self.running else { return };
        let number = *number;
        let ended = process.ended();
        if let Some(progress) = self.store.entry(number).and_then(|entry| entry.folder.progress()) {
            self.store.tell(number, progress);
        }
        match ended {
            Ok(None) if stopping || process.was_asked() || self.store.state(number) != Some(JobState::Running) => {
                process.stop();
            }
            Ok(None) => {}
            Ok(Some(status)) => {
                self.running = None;
                self.finish(number, status);
            }
            Err(e) => {
                self.running = None;
                self.fail(number, format!("its process was lost: {e}"));
            }
        }
    }

    /// Somebody may have cancelled the job, or queued it again, while its process was ending: then that stands.
    fn finish(&self, number: u32, status: ExitStatus) {
        let Some(entry) = self.store.entry(number) else { return };
        let (state, reason) = self.verdict(status, &entry.folder);
        self.store.change(number, |standing| {
            if standing.state == JobState::Running {
                let (reason, finished_unix_s) = (reason.clone(), state.is_over().then(now_unix_s));
                *standing = Standing { state, reason, finished_unix_s, pid: None, ..standing.clone() };
            }
        });
        if let Some(now) = self.store.entry(number) {
            let reason = now.standing.reason.map_or_else(String::new, |reason| format!(": {reason}"));
            tracing::info!("job {} is {}{reason}", now.order.id, now.standing.state.name());
        }
        self.save(number);
    }

    fn verdict(&self, status: ExitStatus, folder: &JobFolder) -> (JobState, Option<String>) {
        if status.success() {
            let files = [JobFile::Database, JobFile::Report].map(|file| folder.result(file));
            return match files.iter().find(|file| !file.is_file()) {
                None => (JobState::Done, None),
                Some(file) => {
                    (JobState::Failed, Some(format!("it ended without a result: {} is not there", file.display())))
                }
            };
        }
        if self.stopping() {
            return (JobState::Paused, Some("the daemon was stopped".to_owned()));
        }
        (JobState::Failed, Some(reason(status, folder.last_words().as_deref(), folder.path())))
    }

    fn fail(&self, number: u32, problem: String) {
        tracing::warn!("job {number:04} has failed: {problem}");
        self.store.change(number, |standing| {
            let (state, finished_unix_s) = (JobState::Failed, Some(now_unix_s()));
            *standing = Standing { state, reason: Some(problem), finished_unix_s, pid: None, ..standing.clone() };
        });
        self.save(number);
    }

    fn save(&self, number: u32) {
        if let Err(e) = self.store.save(number) {
            tracing::warn!("the state of job {number:04} cannot be written and is kept in memory: {e}");
        }
    }

    fn stopping(&self) -> bool {
        self.stop.load(Relaxed)
    }
}
