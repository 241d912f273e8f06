//! Methods of the simulation, one at a time, on a thread of their own. Methods of jobs and preparations that take seconds are
//! passed to other threads.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use plica_protocol::keys::is_wildcard;
use plica_protocol::rpc::{
    EmptyRequest, ErrorCode, ErrorReply, MAX_STEP_TICKS, Method, RestoreRequest, StepRequest, decode_request,
};
use zenoh::Wait;
use zenoh::query::{Query, Queryable};

use super::activate;
use super::error::BusError;
use super::guard::guarded;
use super::replies::{Content, Replies};
use super::requests::{Activation, Request, json, refused};
use super::shared::{Shared, spawn};
use crate::realtime::{Command, CommandPort, Outcome};
use crate::wire;

/// Requests that may wait.
const QUEUE: usize = 16;
/// Time-out of a command to the simulation.
const PATIENCE: Duration = Duration::from_secs(10);
const LOOK_AT_STOP: Duration = Duration::from_millis(100);

pub(super) fn start(
    shared: &Arc<Shared>,
    port: CommandPort,
    replies: Replies,
    job_requests: SyncSender<Query>,
) -> Result<(Queryable<()>, [JoinHandle<()>; 2]), BusError> {
    let (requests_in, requests) = sync_channel(QUEUE);
    let (activate_in, activate_thread) = activate::start(shared, requests_in.clone(), replies.clone())?;
    let (busy, keys) = (replies.clone(), shared.keys.clone());
    let callback = guarded(&shared.counters, move |query: Query| {
        let method = keys.method_of_rpc(query.key_expr().as_str()).and_then(|name| Method::parse(name).ok());
        let refused = match method {
            Some(Method::Activate) => activate_in.try_send(query).err().map(refused),
            Some(method) if method.is_about_jobs() => job_requests.try_send(query).err().map(refused),
            _ => requests_in.try_send(Request::Query(query)).err().map(|error| refused(error).into_query()),
        };
        if let Some(query) = refused {
            busy.send(query, Err(ErrorReply::new(ErrorCode::Busy, "too many requests are waiting")));
        }
    });
    let queryable = shared.session.declare_queryable(shared.keys.rpc("*")).callback(callback);
    let queryable = queryable.wait().map_err(|e| shared.error(e))?;
    let worker = Worker { shared: Arc::clone(shared), port, replies, requests, outstanding: 0 };
    Ok((queryable, [activate_thread, spawn("plica-rpc", move || worker.run())?]))
}

struct Worker {
    shared: Arc<Shared>,
    port: CommandPort,
    replies: Replies,
    requests: Receiver<Request>,
    /// Commands whose answers have timed out.
    outstanding: u32,
}

impl Worker {
    fn run(mut self) {
        self.port.answered.register_current();
        while !self.shared.stopping() {
            match self.requests.recv_timeout(LOOK_AT_STOP) {
                Ok(Request::Query(query)) => self.serve(query),
                Ok(Request::Activate(activation)) => self.activate(*activation),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn serve(&mut self, query: Query) {
        let key = query.key_expr().as_str().to_owned();
        let content = self.answer(&key, &query).map(|json| Content::json(key, json));
        self.replies.send(query, content);
    }

    fn activate(&mut self, activation: Activation) {
        let Activation { query, live, n_examples } = activation;
        let key = query.key_expr().as_str().to_owned();
        let outcome = self.order(Command::Activate(live));
        if let Ok(outcome) = &outcome {
            tracing::info!("{n_examples} examples enrich the skin from tick {} on", outcome.tick);
        }
        let content = outcome.and_then(|o| json(&wire::activate_reply(&o, n_examples)));
        self.replies.send(query, content.map(|json| Content::json(key, json)));
    }

    fn answer(&mut self, key: &str, query: &Query) -> Result<String, ErrorReply> {
        if is_wildcard(key) {
            let message = format!("`{key}` is a wildcard; name one daemon and one method");
            return Err(ErrorReply::new(ErrorCode::RpcWildcard, message));
        }
        let payload = query.payload().map(|p| p.to_bytes().into_owned()).unwrap_or_default();
        self.call(Method::parse(self.shared.keys.method_of_rpc(key).unwrap_or_default())?, &payload)
    }

    fn call(&mut self, method: Method, payload: &[u8]) -> Result<String, ErrorReply> {
        let plain = |command| decode_request(payload).map(|EmptyRequest {}| command);
        let command = match method {
            Method::Step => self.step(decode_request(payload)?)?,
            Method::Restore => restore(&decode_request(payload)?)?,
            Method::Reset => plain(Command::Reset)?,
            Method::Pause => plain(Command::Pause)?,
            Method::Resume => plain(Command::Resume)?,
            Method::Snapshot => plain(Command::Snapshot)?,
            _ => return Err(ErrorReply::new(ErrorCode::Internal, "a request to another thread went astray")),
        };
        let outcome = self.order(command)?;
        match method {
            Method::Step => json(&wire::step_reply(&outcome)),
            Method::Snapshot => json(&wire::snapshot_reply(&outcome)),
            Method::Reset => {
                self.shared.intake.forget();
                json(&wire::state_reply(&outcome))
            }
            _ => json(&wire::state_reply(&outcome)),
        }
    }

    fn step(&mut self, request: StepRequest) -> Result<Command, ErrorReply> {
        if request.ticks > MAX_STEP_TICKS {
            let message = format!("ticks is {}; the allowed range is 0 to {MAX_STEP_TICKS}", request.ticks);
            return Err(ErrorReply::new(ErrorCode::RpcMalformed, message));
        }
        // A refused step must not use up poses, so the simulation is first checked to be paused.
        if !self.order(Command::Step { ticks: 0, poses: Vec::new() })?.paused {
            return Err(wire::refusal(crate::realtime::Refusal::NotPaused));
        }
        Ok(Command::Step { ticks: request.ticks, poses: self.shared.intake.take_for_step(&request.poses)? })
    }

    /// Sends a command and waits for the answer.
    fn order(&mut self, command: Command) -> Result<Outcome, ErrorReply> {
        while self.outstanding > 0 && self.port.replies.pop().is_ok() {
            self.outstanding -= 1;
        }
        let busy = || ErrorReply::new(ErrorCode::Busy, "the simulation still works on an earlier request");
        if self.outstanding > 0 || self.port.orders.push(command).is_err() {
            return Err(busy());
        }
        self.port.simulation.wake();
        let deadline = Instant::now() + PATIENCE;
        while Instant::now() < deadline && !self.shared.stopping() {
            if let Ok(reply) = self.port.replies.pop() {
                return reply.outcome.map_err(wire::refusal);
            }
            std::thread::park_timeout(Duration::from_millis(5));
        }
        self.outstanding += 1;
        Err(self.no_answer())
    }

    fn no_answer(&self) -> ErrorReply {
        if self.shared.stopping() {
            return ErrorReply::new(ErrorCode::ShuttingDown, "the daemon is stopping");
        }
        ErrorReply::new(ErrorCode::TimedOut, format!("the simulation did not answer within {} s", PATIENCE.as_secs()))
    }
}

fn restore(request: &RestoreRequest) -> Result<Command, ErrorReply> {
    let unknown = |_| ErrorReply::new(ErrorCode::UnknownSnapshot, format!("no snapshot `{}`", request.id));
    request.id.parse().map(|id| Command::Restore { id }).map_err(unknown)
}
