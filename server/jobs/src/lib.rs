//! Jobs: long-running work in processes of their own, queued, supervised and kept on disk.
//!
//! [`Jobs`] answers requests from any thread; one thread of [`Supervision`] runs the processes. The simulation thread uses
//! neither.

pub mod by_hand;
mod data_folder;
mod error;
mod fetch;
mod folder;
mod keep;
mod priority;
mod process;
mod prune;
mod reason;
mod recover;
mod scene;
mod sentence;
mod store;
mod submit;
mod supervisor;
mod view;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use plica_protocol::chunk::ChunkHeader;
use plica_protocol::jobs::{
    Job, JobFetchRequest, JobFile, JobListReply, JobState, JobStatus, JobSubmitReply, JobSubmitRequest, MAX_IN_STATUS,
};
use plica_protocol::rpc::ErrorReply;
use plica_training::{MAX_DATABASE_BYTES, RegularFile, now_unix_s};

pub use data_folder::{DataFolder, DataFolderError, default_path};
pub use error::JobError;
pub use folder::{JobFolder, StoredStatus};
pub use keep::Keep;
pub use priority::{Priority, lower};
pub use process::Launch;
pub use scene::ServedScene;
pub use sentence::sentence;

use fetch::Sums;
use store::Store;
use supervisor::Supervisor;

/// All jobs of a daemon, or the reason why it accepts none. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Jobs(Result<Arc<Shared>, String>);

#[derive(Debug)]
struct Shared {
    store: Arc<Store>,
    sums: Sums,
    served: ServedScene,
    keep: Keep,
    supervisor: std::thread::Thread,
    /// Held during a submission: incomplete ones share a folder.
    submitting: Mutex<()>,
}

/// Handle of the thread that runs jobs. On drop the running job is paused; the next daemon continues it.
#[derive(Debug)]
pub struct Supervision {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _folder: DataFolder,
}

impl Jobs {
    /// Jobs of a daemon that accepts none; requests are refused with `reason`.
    pub fn unavailable(reason: impl Into<String>) -> Self {
        Self(Err(reason.into()))
    }

    /// Reads the jobs of `folder` and starts the thread that runs them.
    pub fn start(
        folder: DataFolder,
        served: ServedScene,
        launch: Launch,
        keep: Keep,
    ) -> std::io::Result<(Self, Supervision)> {
        let store = Arc::new(recover::recover(&folder.jobs())?);
        let stop = Arc::new(AtomicBool::new(false));
        let supervisor = Supervisor::new(Arc::clone(&store), launch, Arc::clone(&stop), keep);
        let thread = std::thread::Builder::new().name("plica-supervise".into()).spawn(move || supervisor.run())?;
        let (sums, supervisor) = (Sums::default(), thread.thread().clone());
        let shared = Shared { store, sums, served, keep, supervisor, submitting: Mutex::new(()) };
        let supervision = Supervision { stop, thread: Some(thread), _folder: folder };
        Ok((Self(Ok(Arc::new(shared))), supervision))
    }

    /// Why this daemon accepts no jobs.
    pub fn why_unavailable(&self) -> Option<&str> {
        self.0.as_ref().err().map(String::as_str)
    }

    /// Queues a job.
    pub fn submit(&self, request: &JobSubmitRequest) -> Result<JobSubmitReply, ErrorReply> {
        request.check()?;
        let shared = self.shared()?;
        let _alone = shared.submitting.lock().unwrap_or_else(PoisonError::into_inner);
        // Here too, since jobs may come faster than the other thread removes them.
        prune::prune(&shared.store, shared.keep);
        let reply = submit::submit(&shared.store, request, &shared.served, shared.keep)?;
        shared.supervisor.unpark();
        Ok(reply)
    }

    /// The newest jobs.
    pub fn list(&self) -> Result<JobListReply, JobError> {
        Ok(self.shared()?.store.list())
    }

    /// One job.
    pub fn get(&self, id: &str) -> Result<Job, JobError> {
        let shared = self.shared()?;
        shared.job(shared.store.find(id)?)
    }

