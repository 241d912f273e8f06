//! Errors between a client and a daemon.

use std::time::Duration;

use plica_protocol::DecodeError;
use plica_protocol::connection::EndpointError;
use plica_protocol::keys::NameError;
use plica_protocol::rpc::ErrorReply;
use thiserror::Error;

/// Errors between a client and a daemon. Messages are sentences with a remedy; [`ClientError::detail`] has the text of the
/// library beneath.
#[derive(Debug, Error)]
pub enum ClientError {
    /// No connection.
    #[error("{problem}")]
    Connect {
        /// Place, cause and remedy.
        problem: String,
        /// Text of Zenoh.
        detail: String,
    },
    /// The endpoint is malformed.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    /// The configuration file cannot be read or used.
    #[error("{file}:{problem}; configs/zenoh has working files")]
    Config {
        /// The file.
        file: String,
        /// Line, if it is known, and fault.
        problem: String,
        /// Text of Zenoh.
        detail: String,
    },
    /// A session, tool or object name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The bus is connected, but no daemon serves the key.
    #[error(
        "no daemon on {place} serves `{key}`: start `plicad serve`, or wait if it is still starting; or check the session and the names in its scene"
    )]
    NoAnswer {
        /// Endpoint or configuration file.
        place: String,
        /// Queried key.
        key: String,
    },
    /// No answer in time.
    #[error(
        "`{key}` did not answer within {timeout:?}: the daemon is busy or still starting, or access control drops the query; try again"
    )]
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
    #[error("`{key}` answered with a malformed message ({problem}): are daemon and client of one version?")]
    Malformed {
        /// Queried key.
        key: String,
        /// Fault of the message.
        problem: DecodeError,
    },
    /// The chunks do not add up to the announced file.
    #[error("`{key}`: the chunks have SHA-256 {got}, {expected} was announced; try again")]
    Checksum {
        /// Queried key.
        key: String,
        /// Checksum from the daemon.
        expected: String,
        /// Checksum of the received bytes.
        got: String,
    },
    /// Zenoh refused an operation; the field is its text.
    #[error("the connection to the daemon is lost, or the bus refused an operation: check that plicad still runs")]
    Bus(String),
}

impl ClientError {
    /// Text of the library beneath, for experts.
    pub fn detail(&self) -> Option<&str> {
        match self {
            Self::Connect { detail, .. } | Self::Config { detail, .. } | Self::Bus(detail) => Some(detail),
            _ => None,
        }
    }

    pub(crate) fn bus(error: zenoh::Error) -> Self {
        Self::Bus(error.to_string())
    }
}
