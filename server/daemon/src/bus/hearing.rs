//! Whether the bus still hears: own queries through Zenoh's routing tables, twice a second.
//!
//! A panic inside Zenoh while it writes its routing tables poisons them for good; in 1.10.2 one invalid key expression in a
//! declaration of a client is enough. Streams that flow already go on, so that the daemon looks alive, but no query, no pose and no
//! new client gets through. No code outside Zenoh can mend the tables: the process ends, and its supervisor starts it again.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use plica_protocol::keys::Keys;
use plica_protocol::status::{OTHER_DAEMON, Status};
use zenoh::qos::CongestionControl;
use zenoh::sample::Locality;
use zenoh::{Session, Wait};

use super::error::BusError;
use super::shared::{Shared, spawn};

/// Between two own queries.
const PERIOD: Duration = Duration::from_millis(500);
/// Longest wait for the end of an own query.
const PATIENCE: Duration = Duration::from_millis(400);
/// Periods without an answer after which the bus counts as deaf; a little more, as the last query has just been put.
const SILENT_MS: u64 = 3 * PERIOD.as_millis() as u64 + 150;
/// A judge that looks less often than this was not running itself, and excuses the gap.
const LONGEST_GAP_MS: u64 = 400;
/// Between two warnings about another daemon.
const REMIND: Duration = Duration::from_secs(60);

/// The bus no longer answers own queries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deaf {
    /// Time without an answer while the simulation ran \[ms\].
    pub silent_ms: u64,
}

/// When an own query was last answered.
#[derive(Debug)]
pub(super) struct Hearing {
    started: Instant,
    answered_ms: AtomicU64,
    last_failed: AtomicBool,
}

impl Hearing {
    /// Whether the last own query came to nothing.
    pub(super) fn last_failed(&self) -> bool {
        self.last_failed.load(Relaxed)
    }

    pub(super) fn now_ms(&self) -> u64 {
        self.started.elapsed().as_millis() as u64
    }

    pub(super) fn answered_ms(&self) -> u64 {
        self.answered_ms.load(Relaxed)
    }
}

/// Judges whether the bus is deaf, from a thread that Zenoh cannot hold up.
#[derive(Debug, Default)]
pub(super) struct Judge {
    looked_ms: u64,
    answered_ms: u64,
    excused_ms: u64,
    turns_at_answer: u64,
}

impl Judge {
    /// `turns`: turns of the simulation so far. While they stand the machine stands, and silence means nothing.
    pub(super) fn look(&mut self, now_ms: u64, answered_ms: u64, turns: u64) -> Result<(), Deaf> {
        let gap_ms = now_ms.saturating_sub(self.looked_ms);
        self.looked_ms = now_ms;
        if answered_ms != self.answered_ms {
            *self = Self { looked_ms: now_ms, answered_ms, excused_ms: 0, turns_at_answer: turns };
        } else if gap_ms > LONGEST_GAP_MS {
            self.excused_ms += gap_ms;
        }
        let silent_ms = now_ms.saturating_sub(answered_ms + self.excused_ms);
        if silent_ms > SILENT_MS && turns != self.turns_at_answer { Err(Deaf { silent_ms }) } else { Ok(()) }
    }
}

/// Starts the thread that asks.
pub(super) fn start(shared: &Arc<Shared>) -> Result<(Arc<Hearing>, JoinHandle<()>), BusError> {
    let hearing = Arc::new(Hearing {
        started: Instant::now(),
        answered_ms: AtomicU64::new(0),
        last_failed: AtomicBool::new(false),
    });
    let (shared, heard) = (Arc::clone(shared), Arc::clone(&hearing));
    let thread = spawn("plica-hearing", move || run(&shared, &heard))?;
    Ok((hearing, thread))
}