    /// Marks a job cancelled; its process ends within the grace period.
    pub fn cancel(&self, id: &str) -> Result<Job, JobError> {
        self.change_status(id, |status| {
            if status.state.is_over() {
                return Err(JobError::Over { id: id.to_owned(), state: status.state });
            }
            let (started_unix_s, finished_unix_s) = (status.started_unix_s, Some(now_unix_s()));
            *status =
                StoredStatus { state: JobState::Cancelled, started_unix_s, finished_unix_s, ..StoredStatus::queued() };
            Ok(())
        })
    }

    /// Queues a job that is failed, cancelled or paused again.
    pub fn resume(&self, id: &str) -> Result<Job, JobError> {
        self.change_status(id, |status| match status.state {
            JobState::Failed | JobState::Cancelled | JobState::Paused => {
                *status = StoredStatus { started_unix_s: status.started_unix_s, ..StoredStatus::queued() };
                Ok(())
            }
            state => Err(JobError::NotResumable { id: id.to_owned(), state }),
        })
    }

    /// Chunk of a result.
    pub fn piece(&self, request: &JobFetchRequest, offset: u64) -> Result<(ChunkHeader, Vec<u8>), ErrorReply> {
        let path = self.result(&request.id, request.file)?;
        self.shared()?.sums.piece(&path, offset)
    }

    /// Path of a result of a finished job.
    pub fn result(&self, id: &str, file: JobFile) -> Result<PathBuf, JobError> {
        let store = &self.shared()?.store;
        let entry = store.entry(store.find(id)?).ok_or_else(|| JobError::Unknown(id.to_owned()))?;
        let state = entry.status.state;
        if state != JobState::Done {
            return Err(JobError::NotDone { id: id.to_owned(), state, file });
        }
        Ok(entry.folder.result(file))
    }

    /// Database of a finished job, open; the job is kept until [`Jobs::end_use`].
    pub fn begin_use(&self, id: &str) -> Result<RegularFile, JobError> {
        let store = &self.shared()?.store;
        store.begin_use(store.find(id)?);
        let path = self.result(id, JobFile::Database)?;
        RegularFile::open_unlinked(&path, MAX_DATABASE_BYTES).map_err(|fault| JobError::Result(fault.to_string()))
    }

    /// Ends the use of a database: its examples enrich the skin from now on, and its job is kept, or they do not. To be
    /// called for databases of no job, too.
    pub fn end_use(&self, enriches: bool) {
        if let Ok(shared) = &self.0 {
            shared.store.end_use(enriches);
        }
    }

    /// Present version of the table, and the jobs changed since `version` (0: all jobs).
    pub fn changed_since(&self, version: u64) -> (u64, Vec<Job>) {
        self.0.as_ref().map_or_else(|_| (version, Vec::new()), |shared| shared.store.changed_since(version))
    }

    /// The newest jobs, for the status.
    pub fn status(&self) -> Vec<JobStatus> {
        let newest = |shared: &Arc<Shared>| shared.store.newest(MAX_IN_STATUS).iter().map(JobStatus::from).collect();
        self.0.as_ref().map_or_else(|_| Vec::new(), newest)
    }

    /// Changes the status of a job and writes it; a failed write is logged and tried again later.
    fn change_status(
        &self,
        id: &str,
        change: impl FnOnce(&mut StoredStatus) -> Result<(), JobError>,
    ) -> Result<Job, JobError> {
        let shared = self.shared()?;
        let number = shared.store.find(id)?;
        shared.store.change(number, change).unwrap_or_else(|| Err(JobError::Unknown(id.to_owned())))?;
        if let Err(e) = shared.store.save(number) {
            tracing::warn!("the state of job {id} cannot be written, it is kept in memory: {e}");
        }
        shared.supervisor.unpark();
        shared.job(number)
    }

    fn shared(&self) -> Result<&Arc<Shared>, JobError> {
        self.0.as_ref().map_err(|reason| JobError::Unavailable(reason.clone()))
    }
}

impl Shared {
    fn job(&self, number: u32) -> Result<Job, JobError> {
        let entry = self.store.entry(number);
        entry.map(|entry| entry.view()).ok_or_else(|| JobError::Unknown(number.to_string()))
    }
}

impl Supervision {
    /// Asks the running job to stop, without waiting.
    pub fn begin_stop(&self) {
        self.stop.store(true, Relaxed);
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }
}

impl Drop for Supervision {
    fn drop(&mut self) {
        self.begin_stop();
        // A panic of the thread has been logged already.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
