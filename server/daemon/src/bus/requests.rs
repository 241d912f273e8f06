//! Requests passed between the threads of the bus.

use std::sync::mpsc::TrySendError;

use plica_protocol::rpc::{ErrorCode, ErrorReply};
use plica_sim::enrichment::LiveEnrichment;
use serde::Serialize;
use zenoh::query::Query;

/// A request that waits for the simulation.
pub(super) enum Request {
    /// A received query.
    Query(Query),
    /// Prepared examples.
    Activate(Box<Activation>),
}

impl Request {
    pub(super) fn into_query(self) -> Query {
        match self {
            Self::Query(query) => query,
            Self::Activate(activation) => activation.query,
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
