//! Opens the Zenoh session, by default on loopback only.

use std::net::TcpListener;
use std::path::PathBuf;
use std::time::Duration;

use plica_protocol::keys::Keys;
use plica_protocol::{DEFAULT_ENDPOINT, DEFAULT_SESSION};
use zenoh::{Config, Session, Wait};

use super::error::BusError;
use super::hearing::{describe, other_daemon};
use super::port_owner::owner_of_port;

/// Built-in Zenoh configuration.
pub const DEFAULT_ZENOH_CONFIG: &str = include_str!("../../../../configs/zenoh/default.json5");

/// How long another daemon of the same session has to answer before this one begins.
const OTHER_PATIENCE: Duration = Duration::from_secs(1);

/// Endpoint and session of the daemon.
#[derive(Debug, Clone)]
pub struct BusOptions {
    /// Endpoint to listen on; `None`: the configuration's.
    pub listen: Option<String>,
    /// Name of the session in every key.
    pub session: String,
    /// Zenoh configuration in place of the built-in one.
    pub zenoh_config: Option<PathBuf>,
    /// Folder of the databases that clients may activate by name.
    pub databases: Option<PathBuf>,
}

impl Default for BusOptions {
    fn default() -> Self {
        Self { listen: None, session: DEFAULT_SESSION.into(), zenoh_config: None, databases: None }
    }
}

impl BusOptions {
    /// The endpoint, for messages.
    pub fn place(&self) -> String {
        match (&self.listen, &self.zenoh_config) {
            (Some(endpoint), _) => endpoint.clone(),
            (None, Some(file)) => format!("the endpoints of {}", file.display()),
            (None, None) => DEFAULT_ENDPOINT.into(),
        }
    }
}

pub(super) fn open(options: &BusOptions) -> Result<Session, BusError> {
    let config = config(options)?;
    if options.listen.is_some() || options.zenoh_config.is_none() {
        refuse_taken_port(&options.place())?;
    }
    let session = zenoh::open(config).wait();
    let session = session.map_err(|e| BusError::Zenoh { endpoint: options.place(), problem: e.to_string() })?;
    refuse_second_daemon(&session, &options.session)?;
    Ok(session)
}

/// Ports of this machine that the configuration listens on.
pub(super) fn ports(options: &BusOptions) -> Vec<u16> {
    let Ok(endpoints) = config(options).and_then(|c| {
        c.get_json("listen/endpoints").map_err(|e| BusError::Config { file: options.place(), problem: e.to_string() })
    }) else {
        return Vec::new();
    };
    let port = |endpoint: &str| -> Option<u16> {
        let address = endpoint.split(['?', '#']).next()?;
        address.rsplit(':').next()?.parse().ok()
    };
    endpoints.split('"').filter_map(port).collect()
}

/// Two daemons of one session would answer the same questions, which clients cannot tell apart: the later one gives way.
fn refuse_second_daemon(session: &Session, name: &str) -> Result<(), BusError> {
    let keys = Keys::new(name)?;
    let info = session.info();
    if info.routers_zid().wait().next().is_none() && info.peers_zid().wait().next().is_none() {
        return Ok(());
    }
    match other_daemon(session, &keys, OTHER_PATIENCE).flatten() {
        Some(other) => Err(BusError::SecondDaemon { other: describe(&other, keys.root()) }),
        None => Ok(()),
    }
}

fn config(options: &BusOptions) -> Result<Config, BusError> {
    let mut config = match &options.zenoh_config {
        Some(file) => Config::from_file(file)
            .map_err(|e| BusError::Config { file: file.display().to_string(), problem: e.to_string() })?,
        None => Config::from_json5(DEFAULT_ZENOH_CONFIG)
            .map_err(|e| BusError::Config { file: "the built-in configuration".into(), problem: e.to_string() })?,
    };
    if let Some(endpoint) = &options.listen {
        let endpoints = serde_json::json!([endpoint]).to_string();
        config
            .insert_json5("listen/endpoints", &endpoints)
            .map_err(|e| BusError::Config { file: "--listen".into(), problem: e.to_string() })?;
    }
    Ok(config)
}

/// Error of a taken port, with the process that holds it, which Zenoh's own message lacks.
fn refuse_taken_port(endpoint: &str) -> Result<(), BusError> {
    let Some(address) = endpoint.strip_prefix("tcp/").or(endpoint.strip_prefix("tls/")) else { return Ok(()) };
    match TcpListener::bind(address.split(['?', '#']).next().unwrap_or(address)) {
        Err(e) if e.kind() == std::io::ErrorKind::AddrInUse => {
            let owner = address.rsplit(':').next().and_then(|port| port.parse().ok()).and_then(owner_of_port);
            let owner = owner.map_or_else(
                || ", probably by another plicad or a Zenoh router".into(),
                |process| format!(" by {process}"),
            );
            Err(BusError::AddressInUse { endpoint: endpoint.into(), owner })
        }
        // Other errors keep Zenoh's message.
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn the_default_is_loopback_without_scouting() {
        let config = config(&BusOptions::default()).unwrap();
        let get = |key: &str| config.get_json(key).unwrap();
        assert!(get("listen/endpoints").contains("tcp/127.0.0.1:7447"));
        assert_eq!(get("scouting/multicast/enabled"), "false");
        assert_eq!(get("scouting/gossip/enabled"), "false");
        assert_eq!(get("transport/link/tx/queue/size/data"), "16");
        assert_eq!(get("transport/link/tx/queue/congestion_control/drop/wait_before_drop"), "0");
    }

    #[test]
    fn a_taken_port_names_its_owner() {
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/127.0.0.1:{}", taken.local_addr().unwrap().port());
        let options = BusOptions { listen: Some(endpoint), ..BusOptions::default() };
        let message = open(&options).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains("in use") && message.contains("--listen"), "{message}");
        if cfg!(target_os = "linux") {
            assert!(message.contains(&format!("process {}", std::process::id())), "{message}");
        }
    }
}
