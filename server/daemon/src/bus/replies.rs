//! Reply thread: a client that does not read blocks other replies, never a tick.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use plica_protocol::ENCODING_JSON;
use plica_protocol::rpc::ErrorReply;
use plica_protocol::status::REPLY_DROPPED;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::query::Query;

use super::error::BusError;
use super::shared::{Shared, spawn};

/// Replies that may wait; each holds at most 512 KiB, or a skin frame.
const QUEUE: usize = 64;
const LOOK_AT_STOP: Duration = Duration::from_millis(100);

/// A finished answer.
pub(super) struct Answer {
    pub(super) query: Query,
    pub(super) content: Result<Content, ErrorReply>,
}

/// Content of an answer.
pub(super) struct Content {
    pub(super) key: String,
    pub(super) payload: Vec<u8>,
    pub(super) encoding: &'static str,
    pub(super) attachment: Option<String>,
}

impl Content {
    pub(super) fn json(key: String, payload: String) -> Self {
        Self { key, payload: payload.into_bytes(), encoding: ENCODING_JSON, attachment: None }
    }
}

/// Hands answers to the thread.
#[derive(Clone)]
pub(super) struct Replies {
    queue: SyncSender<Answer>,
    shared: Arc<Shared>,
}

impl Replies {
    /// Never blocks: when too many answers wait, this one is dropped and counted, and its client gets no reply.
    pub(super) fn send(&self, query: Query, content: Result<Content, ErrorReply>) {
        if let Err(error) = &content {
            self.shared.counters.count(&error.code);
        }
        if self.queue.try_send(Answer { query, content }).is_err() {
            self.shared.counters.count(REPLY_DROPPED);
        }
    }
}

pub(super) fn start(shared: &Arc<Shared>) -> Result<(Replies, JoinHandle<()>), BusError> {
    let (queue, answers) = sync_channel(QUEUE);
    let replies = Replies { queue, shared: Arc::clone(shared) };
    let shared = Arc::clone(shared);
    Ok((replies, spawn("plica-reply", move || run(&shared, &answers))?))
}

fn run(shared: &Shared, answers: &Receiver<Answer>) {
    while !shared.stopping() {
        match answers.recv_timeout(LOOK_AT_STOP) {
            Ok(answer) => send(answer),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn send(answer: Answer) {
    let Answer { query, content } = answer;
    // An error means that the client is gone.
    let _ = match content {
        Ok(content) => {
            let reply = query.reply(content.key, content.payload).encoding(Encoding::from(content.encoding));
            match content.attachment {
                Some(attachment) => reply.attachment(attachment).wait(),
                None => reply.wait(),
            }
        }
        Err(error) => query.reply_err(error.to_json()).encoding(Encoding::from(ENCODING_JSON)).wait(),
    };
}
