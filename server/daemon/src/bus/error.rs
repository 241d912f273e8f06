//! Errors of the bus.

use plica_protocol::connection::EndpointError;

/// Why the bus cannot be opened. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The address is taken.
    #[error(
        "cannot listen on {endpoint}: the address is in use{owner}; stop that program, or choose another address with --listen"
    )]
    AddressInUse {
        /// Requested endpoint.
        endpoint: String,
        /// Process that holds it, if visible.
        owner: String,
    },
    /// The endpoint is malformed.
    #[error("--listen: {0}")]
    Endpoint(#[from] EndpointError),
    /// The configuration file cannot be used.
    #[error("{file}:{problem}; configs/zenoh has working files")]
    Config {
        /// The file.
        file: String,
        /// Line, if it is known, and fault.
        problem: String,
    },
    /// The session name cannot be part of a key.
    #[error("--session: {0}")]
    Session(#[from] plica_protocol::keys::NameError),
    /// Another daemon serves the session on the same bus.
    #[error("{other}: stop it, or choose another --session")]
    SecondDaemon {
        /// The other one.
        other: String,
    },
    /// The endpoint cannot be listened on, or a file of the configuration cannot be used.
    #[error("cannot listen on {endpoint}: {problem}")]
    Listen {
        /// Requested endpoint.
        endpoint: String,
        /// Cause and remedy.
        problem: String,
    },
    /// A key cannot be served.
    #[error(
        "the bus does not take {root}: is it restricted by access control in --zenoh-config? (--verbose adds the text of Zenoh)"
    )]
    Declare {
        /// First part of the keys.
        root: String,
    },
    /// A thread cannot be started.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}
