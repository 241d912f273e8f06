//! Queries and method calls: status, methods, meshes, the present skin.

use std::time::Duration;

use plica_protocol::chunk::ChunkHeader;
use plica_protocol::keys::check_name;
use plica_protocol::rpc::{
    ActivateReply, ActivateRequest, Done, EmptyRequest, ErrorCode, ErrorReply, Method, StateReply, StepPose, StepReply,
    StepRequest,
};
use plica_protocol::status::Status;
use plica_protocol::{DecodeError, ENCODING_JSON};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use sha2::{Digest, Sha256};
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::query::{Reply, ReplyError};
use zenoh::sample::Sample;

use crate::client::Client;
use crate::error::ClientError;
use crate::subscribe::SkinMessage;

/// Extra wait for Zenoh's own time-out, which arrives as an error reply.
const GRACE: Duration = Duration::from_millis(500);
/// Time-out of `activate`, which prepares the tables of examples.
const ACTIVATE_TIMEOUT: Duration = Duration::from_secs(60);
/// Largest accepted length, above that of any mesh or snapshot.
const MAX_WHOLE_BYTES: u64 = 1 << 31;

impl Client {
    /// Status of the daemon.
    pub fn status(&self) -> Result<Status, ClientError> {
        let key = self.keys.status();
        let reply = self.ask(&key, None)?;
        parse_json(&key, &reply.payload().to_bytes())
    }

    /// Status as sent, including keys that this version does not know.
    pub fn status_json(&self) -> Result<Value, ClientError> {
        let key = self.keys.status();
        let reply = self.ask(&key, None)?;
        parse_json(&key, &reply.payload().to_bytes())
    }

    /// Calls a method with JSON arguments; the daemon's error replies become [`ClientError::Refused`].
    pub fn rpc(&self, method: &str, arguments: &Value) -> Result<Value, ClientError> {
        self.call(method, arguments)
    }

    /// Calls a method with typed arguments and a typed reply (see `protocol::rpc`).
    pub fn call<Q: Serialize, R: DeserializeOwned>(&self, method: &str, request: &Q) -> Result<R, ClientError> {
        let is_slow = method == Method::Activate.name();
        self.call_within(method, request, if is_slow { ACTIVATE_TIMEOUT.max(self.timeout) } else { self.timeout })
    }

    pub(crate) fn call_within<Q: Serialize, R: DeserializeOwned>(
        &self,
        method: &str,
        request: &Q,
        timeout: Duration,
    ) -> Result<R, ClientError> {
        check_name(method)?;
        let key = self.keys.rpc(method);
        let json = serde_json::to_vec(request).map_err(|error| ClientError::Bus(error.to_string()))?;
        let reply = self.ask_within(&key, Some(json), timeout)?;
        parse_json(&key, &reply.payload().to_bytes())
    }

    /// Lock-step: applies the poses, then runs the ticks. The daemon must be paused. A step that the daemon's limit of time cuts
    /// into parts is continued.
    pub fn step(&self, ticks: u32, poses: Vec<StepPose>) -> Result<StepReply, ClientError> {
        let mut request = StepRequest { ticks, poses, from_tick: None };
        loop {
            let reply = self.call(Method::Step.name(), &request);
            let rest = match &reply {
                Err(ClientError::Refused(error)) => rest_of_step(&request, error),
                _ => None,
            };
            request = match rest {
                Some(rest) => rest,
                None => return reply,
            };
        }
    }

    /// Ends the step of another client or thread after its present tick, and returns the state.
    pub fn interrupt(&self) -> Result<StateReply, ClientError> {
        self.call(Method::Interrupt.name(), &EmptyRequest {})
    }

    /// Activates other examples: `database` is the id of a finished job, or the name of a file in the folder that the daemon was
    /// started with (`--databases`). Takes seconds, during which the simulation continues with the present examples.
    pub fn activate(&self, database: &str) -> Result<ActivateReply, ClientError> {
        self.call(Method::Activate.name(), &ActivateRequest { database: database.to_owned() })
    }

    /// Mesh of an object as GLB, fetched in chunks, with its SHA-256 checked.
    pub fn mesh(&self, object: &str) -> Result<Vec<u8>, ClientError> {
        check_name(object)?;
        self.fetch_whole(&self.keys.mesh(object))
    }

    /// The newest frame of an object.
    pub fn skin_now(&self, object: &str) -> Result<SkinMessage, ClientError> {
        check_name(object)?;
        let key = self.keys.skin(object);
        let reply = self.ask(&key, None)?;
        let message = SkinMessage::decode(reply.payload().to_bytes().into_owned());
        message.map_err(|problem| ClientError::Malformed { key, problem })
    }

