//! Requests passed between the threads of the bus.

use std::sync::mpsc::TrySendError;
use std::time::Instant;

use plica_protocol::rpc::{ErrorCode, ErrorReply};
use plica_sim::enrichment::LiveEnrichment;
use serde::Serialize;
use zenoh::query::Query;

/// A request that waits for the simulation.
pub(super) enum Request {
    /// A received query, and when it arrived.
    Query(Query, Instant),
    /// An interrupt has arrived in a queue of its own.
    Interrupt,
    /// Prepared examples.
    Activate(Box<Activation>),
}

impl Request {
    /// The query to answer.
    pub(super) fn into_query(self) -> Option<Query> {
        match self {
            Self::Query(query, _) => Some(query),
            Self::Activate(activation) => Some(activation.query),
            Self::Interrupt => None,
        }
    }
}

/// Prepared examples and the query that asked for them.
pub(super) struct Activation {
    pub(super) query: Query,
    pub(super) live: Box<LiveEnrichment>,
    pub(super) n_examples: usize,
}

/// The item that a queue refused.
pub(super) fn refused<T>(error: TrySendError<T>) -> T {
    let (TrySendError::Full(item) | TrySendError::Disconnected(item)) = error;
    item
}

/// A reply as JSON.
pub(super) fn json(reply: &impl Serialize) -> Result<String, ErrorReply> {
    serde_json::to_string(reply).map_err(|e| ErrorReply::new(ErrorCode::Internal, e.to_string()))
}
