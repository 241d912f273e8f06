//! Opens the Zenoh session, by default on loopback only.

use std::io::ErrorKind;
use std::net::TcpListener;
use std::path::PathBuf;
use std::time::Duration;

use plica_protocol::connection::{Endpoint, config_fault, endpoints_of, unreadable_tls_file};
use plica_protocol::keys::Keys;
use plica_protocol::{DEFAULT_ENDPOINT, DEFAULT_SESSION};
use serde_json::Value;
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
    let settings = config.clone();
    let session = zenoh::open(config).wait();
    let session = session.map_err(|error| {
        tracing::debug!("Zenoh: {error}");
        unheard(options, &settings)
    })?;
    refuse_second_daemon(&session, &options.session)?;
    Ok(session)
}

/// Ports of this machine that the configuration listens on.
pub(super) fn ports(options: &BusOptions) -> Vec<u16> {
    let Ok(config) = config(options) else { return Vec::new() };
    endpoints_of(&json(&config, "listen/endpoints"))
        .iter()
        .filter_map(|endpoint| Endpoint::parse(endpoint).ok())
        .map(|endpoint| endpoint.port)
        .collect()
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
        Some(file) => {
            let name = file.display().to_string();
            std::fs::File::open(file)
                .map_err(|e| BusError::Config { file: name.clone(), problem: format!(" cannot be read ({e})") })?;
            Config::from_file(file).map_err(|e| config_error(name, &e))?
        }
        None => Config::from_json5(DEFAULT_ZENOH_CONFIG)
            .map_err(|e| config_error("the built-in configuration".into(), &e))?,
    };
    if let Some(endpoint) = &options.listen {
        Endpoint::parse(endpoint)?;
        let endpoints = serde_json::json!([endpoint]).to_string();
        config.insert_json5("listen/endpoints", &endpoints).map_err(|e| config_error("--listen".into(), &e))?;
    }
    Ok(config)
}

fn config_error(file: String, error: &zenoh::Error) -> BusError {
    tracing::debug!("Zenoh: {error}");
    BusError::Config { file, problem: config_fault(&error.to_string()) }
}

/// Value of a key of the configuration; null if it has none.
fn json(config: &Config, key: &str) -> Value {
    config.get_json(key).ok().and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
}

/// Cause of a bus that cannot be opened. Zenoh's error names none, so each endpoint is tried once more without Zenoh.
fn unheard(options: &BusOptions, config: &Config) -> BusError {
    let endpoints = endpoints_of(&json(config, "listen/endpoints"));
    let tried = endpoints.iter().find_map(|endpoint| {
        let problem = match Endpoint::parse(endpoint) {
            Ok(parsed) => listen_fault(&parsed)?,
            Err(error) => error.to_string(),
        };
        Some(BusError::Listen { endpoint: endpoint.clone(), problem })
    });
    tried.unwrap_or_else(|| {
        let tls = json(config, "transport/link/tls");
        let is_tls = endpoints.iter().any(|endpoint| endpoint.starts_with("tls/"));
        let problem = match unreadable_tls_file(&tls) {
            Some(fault) => fault,
            None if is_tls && tls["listen_certificate"].is_null() => {
                "`tls/` takes certificates: name them in --zenoh-config, as configs/zenoh/mtls.json5 does".into()
            }
            None if is_tls => {
                "the certificates cannot be used: check that they are PEM files, that listen_private_key \
                               belongs to listen_certificate, and that neither has expired"
                    .into()
            }
            None => "the bus refuses its configuration; --verbose adds the text of Zenoh".into(),
        };
        BusError::Listen { endpoint: options.place(), problem }
    })
}

/// Reason why this machine cannot listen at an endpoint; `None` if it can.
fn listen_fault(endpoint: &Endpoint) -> Option<String> {
    let Endpoint { host, port, .. } = endpoint;
    let error = TcpListener::bind((host.as_str(), *port)).err()?;
    Some(match error.kind() {
        ErrorKind::AddrInUse => "the address is in use; choose another port".into(),
        ErrorKind::PermissionDenied => format!("port {port} takes privileges; choose one above 1023"),
        ErrorKind::AddrNotAvailable => {
            format!("this machine does not have the address {host}; 127.0.0.1 is loopback, 0.0.0.0 all interfaces")
        }
        _ => format!("no host is known as `{host}`; give an address of this machine"),
    })
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
        // Other errors are told when Zenoh has met them too.
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

    fn refusal(options: &BusOptions) -> String {
        open(options).map(|_| ()).unwrap_err().to_string()
    }

    #[test]
    fn faults_of_the_bus_are_told_with_a_remedy_and_without_the_text_of_zenoh() {
        let listen = |endpoint: &str| BusOptions { listen: Some(endpoint.into()), ..BusOptions::default() };
        for (endpoint, expected) in [
            (
                "nonsense",
                "--listen: `nonsense` is not an endpoint: no `/` after the transport; expected `tcp/HOST:PORT`",
            ),
            (
                "udp/127.0.0.1:7447",
                "--listen: `udp/127.0.0.1:7447` is not an endpoint: the transport `udp` is not one of tcp, tls",
            ),
            (
                "tcp/192.0.2.1:7447",
                "cannot listen on tcp/192.0.2.1:7447: this machine does not have the address 192.0.2.1",
            ),
            ("tcp/no-such-host.invalid:7447", "cannot listen on tcp/no-such-host.invalid:7447: no host is known as"),
            (
                "tls/127.0.0.1:0",
                "cannot listen on tls/127.0.0.1:0: `tls/` takes certificates: name them in --zenoh-config",
            ),
        ] {
            let message = refusal(&listen(endpoint));
            assert!(message.starts_with(expected) && !message.contains(".rs"), "{message}");
        }
    }

    #[test]
    fn faults_of_a_configuration_file_name_file_line_and_key() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |name: &str, text: &str| {
            let file = folder.path().join(name);
            std::fs::write(&file, text).unwrap();
            refusal(&BusOptions { zenoh_config: Some(file), ..BusOptions::default() })
        };
        let message = refused("key.json5", "{\n  mode: \"peer\",\n  nokey: 1,\n}");
        assert!(message.contains("key.json5:3: unknown key `nokey`; configs/zenoh has working files"), "{message}");
        let message = refused("bad.json5", "{\n  mode: \n}");
        assert!(message.contains("bad.json5:") && message.contains(": not valid JSON5; "), "{message}");
        let tls = "{listen: {endpoints: [\"tls/127.0.0.1:0\"]}, transport: {link: {tls: {listen_certificate: \"/no/such.pem\"}}}}";
        let message = refused("tls.json5", tls);
        assert!(message.contains("`listen_certificate` is /no/such.pem, which cannot be read"), "{message}");
        let missing = refusal(&BusOptions { zenoh_config: Some("no/such.json5".into()), ..BusOptions::default() });
        assert!(missing.starts_with("no/such.json5: cannot be read (No such file"), "{missing}");
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