fn run(shared: &Shared, hearing: &Hearing) {
    let mut reminded: Option<Instant> = None;
    while !shared.stopping() {
        let due = Instant::now() + PERIOD;
        let other = other_daemon(&shared.session, &shared.keys, PATIENCE);
        hearing.last_failed.store(other.is_none(), Relaxed);
        match other {
            Some(other) => {
                hearing.answered_ms.store(hearing.now_ms(), Relaxed);
                if let Some(other) = other {
                    note(shared, &other, &mut reminded);
                }
            }
            None => tracing::error!("the bus did not answer a query of its own daemon"),
        }
        while Instant::now() < due && !shared.stopping() {
            std::thread::park_timeout(due.saturating_duration_since(Instant::now()));
        }
    }
}

/// Counts another daemon of this session, and warns of it now and then.
fn note(shared: &Shared, other: &Status, reminded: &mut Option<Instant>) {
    shared.counters.count(OTHER_DAEMON);
    if reminded.is_none_or(|at| at.elapsed() > REMIND) {
        let other = describe(other, shared.keys.root());
        tracing::warn!("{other}; clients cannot tell the two apart: stop one, or give it another --session");
        *reminded = Some(Instant::now());
    }
}

/// One line on a daemon that serves the same session.
pub(super) fn describe(other: &Status, root: &str) -> String {
    format!("another plicad answers for `{root}` (scene {}, up for {:.0} s)", other.scene, other.uptime_s)
}

/// Asks the rest of the bus for the status of this session: `None` if the routing tables are out of order; inside, another daemon
/// that answers.
///
/// The query is routed, but not to this session's own queryable, so that a client that holds up replies cannot hold up this.
pub(super) fn other_daemon(session: &Session, keys: &Keys, patience: Duration) -> Option<Option<Status>> {
    let ask = || {
        let replies = session
            .get(keys.status())
            .allowed_destination(Locality::Remote)
            .congestion_control(CongestionControl::Drop)
            .timeout(patience)
            .wait()
            .ok()?;
        let answers = std::iter::from_fn(|| replies.recv().ok());
        let statuses =
            answers.filter_map(|reply| serde_json::from_slice(&reply.result().ok()?.payload().to_bytes()).ok());
        Some(statuses.last())
    };
    // Poisoned tables panic in whoever uses them.
    catch_unwind(AssertUnwindSafe(ask)).ok().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks every 100 ms for `until_ms`; answers come every 500 ms until `last_answer_ms`.
    fn first_alarm(until_ms: u64, last_answer_ms: u64, turns: impl Fn(u64) -> u64) -> Option<u64> {
        let mut judge = Judge::default();
        (0..until_ms).step_by(100).find(|&now| {
            let answered = now.min(last_answer_ms) / 500 * 500;
            judge.look(now, answered, turns(now)).is_err()
        })
    }

    #[test]
    fn silence_is_noticed_within_two_seconds() {
        assert_eq!(first_alarm(3_600_000, u64::MAX, |now| now), None);
        for last in 5_000..5_500 {
            let alarm = first_alarm(10_000, last, |now| now).unwrap_or(u64::MAX);
            assert!(alarm > last + 1_100 && alarm <= last + 2_000, "answers until {last} ms, alarm at {alarm} ms");
        }
    }

    #[test]
    fn a_machine_that_stood_still_is_not_deaf() {
        // The simulation does not turn either.
        assert_eq!(first_alarm(60_000, 5_000, |now| now.min(5_000)), None);
        // Nobody ran for a minute; afterwards the first answer is in time.
        let mut judge = Judge::default();
        for (now, answered, turns) in [(5_000, 5_000, 5), (5_100, 5_000, 6), (65_100, 5_000, 7), (65_200, 5_000, 8)] {
            assert_eq!(judge.look(now, answered, turns), Ok(()));
        }
        assert_eq!(judge.look(65_300, 65_250, 9), Ok(()));
        assert_eq!(judge.look(65_400, 65_250, 10), Ok(()));
        let alarm = (654..700).find(|k| judge.look(100 * k, 65_250, *k).is_err());
        assert!(alarm.is_some_and(|k| k <= 672), "silence after that counts: {alarm:?}");
    }
}
