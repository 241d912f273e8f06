//! Cause of a failed connection. Zenoh's error names none, so the endpoint is tried once more without Zenoh.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use plica_protocol::connection::{Endpoint, endpoints_of, unreadable_tls_file};
use serde_json::Value;
use zenoh::Config;

use crate::options::ClientOptions;

/// Longest wait for a host to answer.
const PATIENCE: Duration = Duration::from_secs(1);

/// Answer of a host at a port.
enum Reach {
    UnknownHost,
    /// The host refuses: no program listens at the port.
    Refused,
    /// No answer, or no way to the host.
    Silent,
    /// A program listens.
    Listens,
}

/// Place, cause and remedy of a failed connection.
pub(crate) fn cause(options: &ClientOptions, config: &Config) -> String {
    let json = |key: &str| config.get_json(key).ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
    let (place, tls) = (options.place(), json("transport/link/tls").unwrap_or_default());
    if let Some(fault) = options.config_file.is_some().then(|| unreadable_tls_file(&tls)).flatten() {
        return format!("{place}: {fault}");
    }
    let endpoints = endpoints_of(&json("connect/endpoints").unwrap_or_default());
    let Some(first) = endpoints.first() else {
        return format!("{place}: no endpoint to connect to; set connect.endpoints, such as [\"tcp/127.0.0.1:7447\"]");
    };
    let at = if options.config_file.is_some() { format!("{first} ({place})") } else { place };
    match Endpoint::parse(first) {
        Ok(endpoint) => sentence(&at, &endpoint, options.config_file.is_some()),
        Err(error) => format!("{}: {error}", options.place()),
    }
}

fn sentence(at: &str, endpoint: &Endpoint, has_config: bool) -> String {
    let Endpoint { host, port, .. } = endpoint;
    match reach(endpoint) {
        Reach::UnknownHost => format!("no plicad answered on {at}: no host is known as `{host}`; check its name"),
        Reach::Refused => {
            format!("no plicad answered on {at}: start one with `plicad serve`, or wait if it is still starting")
        }
        Reach::Silent => format!(
            "no plicad answered on {at}: no answer from {host} at port {port}; check the address, the network and the firewall"
        ),
        Reach::Listens if endpoint.is_tls() && has_config => format!(
            "{at} refused the encrypted connection: check that root_ca_certificate is the authority of the daemon, that the \
             authority has signed connect_certificate, that connect_private_key belongs to it, that neither has expired, and \
             that the daemon's certificate names `{host}`"
        ),
        Reach::Listens if endpoint.is_tls() => {
            format!("{at} asks for certificates: name them in a file for --config; configs/zenoh/mtls.json5 shows how")
        }
        Reach::Listens => format!(
            "a program listens on {at}, but did not answer as plicad does: it is another program, or a plicad that is still \
             starting, has as many clients as it takes, or wants `tls/` in place of `tcp/` (with certificates, --config)"
        ),
    }
}

fn reach(endpoint: &Endpoint) -> Reach {
    let Ok(addresses) = (endpoint.host.as_str(), endpoint.port).to_socket_addrs() else { return Reach::UnknownHost };
    let mut answer = Reach::UnknownHost;
    for address in addresses {
        answer = match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(_) => return Reach::Listens,
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => Reach::Refused,
            Err(_) => Reach::Silent,
        };
    }
    answer
}
