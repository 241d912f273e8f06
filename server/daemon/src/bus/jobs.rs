//! Methods of jobs, and their progress, on a thread of their own, so that a large scene or result delays no command to the
//! simulation.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use plica_protocol::chunk::offset_of;
use plica_protocol::jobs::{JobFetchRequest, JobProgressMessage, JobRequest, MAX_REQUEST_BYTES};
use plica_protocol::rpc::{EmptyRequest, ErrorCode, ErrorReply, Method, decode_request};
use plica_protocol::{ENCODING_BYTES, ENCODING_JSON};
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;

use super::error::BusError;
use super::replies::{Content, Replies};
use super::requests::json;
use super::shared::{Shared, spawn};

/// Requests that may wait.
const QUEUE: usize = 16;
/// Interval of progress messages.
const PERIOD: Duration = Duration::from_millis(200);

/// Starts the thread; what goes into the channel is answered.
pub(super) fn start(shared: &Arc<Shared>, replies: Replies) -> Result<(SyncSender<Query>, JoinHandle<()>), BusError> {
    let (requests_in, requests) = sync_channel(QUEUE);
    let publisher = shared
        .session
        .declare_publisher(shared.keys.job_progress())
        .congestion_control(CongestionControl::Drop)
        .priority(Priority::DataHigh)
        .encoding(Encoding::from(ENCODING_JSON))
        .wait()
        .map_err(|e| shared.error(e))?;
    // Jobs of an earlier daemon are not published.
    let (published, _) = shared.jobs.changed_since(0);
    let worker = Worker { shared: Arc::clone(shared), replies, requests, publisher, published };
    Ok((requests_in, spawn("plica-jobs", move || worker.run())?))
}

struct Worker {
    shared: Arc<Shared>,
    replies: Replies,
    requests: Receiver<Query>,
    publisher: Publisher<'static>,
    /// Version of the jobs that was published last.
    published: u64,
}

impl Worker {
    fn run(mut self) {
        let mut due = Instant::now();
        while !self.shared.stopping() {
            match self.requests.recv_timeout(due.saturating_duration_since(Instant::now())) {
                Ok(query) => self.serve(query),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            if Instant::now() >= due {
                self.publish();
                due = Instant::now() + PERIOD;
            }
        }
    }

    /// Publishes the present state of each job that has changed.
    fn publish(&mut self) {
        let (version, changed) = self.shared.jobs.changed_since(self.published);
        self.published = version;
        for progress in changed.iter().map(JobProgressMessage::from) {
            let Ok(message) = json(&progress) else { continue };
            // Dropped where it does not fit into the queue at once; an error means that the session is closing.
            let _ = self.publisher.put(message).wait();
        }
    }

    fn serve(&self, query: Query) {
        let content = self.answer(&query);
        self.replies.send(query, content);
    }

    fn answer(&self, query: &Query) -> Result<Content, ErrorReply> {
        let key = query.key_expr().as_str().to_owned();
        let payload = query.payload().map(|p| p.to_bytes()).unwrap_or_default();
        if payload.len() > MAX_REQUEST_BYTES {
            let message = format!("the request has {} bytes; at most {MAX_REQUEST_BYTES} are read", payload.len());
            return Err(ErrorReply::new(ErrorCode::RpcMalformed, message));
        }
        let method = Method::parse(self.shared.keys.method_of_rpc(&key).unwrap_or_default())?;
        if method == Method::JobFetch {
            return self.fetch(key, query.parameters().as_str(), &payload);
        }
        Ok(Content::json(key, self.call(method, &payload)?))
    }

    fn call(&self, method: Method, payload: &[u8]) -> Result<String, ErrorReply> {
        let jobs = &self.shared.jobs;
        let id = || decode_request::<JobRequest>(payload).map(|request| request.id);
        match method {
            Method::JobSubmit => json(&jobs.submit(&decode_request(payload)?)?),
            Method::JobList => {
                let EmptyRequest {} = decode_request(payload)?;
                json(&jobs.list()?)
            }
            Method::JobGet => json(&jobs.get(&id()?)?),
            Method::JobCancel => json(&jobs.cancel(&id()?)?),
            Method::JobResume => json(&jobs.resume(&id()?)?),
            _ => Err(ErrorReply::new(ErrorCode::Internal, "a request to the simulation went astray")),
        }
    }

    fn fetch(&self, key: String, parameters: &str, payload: &[u8]) -> Result<Content, ErrorReply> {
        let request: JobFetchRequest = decode_request(payload)?;
        let (header, piece) = self.shared.jobs.piece(&request, offset_of(parameters)?)?;
        Ok(Content { key, payload: piece, encoding: ENCODING_BYTES, attachment: Some(header.to_json()) })
    }
}
