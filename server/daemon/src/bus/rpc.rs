//! Methods of the simulation, one at a time, on a thread of their own. Methods of jobs and preparations that take seconds are
//! passed to other threads. An interrupt overtakes the step that runs.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use plica_protocol::keys::is_wildcard;
use plica_protocol::rpc::{
    ANSWER_WITHIN, Done, EmptyRequest, ErrorCode, ErrorReply, Method, RestoreRequest, StepRequest, decode_request,
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
/// Extra wait for the simulation's answer to a step that has reached its deadline.
const GRACE: Duration = Duration::from_millis(500);
const LOOK_AT_STOP: Duration = Duration::from_millis(100);
/// Interval of looks at interrupts while a command is carried out.
const LOOK_AT_INTERRUPTS: Duration = Duration::from_millis(5);

pub(super) fn start(
    shared: &Arc<Shared>,
    port: CommandPort,
    replies: Replies,
    job_requests: SyncSender<Query>,
) -> Result<(Queryable<()>, [JoinHandle<()>; 2]), BusError> {
    let (requests_in, requests) = sync_channel(QUEUE);
    let (interrupts_in, interrupts) = sync_channel(QUEUE);
    let (activate_in, activate_thread) = activate::start(shared, requests_in.clone(), replies.clone())?;
    let (busy, keys) = (replies.clone(), shared.keys.clone());
    let callback = guarded(&shared.counters, move |query: Query| {
        let method = keys.method_of_rpc(query.key_expr().as_str()).and_then(|name| Method::parse(name).ok());
        let refused = match method {
            Some(Method::Activate) => activate_in.try_send(query).err().map(refused),
            Some(Method::Interrupt) => {
                let refused = interrupts_in.try_send(query).err().map(refused);
                // Full: the thread is at work, and looks at interrupts by itself.
                let _ = requests_in.try_send(Request::Interrupt);
                refused
            }
            Some(method) if method.is_about_jobs() => job_requests.try_send(query).err().map(refused),
            _ => {
                let sent = requests_in.try_send(Request::Query(query, Instant::now()));
                sent.err().and_then(|error| refused(error).into_query())
            }
        };
        if let Some(query) = refused {
            busy.send(query, Err(too_many()));
        }
    });
    let queryable = shared.session.declare_queryable(shared.keys.rpc("*")).callback(callback);
    let queryable = queryable.wait().map_err(|e| shared.error(e))?;
    let worker = Worker {
        shared: Arc::clone(shared),
        port,
        replies,
        requests,
        interrupts,
        interrupting: Vec::with_capacity(QUEUE),
        outstanding: 0,
    };
    Ok((queryable, [activate_thread, spawn("plica-rpc", move || worker.run())?]))
}

fn too_many() -> ErrorReply {
    ErrorReply::new(ErrorCode::Busy, "too many requests are waiting")
}

struct Worker {
    shared: Arc<Shared>,
    port: CommandPort,
    replies: Replies,
    requests: Receiver<Request>,
    interrupts: Receiver<Query>,
    /// Interrupts of the command that is carried out, to be answered after it.
    interrupting: Vec<Query>,
    /// Commands whose answers have timed out.
    outstanding: u32,
}

impl Worker {
    fn run(mut self) {
        self.port.answered.register_current();
        while !self.shared.stopping() {
            match self.requests.recv_timeout(LOOK_AT_STOP) {
                Ok(Request::Query(query, arrived)) => self.serve(query, arrived + ANSWER_WITHIN),
                Ok(Request::Activate(activation)) => self.activate(*activation),
                Ok(Request::Interrupt) | Err(RecvTimeoutError::Timeout) => self.serve_interrupts(),
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn serve(&mut self, query: Query, deadline: Instant) {
        let key = query.key_expr().as_str().to_owned();
        let content = self.answer(&key, &query, deadline).map(|json| Content::json(key, json));
        self.replies.send(query, content);
    }

    /// Interrupts that meet no step.
    fn serve_interrupts(&mut self) {
        while let Ok(query) = self.interrupts.try_recv() {
            self.serve(query, Instant::now() + ANSWER_WITHIN);
        }
    }

    fn activate(&mut self, activation: Activation) {
        let Activation { query, live, n_examples } = activation;
        let key = query.key_expr().as_str().to_owned();
        let outcome = self.order(Command::Activate(live), Instant::now() + ANSWER_WITHIN);
        if let Ok(outcome) = &outcome {
            tracing::info!("{n_examples} examples enrich the skin from tick {} on", outcome.tick);
        }
        let content = outcome.and_then(|o| json(&wire::activate_reply(&o, n_examples)));
        self.replies.send(query, content.map(|json| Content::json(key, json)));
    }

    fn answer(&mut self, key: &str, query: &Query, deadline: Instant) -> Result<String, ErrorReply> {
        if is_wildcard(key) {
            let message = format!("`{key}` is a wildcard; name one daemon and one method");
            return Err(ErrorReply::new(ErrorCode::RpcWildcard, message));
        }
        let payload = query.payload().map(|p| p.to_bytes().into_owned()).unwrap_or_default();
        let method = Method::parse(self.shared.keys.method_of_rpc(key).unwrap_or_default())?;
        if Instant::now() >= deadline {
            // Its client may have given up and asked again: carrying it out now could do it twice.
            let message = format!("the request has waited for {} s; nothing was done", ANSWER_WITHIN.as_secs());
            return Err(ErrorReply::new(ErrorCode::Busy, message));
        }
        self.call(method, &payload, deadline)
    }

    fn call(&mut self, method: Method, payload: &[u8], deadline: Instant) -> Result<String, ErrorReply> {
        let command = match method {
            Method::Step => return self.step(&decode_request(payload)?, deadline),
            Method::Restore => restore(&decode_request(payload)?)?,
            Method::Reset => plain(payload, Command::Reset)?,
            Method::Pause => plain(payload, Command::Pause)?,
            Method::Resume => plain(payload, Command::Resume)?,
            Method::Snapshot => plain(payload, Command::Snapshot)?,
            Method::Interrupt => plain(payload, Command::Interrupt)?,
            _ => return Err(astray()),
        };
        let outcome = self.order(command, deadline)?;
        if matches!(method, Method::Reset | Method::Restore) {
            self.shared.intake.forget();
        }
        match method {
            Method::Snapshot => json(&wire::snapshot_reply(&outcome)),
            _ => json(&wire::state_reply(&outcome)),
        }
    }

    fn step(&mut self, request: &StepRequest, deadline: Instant) -> Result<String, ErrorReply> {
        request.check()?;
        // A refused step must not use up poses, so the simulation is first checked to be paused, and where it is.
        let present = self.order(Command::Step { ticks: 0, poses: Vec::new(), deadline }, deadline)?;
        if !present.paused {
            return Err(wire::refusal(crate::realtime::Refusal::NotPaused));
        }
        if let Some(from_tick) = request.from_tick.filter(|tick| *tick != present.tick) {
            return Err(wire::wrong_tick(&present, from_tick));
        }
        let poses = self.shared.intake.take_for_step(request, present.sim_time_s)?;
        let outcome = self.order(Command::Step { ticks: request.ticks, poses, deadline }, deadline)?;
        json(&wire::step_reply(&outcome, request.ticks)?)
    }

    /// Sends a command and waits for the answer.
    fn order(&mut self, command: Command, deadline: Instant) -> Result<Outcome, ErrorReply> {
        self.send(command)?;
        let outcome = self.wait(deadline, Self::hear_interrupts);
        if !self.interrupting.is_empty() {
            self.answer_interrupts(deadline);
        }
        outcome
    }

    fn send(&mut self, command: Command) -> Result<(), ErrorReply> {
        while self.outstanding > 0 && self.port.replies.pop().is_ok() {
            self.outstanding -= 1;
        }
        if self.outstanding > 0 || self.port.orders.push(command).is_err() {
            return Err(ErrorReply::new(ErrorCode::Busy, "the simulation still works on an earlier request"));
        }
        self.port.simulation.wake();
        Ok(())
    }

    /// Waits for the answer to the oldest command, and does something else meanwhile.
    fn wait(&mut self, deadline: Instant, meanwhile: fn(&mut Self)) -> Result<Outcome, ErrorReply> {
        let deadline = deadline + GRACE;
        while Instant::now() < deadline && !self.shared.stopping() {
            if let Ok(reply) = self.port.replies.pop() {
                return reply.outcome.map_err(wire::refusal);
            }
            meanwhile(self);
            std::thread::park_timeout(LOOK_AT_INTERRUPTS);
        }
        self.outstanding += 1;
        Err(self.no_answer())
    }

    /// Passes the first interrupt on; later ones wait for the same answer.
    fn hear_interrupts(&mut self) {
        while let Ok(query) = self.interrupts.try_recv() {
            let payload = query.payload().map(|p| p.to_bytes().into_owned()).unwrap_or_default();
            if let Err(error) = plain(&payload, ()) {
                self.replies.send(query, Err(error));
            } else if self.interrupting.len() == QUEUE {
                self.replies.send(query, Err(too_many()));
            } else if !self.interrupting.is_empty() || self.port.orders.push(Command::Interrupt).is_ok() {
                self.port.simulation.wake();
                self.interrupting.push(query);
            } else {
                self.replies.send(query, Err(too_many()));
            }
        }
    }

    fn answer_interrupts(&mut self, deadline: Instant) {
        let answer = self.wait(deadline, |_| {}).and_then(|outcome| json(&wire::state_reply(&outcome)));
        for query in std::mem::take(&mut self.interrupting) {
            let key = query.key_expr().as_str().to_owned();
            self.replies.send(query, answer.clone().map(|json| Content::json(key, json)));
        }
    }

    fn no_answer(&self) -> ErrorReply {
        if self.shared.stopping() {
            return ErrorReply::new(ErrorCode::ShuttingDown, "the daemon is stopping");
        }
        let message =
            "the simulation did not answer in time; whether it has done what was asked, or will, is not known";
        ErrorReply { done: Done::Unknown, ..ErrorReply::new(ErrorCode::TimedOut, message) }
    }
}

/// The command of a request without arguments.
fn plain<T>(payload: &[u8], command: T) -> Result<T, ErrorReply> {
    decode_request(payload).map(|EmptyRequest {}| command)
}

fn restore(request: &RestoreRequest) -> Result<Command, ErrorReply> {
    let unknown = || ErrorReply::new(ErrorCode::UnknownSnapshot, format!("no snapshot `{}`", request.id));
    request.number().map(|id| Command::Restore { id }).ok_or_else(unknown)
}

fn astray() -> ErrorReply {
    ErrorReply { done: Done::No, ..ErrorReply::new(ErrorCode::Internal, "a request to another thread went astray") }
}
