//! A deaf bus, remembered over a restart: peers that were connected both times are named.

use std::collections::BTreeSet;
use std::path::Path;

use plica_daemon::bus::Peer;
use plica_training::{MAX_RECORD_BYTES, RegularFile, now_unix_s, write_json_atomically};
use serde::{Deserialize, Serialize};

/// Exit code of a daemon whose bus is deaf: start it again.
pub const DEAF: u8 = 76;
/// Name of the record in the data folder.
const FILE: &str = "deaf.json";
/// Two times within this belong together \[s\].
const TOGETHER_S: u64 = 60;

/// Why the daemon ends.
#[derive(Debug, thiserror::Error)]
#[error(
    "the bus is deaf: own queries have had no answer for {:.1} s while the simulation ran, and it will not recover; start plicad \
     again (exit code {DEAF}){}", *silent_ms as f64 / 1e3, suspicion(repeated)
)]
pub struct Deafness {
    silent_ms: u64,
    /// Peers that were connected now and at a deafness less than a minute ago.
    repeated: Vec<String>,
}

/// The last deafness.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Record {
    unix_s: u64,
    peers: Vec<String>,
}

impl Deafness {
    /// Notes a deafness in the data folder, if there is one, and compares it with the last.
    pub fn note(silent_ms: u64, peers: &[Peer], data: Option<&Path>) -> Self {
        let now = Record { unix_s: now_unix_s(), peers: peers.iter().map(ToString::to_string).collect() };
        let Some(file) = data.map(|folder| folder.join(FILE)) else {
            return Self { silent_ms, repeated: Vec::new() };
        };
        let text = RegularFile::open_unlinked(&file, MAX_RECORD_BYTES).and_then(RegularFile::read);
        let last = text.ok().and_then(|text| serde_json::from_slice::<Record>(&text).ok());
        if let Err(error) = write_json_atomically(&file, &now) {
            tracing::warn!("{}: {error}", file.display());
        }
        let last = last.filter(|last| now.unix_s.saturating_sub(last.unix_s) < TOGETHER_S).unwrap_or_default();
        let before: BTreeSet<_> = last.peers.iter().collect();
        let repeated = now.peers.iter().filter(|peer| before.contains(peer)).cloned().collect();
        Self { silent_ms, repeated }
    }
}

fn suspicion(repeated: &[String]) -> String {
    match repeated {
        [] => String::new(),
        peers => format!("; the second time within a minute, with the same peers connected: {}", peers.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    fn peer(address: &str) -> Peer {
        Peer { address: address.into(), process: None }
    }

    #[test]
    fn a_second_deafness_names_the_peers_of_both() {
        let folder = tempfile::tempdir().unwrap();
        let data = Some(folder.path());
        let first = Deafness::note(1800, &[peer("10.0.0.1"), peer("10.0.0.2")], data).to_string();
        assert!(first.contains("1.8 s") && !first.contains("10.0.0"), "{first}");
        let second = Deafness::note(1800, &[peer("10.0.0.2"), peer("10.0.0.3")], data).to_string();
        assert!(second.contains("10.0.0.2") && !second.contains("10.0.0.3"), "{second}");
        // A record of long ago accuses nobody.
        let old = Record { unix_s: now_unix_s() - 2 * TOGETHER_S, peers: vec!["10.0.0.2".into()] };
        write_json_atomically(&folder.path().join(FILE), &old).unwrap();
        let third = Deafness::note(1800, &[peer("10.0.0.2")], data).to_string();
        assert!(!third.contains("10.0.0.2"), "{third}");
    }
}
