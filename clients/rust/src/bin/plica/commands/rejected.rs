//! Poses that the daemon rejected during a command, by kind, from its status.

use std::collections::BTreeMap;

use plica_client::Client;
use plica_client::protocol::status::Status;
use serde_json::{Value, json};

/// Counts by kind.
type Kinds = BTreeMap<String, u64>;

/// Counts at the start of a command; without them (no daemon serves a status) there are none at its end.
pub(crate) struct Before(Option<BTreeMap<String, Kinds>>);

impl Before {
    pub(crate) fn new(client: &Client) -> Self {
        Self(client.status().ok().map(|status| by_tool(&status)))
    }

    /// Counts since the start. A daemon that was restarted in between counts from zero.
    pub(crate) fn since(self, client: &Client) -> Rejected {
        let (Some(before), Ok(now)) = (self.0, client.status()) else { return Rejected(BTreeMap::new()) };
        let mut since = by_tool(&now);
        for (tool, kinds) in &mut since {
            for (kind, n) in &mut *kinds {
                *n -= before.get(tool).and_then(|kinds| kinds.get(kind)).copied().filter(|old| old <= n).unwrap_or(0);
            }
            kinds.retain(|_, n| *n > 0);
        }
        since.retain(|_, kinds| !kinds.is_empty());
        Rejected(since)
    }
}

fn by_tool(status: &Status) -> BTreeMap<String, Kinds> {
    let kinds = |counters: &BTreeMap<String, u64>| counters.iter().map(|(kind, n)| (kind.clone(), *n)).collect();
    status.tools.iter().map(|(name, tool)| (name.clone(), kinds(&tool.poses_rejected))).collect()
}

/// Rejected poses by tool and kind.
pub(crate) struct Rejected(BTreeMap<String, Kinds>);

impl Rejected {
    pub(crate) fn json(&self) -> Value {
        json!(self.0)
    }

    /// Sentences, one per tool, with the remedy for each kind.
    pub(crate) fn sentences(&self) -> Vec<String> {
        self.0.iter().map(|(tool, kinds)| sentence(tool, kinds)).collect()
    }

    /// The sentences as lines below a result.
    pub(crate) fn below(&self, text: String) -> String {
        [vec![text], self.sentences()].concat().join("\n")
    }
}

fn sentence(tool: &str, kinds: &Kinds) -> String {
    let n: u64 = kinds.values().sum();
    let parts: Vec<String> = kinds.iter().map(|(kind, n)| format!("{n} {kind}{}", remedy(kind))).collect();
    format!("{n} poses to `{tool}` were rejected: {}", parts.join(", "))
}

fn remedy(kind: &str) -> &'static str {
    match kind {
        "conflict" => " (another source moves this tool: stop it)",
        "repeated" | "out_of_order" => {
            " (the daemon has had these poses or newer ones of the source: `plica replay --new-source` gives them a new one)"
        }
        "invalid" => " (the source flags them as not tracked)",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_counted_with_its_remedy() {
        let kinds = Kinds::from([("conflict".to_owned(), 3), ("not_unit".to_owned(), 1)]);
        let sentence = sentence("probe", &kinds);
        assert_eq!(
            sentence,
            "4 poses to `probe` were rejected: 3 conflict (another source moves this tool: stop it), 1 not_unit"
        );
    }
}
