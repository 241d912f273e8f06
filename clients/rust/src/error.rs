//! What can go wrong between a client and a daemon.

use std::time::Duration;

use plica_protocol::DecodeError;
use plica_protocol::keys::NameError;
use plica_protocol::rpc::ErrorReply;
use thiserror::Error;

/// What can go wrong between a client and a daemon.
#[derive(Debug, Error)]
pub enum ClientError {
    /// Nobody listens there.
    #[error("no plicad answered on {place}: start one with `plicad serve` ({message})")]
    Connect {
        /// Endpoint or configuration file.
        place: String,
        /// What Zenoh said.
        message: String,
    },
    /// An endpoint or a configuration file that Zenoh does not accept.
    #[error("{place}: not a usable Zenoh configuration: {message}")]
    Config {
        /// Endpoint or configuration file.
        place: String,
        /// What Zenoh said.
        message: String,
    },
    /// A session, tool or object name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The bus is there, but nobody serves that key.
    #[error("nobody on {place} serves `{key}`: start `plicad serve`, or check the session and the names in its scene")]
    NoAnswer {
        /// Endpoint or configuration file.
        place: String,
        /// The key that was asked.
        key: String,
    },
    /// No answer in time.
    #[error("`{key}` did not answer within {timeout:?}")]
    TimedOut {
        /// The key that was asked.
        key: String,
        /// How long was waited.
        timeout: Duration,
    },
    /// The daemon answered with an error.
    #[error("{}: {}", .0.code, .0.message)]
    Refused(ErrorReply),
    /// The daemon answered with something else than the protocol says.
    #[error("`{key}` answered with a malformed message: {source}")]
    Malformed {
        /// The key that was asked.
        key: String,
        /// What is wrong.
        source: DecodeError,
    },
    /// The pieces do not make the whole.
    #[error("`{key}`: the pieces have SHA-256 {got}, {expected} was announced")]
    Checksum {
        /// The key that was asked.
        key: String,
        /// What the daemon announced.
        expected: String,
        /// What arrived.
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
