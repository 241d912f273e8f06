//! Errors of the bus.

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
    /// The configuration file cannot be used.
    #[error("{file}: {problem}; see configs/zenoh for working files")]
    Config {
        /// The file.
        file: String,
        /// Error of Zenoh.
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
    /// Any other error of Zenoh.
    #[error("the bus cannot be opened on {endpoint}: {problem}")]
    Zenoh {
        /// Requested endpoint.
        endpoint: String,
        /// Error of Zenoh.
        problem: String,
    },
    /// A thread cannot be started.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}
