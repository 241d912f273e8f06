//! `rpc/activate`: prepares examples on a thread of its own, which takes seconds, then commands the simulation to use them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use plica_protocol::jobs::JobFile;
use plica_protocol::rpc::{ActivateRequest, ErrorCode, ErrorReply, decode_request};
use zenoh::query::Query;

use super::error::BusError;
use super::replies::Replies;
use super::requests::{Activation, Request, refused};
use super::shared::{Shared, spawn};
use crate::database_loader::Ready;

/// Requests that may wait: one.
const QUEUE: usize = 1;
const LOOK_AT_STOP: Duration = Duration::from_millis(100);

/// Starts the thread; requests in the channel are sent to `orders` once their examples are prepared.
pub(super) fn start(
    shared: &Arc<Shared>,
    orders: SyncSender<Request>,
    replies: Replies,
) -> Result<(SyncSender<Query>, JoinHandle<()>), BusError> {
    let (requests_in, requests) = sync_channel(QUEUE);
    let worker = Worker { shared: Arc::clone(shared), orders, replies, requests };
    Ok((requests_in, spawn("plica-activate", move || worker.run())?))
}

struct Worker {
    shared: Arc<Shared>,
    orders: SyncSender<Request>,
    replies: Replies,
    requests: Receiver<Query>,
}

impl Worker {
    fn run(self) {
        while !self.shared.stopping() {
            match self.requests.recv_timeout(LOOK_AT_STOP) {
                Ok(query) => self.serve(query),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn serve(&self, query: Query) {
        let (live, n_examples) = match self.prepare(&query) {
            Ok(ready) => (self.shared.enrichment.live(&ready), ready.n_examples),
            Err(error) => return self.replies.send(query, Err(error)),
        };
        let activation = Box::new(Activation { query, live, n_examples });
        if let Err(error) = self.orders.try_send(Request::Activate(activation)) {
            let busy = ErrorReply::new(ErrorCode::Busy, "too many requests are waiting");
            if let Some(query) = refused(error).into_query() {
                self.replies.send(query, Err(busy));
            }
        }
    }

    fn prepare(&self, query: &Query) -> Result<Ready, ErrorReply> {
        let payload = query.payload().map(|p| p.to_bytes()).unwrap_or_default();
        let request: ActivateRequest = decode_request(&payload)?;
        let path = self.path(&request)?;
        // A panic over the content of a database must not end the thread.
        let ready = catch_unwind(AssertUnwindSafe(|| self.shared.enrichment.read(&path)));
        let ready = ready.map_err(|_| ErrorReply::new(ErrorCode::Internal, "the examples could not be made ready"))?;
        ready.map_err(|error| {
            let message = shown(&error.to_string(), &path, request.job());
            ErrorReply::new(ErrorCode::BadDatabase, message)
        })
    }

    fn path(&self, request: &ActivateRequest) -> Result<PathBuf, ErrorReply> {
        match request.job() {
            Some(id) => Ok(self.shared.jobs.result(id, JobFile::Database)?),
            None => Ok(PathBuf::from(&request.database)),
        }
    }
}

/// Replaces the path of a job by its id, so that the daemon's folders stay private.
fn shown(message: &str, path: &Path, job: Option<&str>) -> String {
    job.map_or_else(|| message.to_owned(), |id| message.replace(&path.display().to_string(), &format!("job {id}")))
}
