//! The service manager (systemd): told that the daemon is ready, that it lives, and that it stops. Elsewhere nothing happens.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// Feeds the watchdog of the service manager while the simulation turns.
#[derive(Debug)]
pub(crate) struct Watchdog {
    period: Option<Duration>,
    fed: Instant,
    turns: u64,
}

impl Watchdog {
    /// Tells that the daemon is ready.
    pub(crate) fn ready(status: &str) -> Self {
        tell(&[NotifyState::Ready, NotifyState::Status(status)]);
        // Half of what is allowed, as the manual of systemd advises.
        let period = sd_notify::watchdog_enabled().map(|allowed| allowed / 2);
        Self { period, fed: Instant::now(), turns: 0 }
    }

    /// Feeds the watchdog, if it is due and the simulation has turned since.
    pub(crate) fn feed(&mut self, turns: u64) {
        let due = self.period.is_some_and(|period| self.fed.elapsed() >= period);
        if due && turns != self.turns {
            tell(&[NotifyState::Watchdog]);
            (self.fed, self.turns) = (Instant::now(), turns);
        }
    }

    /// Tells that the daemon stops.
    pub(crate) fn stopping(self) {
        tell(&[NotifyState::Stopping]);
    }
}

fn tell(state: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(state) {
        tracing::debug!("the service manager was not told: {error}");
    }
}
