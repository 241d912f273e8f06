//! Errors between a client and a daemon.

use std::time::Duration;

use plica_protocol::DecodeError;
use plica_protocol::keys::NameError;
use plica_protocol::rpc::ErrorReply;
use thiserror::Error;

/// Errors between a client and a daemon.
#[derive(Debug, Error)]
pub enum ClientError {
    /// No daemon listens at the endpoint.
    #[error("no plicad answered on {place}: start one with `plicad serve` ({message})")]
    Connect {
        /// Endpoint or configuration file.
        place: String,
        /// Error of Zenoh.
        message: String,
    },
    /// Zenoh does not accept the endpoint or the configuration file.
    #[error("{place}: not a usable Zenoh configuration: {message}")]
    Config {
        /// Endpoint or configuration file.
        place: String,
        /// Error of Zenoh.
        message: String,
    },
    /// A session, tool or object name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The bus is connected, but no daemon serves the key.
    #[error(
        "no daemon on {place} serves `{key}`: start `plicad serve`, or check the session and the names in its scene"
    )]
    NoAnswer {
        /// Endpoint or configuration file.
        place: String,
        /// Queried key.
        key: String,
    },
    /// No answer in time.
    #[error("`{key}` did not answer within {timeout:?}")]
    TimedOut {
        /// Queried key.
        key: String,
        /// Time waited.
        timeout: Duration,
    },
    /// The daemon answered with an error.
    #[error("{}: {}", .0.code, .0.message)]
    Refused(ErrorReply),
    /// The reply does not follow the protocol.
    #[error("`{key}` answered with a malformed message: {source}")]
    Malformed {
        /// Queried key.
        key: String,
        /// What is wrong.
        source: DecodeError,
    },
    /// The chunks do not add up to the announced file.
    #[error("`{key}`: the chunks have SHA-256 {got}, {expected} was announced")]
    Checksum {
        /// Queried key.
        key: String,
        /// Checksum from the daemon.
        expected: String,
        /// Checksum of the received bytes.
        got: String,
    },
    /// Zenoh refused an operation.
    #[error("the bus refused: {0}")]
    Bus(String),
}

impl ClientError {
    pub(crate) fn bus(error: zenoh::Error) -> Self {
        Self::Bus(error.to_string())
    }
}
