//! Endpoints and configuration files of the bus, and their faults in the words of users.

use serde_json::Value;
use thiserror::Error;

/// Transports that both programs are built with.
const TRANSPORTS: [&str; 2] = ["tcp", "tls"];
/// Keys of files in `transport/link/tls` of a configuration.
const TLS_FILES: [&str; 5] =
    ["root_ca_certificate", "listen_certificate", "listen_private_key", "connect_certificate", "connect_private_key"];

/// An endpoint, `tcp/HOST:PORT` or `tls/HOST:PORT`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint {
    /// Transport: `tcp` or `tls`.
    pub transport: String,
    /// Name or address of the host, without brackets.
    pub host: String,
    /// Port.
    pub port: u16,
}

/// Text that is not an endpoint.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "`{endpoint}` is not an endpoint: {problem}; expected `tcp/HOST:PORT` or `tls/HOST:PORT`, such as `tcp/127.0.0.1:7447`"
)]
pub struct EndpointError {
    /// The text.
    pub endpoint: String,
    /// Fault of the text.
    pub problem: String,
}

impl Endpoint {
    /// Parses an endpoint. Zenoh's options behind `?` and `#` are left out.
    pub fn parse(text: &str) -> Result<Self, EndpointError> {
        let fault = |problem: String| EndpointError { endpoint: text.to_owned(), problem };
        let plain = text.split(['?', '#']).next().unwrap_or_default();
        let (transport, address) = plain.split_once('/').ok_or_else(|| fault("no `/` after the transport".into()))?;
        if !TRANSPORTS.contains(&transport) {
            return Err(fault(format!("the transport `{transport}` is not one of {}", TRANSPORTS.join(", "))));
        }
        let (host, port) = address.rsplit_once(':').ok_or_else(|| fault("no `:PORT` at the end".into()))?;
        let port = port.parse().map_err(|_| fault(format!("the port `{port}` is not a number from 0 to 65535")))?;
        let host = host.trim_start_matches('[').trim_end_matches(']');
        if host.is_empty() {
            return Err(fault("no host".into()));
        }
        Ok(Self { transport: transport.to_owned(), host: host.to_owned(), port })
    }

    /// Whether the transport is encrypted.
    pub fn is_tls(&self) -> bool {
        self.transport == "tls"
    }
}

/// Endpoints in the JSON of a configuration's `connect/endpoints` or `listen/endpoints`: a list, or one list per mode.
pub fn endpoints_of(value: &Value) -> Vec<String> {
    match value {
        Value::String(text) => vec![text.clone()],
        Value::Array(items) => items.iter().flat_map(endpoints_of).collect(),
        Value::Object(modes) => modes.values().flat_map(endpoints_of).collect(),
        _ => Vec::new(),
    }
}

/// Fault of a configuration file from the text of the library that read it: `LINE: sentence`, or the sentence alone.
pub fn config_fault(text: &str) -> String {
    let sentence = config_sentence(text);
    match line_of(text) {
        Some(line) => format!("{line}: {sentence}"),
        None => format!(" {sentence}"),
    }
}

fn config_sentence(text: &str) -> String {
    let message = text.split_once("msg: \"").map_or(text, |(_, rest)| rest);
    let message = message.split("\", location").next().unwrap_or_default();
    let message = message.split(" at /").next().unwrap_or_default().replace("\\\"", "\"");
    let quoted = |text: &str| text.split('`').nth(1).unwrap_or_default().to_owned();
    if message.starts_with("unknown field") {
        return format!("unknown key `{}`", quoted(&message));
    }
    if message.starts_with("Endpoints must be") {
        return "an endpoint is not of the form `tcp/HOST:PORT` or `tls/HOST:PORT`".to_owned();
    }
    let is_of_serde = ["invalid ", "missing field", "unknown variant", "duplicate field"];
    if is_of_serde.iter().any(|start| message.starts_with(start)) && !message.contains('\n') {
        return message;
    }
    if text.contains("-->") { "not valid JSON5".to_owned() } else { "not a Zenoh configuration".to_owned() }
}

/// Line in `--> 3:7` or `line: 3`.
fn line_of(text: &str) -> Option<u32> {
    let rest = ["--> ", "line: "].iter().find_map(|mark| text.split_once(mark))?.1;
    rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

/// The first file in the JSON of a configuration's `transport/link/tls` that cannot be read, with the reason.
pub fn unreadable_tls_file(tls: &Value) -> Option<String> {
    TLS_FILES.iter().find_map(|key| {
        let file = tls[*key].as_str()?;
        let error = std::fs::File::open(file).err()?;
        Some(format!("`{key}` is {file}, which cannot be read ({error})"))
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;
    use serde_json::json;

    #[test]
    fn endpoints_are_parsed_or_refused_with_the_fault() {
        let endpoint = Endpoint::parse("tls/[::1]:7447?rel=1#iface=lo").unwrap();
        assert_eq!((endpoint.is_tls(), endpoint.host.as_str(), endpoint.port), (true, "::1", 7447));
        for (text, problem) in [
            ("nonsense", "no `/`"),
            ("127.0.0.1:7447", "no `/`"),
            ("udp/127.0.0.1:7447", "`udp` is not one of tcp, tls"),
            ("tcp/127.0.0.1", "no `:PORT`"),
            ("tcp/127.0.0.1:70000", "`70000` is not a number"),
            ("tcp/:7447", "no host"),
        ] {
            let error = Endpoint::parse(text).unwrap_err().to_string();
            assert!(error.starts_with(&format!("`{text}` is not an endpoint: ")) && error.contains(problem), "{error}");
            assert!(error.ends_with("such as `tcp/127.0.0.1:7447`"), "{error}");
        }
    }

    #[test]
    fn faults_of_a_configuration_are_told_without_the_text_of_a_library() {
        let at = "at /home/user/.cargo/zenoh-config-1.10.2/src/lib.rs:1484.";
        let message = |msg: &str| {
            format!("JSON error: Message {{ msg: \"{msg}\", location: Some(Location {{ line: 4, column: 17 }}) }} {at}")
        };
        for (text, expected) in [
            (message("unknown field `nokey`, expected one of `id`, `mode`"), "4: unknown key `nokey`"),
            (message("invalid type: string \\\"a\\\", expected u64"), "4: invalid type: string \"a\", expected u64"),
            (
                message("Endpoints must be of the form <protocol>/<address>: x at /home/user/a.rs:1."),
                "4: an endpoint is not",
            ),
            (format!("JSON error:  --> 2:3\n  |\n2 | {{ bad\n  = expected array {at}"), "2: not valid JSON5"),
            (format!("something new {at}"), " not a Zenoh configuration"),
        ] {
            let fault = config_fault(&text);
            assert!(fault.starts_with(expected) && !fault.contains(".rs"), "{fault}");
        }
    }

    #[test]
    fn a_missing_certificate_is_named_with_its_key() {
        let tls = json!({"root_ca_certificate": null, "listen_certificate": "/no/such.pem"});
        let fault = unreadable_tls_file(&tls).unwrap();
        assert!(
            fault.starts_with("`listen_certificate` is /no/such.pem, which cannot be read (No such file"),
            "{fault}"
        );
        assert_eq!(unreadable_tls_file(&json!({})), None);
        assert_eq!(endpoints_of(&json!({"client": ["tcp/a:1"], "peer": ["tcp/b:2", "tls/c:3"]})).len(), 3);
    }
}
