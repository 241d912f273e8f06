//! Commands, one file each, and their shared helpers.

pub(crate) mod ask;
pub(crate) mod export;
pub(crate) mod jobs;
pub(crate) mod latency;
mod motion;
pub(crate) mod probe;
pub(crate) mod record;
mod rejected;
pub(crate) mod replay;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use signal_hook::consts::{SIGINT, SIGTERM};

/// Set at Ctrl-C, so that a command finishes its files and prints its results.
#[derive(Debug, Clone)]
pub(crate) struct Stop(Arc<AtomicBool>);

impl Stop {
    pub(crate) fn on_signals() -> anyhow::Result<Self> {
        let flag = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // The second signal ends the process at once.
            signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(&flag))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&flag)))
                .context("cannot listen to signals")?;
        }
        Ok(Self(flag))
    }

    pub(crate) fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Sleeps until an instant or a signal. False after a signal.
    pub(crate) fn sleep_until(&self, instant: Instant) -> bool {
        const LOOK: Duration = Duration::from_millis(50);
        while !self.is_set() {
            let left = instant.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return true;
            }
            thread::sleep(left.min(LOOK));
        }
        false
    }
}

/// The given name if the scene has it; without a name, the only one.
pub(crate) fn choose<T>(what: &str, wanted: Option<&str>, there: &BTreeMap<String, T>) -> anyhow::Result<String> {
    let names = there.keys().cloned().collect::<Vec<_>>().join(", ");
    match (wanted, there.keys().next()) {
        (Some(name), _) if there.contains_key(name) => Ok(name.to_owned()),
        (Some(name), _) => bail!("the scene has no {what} `{name}`; it has: {names}"),
        (None, Some(only)) if there.len() == 1 => Ok(only.clone()),
        (None, None) => bail!("the scene has no {what}"),
        (None, _) => bail!("the scene has several {what}s, choose one with --{what}: {names}"),
    }
}