    fn fetch_whole(&self, key: &str) -> Result<Vec<u8>, ClientError> {
        let mut whole: Vec<u8> = Vec::new();
        let mut announced: Option<ChunkHeader> = None;
        loop {
            let reply = self.ask(&format!("{key}?offset={}", whole.len()), None)?;
            let piece = reply.payload().to_bytes();
            let header = chunk_header(key, &reply)?;
            if announced.as_ref().is_some_and(|first| first.sha256 != header.sha256) {
                // Replaced between two chunks: start again.
                whole.clear();
                announced = None;
                continue;
            }
            check_piece(key, &header, whole.len() as u64, piece.len())?;
            if header.total_bytes > MAX_WHOLE_BYTES {
                return Err(wrong_length(key, MAX_WHOLE_BYTES, header.total_bytes));
            }
            whole.extend_from_slice(&piece);
            if whole.len() as u64 == header.total_bytes {
                check_sum(key, &header, Sha256::new_with_prefix(&whole))?;
                return Ok(whole);
            }
            announced = Some(header);
        }
    }

    /// The first reply to a query.
    pub(crate) fn ask(&self, selector: &str, payload: Option<Vec<u8>>) -> Result<Sample, ClientError> {
        self.ask_within(selector, payload, self.timeout)
    }

    fn ask_within(&self, selector: &str, payload: Option<Vec<u8>>, timeout: Duration) -> Result<Sample, ClientError> {
        let query = self.session.get(selector).timeout(timeout);
        let query = match payload {
            Some(json) => query.payload(json).encoding(Encoding::from(ENCODING_JSON)),
            None => query,
        };
        let replies = query.wait().map_err(ClientError::bus)?;
        match replies.recv_timeout(timeout + GRACE) {
            Ok(Some(reply)) => accept(selector, reply, timeout),
            Ok(None) => Err(timed_out(selector, timeout)),
            Err(_) => Err(ClientError::NoAnswer { place: self.place.clone(), key: key_of(selector) }),
        }
    }
}

/// The ticks that a step left when it reached its limit of time.
fn rest_of_step(request: &StepRequest, error: &ErrorReply) -> Option<StepRequest> {
    let out_of_time = error.code == ErrorCode::TimedOut.name() && error.done == Done::Partly;
    let ticks_done = error.ticks_done.filter(|_| out_of_time)?;
    let ticks = request.ticks.checked_sub(ticks_done).filter(|ticks| *ticks > 0 && ticks_done > 0)?;
    Some(StepRequest { ticks, poses: Vec::new(), from_tick: error.tick })
}

fn accept(selector: &str, reply: Reply, timeout: Duration) -> Result<Sample, ClientError> {
    reply.into_result().map_err(|error| refusal(selector, &error, timeout))
}

fn refusal(selector: &str, error: &ReplyError, timeout: Duration) -> ClientError {
    let payload = error.payload().to_bytes();
    match serde_json::from_slice::<ErrorReply>(&payload) {
        Ok(refused) => ClientError::Refused(refused),
        Err(_) if &*payload == b"Timeout" => timed_out(selector, timeout),
        Err(_) => ClientError::Bus(String::from_utf8_lossy(&payload).into_owned()),
    }
}

fn timed_out(selector: &str, timeout: Duration) -> ClientError {
    ClientError::TimedOut { key: key_of(selector), timeout }
}

fn key_of(selector: &str) -> String {
    selector.split('?').next().unwrap_or_default().to_owned()
}

fn parse_json<T: DeserializeOwned>(key: &str, bytes: &[u8]) -> Result<T, ClientError> {
    let malformed = |error: serde_json::Error| DecodeError::Json(error.to_string());
    serde_json::from_slice(bytes)
        .map_err(malformed)
        .map_err(|problem| ClientError::Malformed { key: key.to_owned(), problem })
}

pub(crate) fn chunk_header(key: &str, reply: &Sample) -> Result<ChunkHeader, ClientError> {
    let attachment = reply.attachment().map(|bytes| bytes.to_bytes().into_owned()).unwrap_or_default();
    ChunkHeader::from_json(&attachment).map_err(|problem| ClientError::Malformed { key: key.to_owned(), problem })
}

pub(crate) fn check_piece(key: &str, header: &ChunkHeader, have: u64, got: usize) -> Result<(), ClientError> {
    let left = header.total_bytes.saturating_sub(have);
    let starts_there = header.offset == have;
    let fits = (1..=left.max(1)).contains(&(got as u64)) || header.total_bytes == 0;
    if starts_there && fits { Ok(()) } else { Err(wrong_length(key, left, got as u64)) }
}

fn wrong_length(key: &str, expected: u64, got: u64) -> ClientError {
    ClientError::Malformed { key: key.to_owned(), problem: DecodeError::Length { expected, got } }
}

/// Compares the checksum of the received bytes with the announced one.
pub(crate) fn check_sum(key: &str, header: &ChunkHeader, arrived: Sha256) -> Result<(), ClientError> {
    let got: String = arrived.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    if got == header.sha256 {
        return Ok(());
    }
    Err(ClientError::Checksum { key: key.to_owned(), expected: header.sha256.clone(), got })
}
