//! Options of a connection.

use std::path::PathBuf;
use std::time::Duration;

use plica_protocol::connection::{Endpoint, config_fault};
use plica_protocol::{DEFAULT_ENDPOINT, DEFAULT_SESSION};
use zenoh::Config;

use crate::error::ClientError;

/// Options of a connection.
#[derive(Debug, Clone)]
pub struct ClientOptions {
    /// Zenoh endpoint of the daemon. Not used if there is a configuration file.
    pub endpoint: String,
    /// Session name of the keys.
    pub session: String,
    /// Zenoh configuration file (JSON5), for TLS or a router; it sets mode and endpoints.
    pub config_file: Option<PathBuf>,
    /// Time-out of a request.
    pub timeout: Duration,
}

impl Default for ClientOptions {
    fn default() -> Self {
        Self {
            endpoint: DEFAULT_ENDPOINT.to_owned(),
            session: DEFAULT_SESSION.to_owned(),
            config_file: None,
            timeout: Duration::from_secs(5),
        }
    }
}

impl ClientOptions {
    /// Endpoint or configuration file, for messages.
    pub fn place(&self) -> String {
        match &self.config_file {
            Some(file) => file.display().to_string(),
            None => self.endpoint.clone(),
        }
    }

    /// Client mode, one endpoint, no scouting; or the configuration file.
    pub(crate) fn zenoh_config(&self) -> Result<Config, ClientError> {
        let fault = |error: zenoh::Error| {
            let detail = error.to_string();
            ClientError::Config { file: self.place(), problem: config_fault(&detail), detail }
        };
        if let Some(file) = &self.config_file {
            let unreadable = |error: std::io::Error| {
                let (problem, detail) = (format!(" cannot be read ({error})"), error.to_string());
                ClientError::Config { file: self.place(), problem, detail }
            };
            std::fs::File::open(file).map_err(unreadable)?;
            return Config::from_file(file).map_err(fault);
        }
        Endpoint::parse(&self.endpoint)?;
        let endpoints = serde_json::json!([self.endpoint]).to_string();
        let timeout_ms = self.timeout.as_millis().to_string();
        let settings = [
            ("mode", "\"client\""),
            ("connect/endpoints", &endpoints),
            ("scouting/multicast/enabled", "false"),
            ("scouting/gossip/enabled", "false"),
            ("queries_default_timeout", &timeout_ms),
            ("transport/unicast/open_timeout", &timeout_ms),
            ("transport/link/rx/max_message_size", "16777216"),
        ];
        let mut config = Config::default();
        for (key, value) in settings {
            config.insert_json5(key, value).map_err(fault)?;
        }
        Ok(config)
    }
}
