//! Absolute deadlines with bounded catch-up, as arithmetic on clock readings of the caller.

/// Most ticks that run back to back to make up for lost time; more missed ticks are given up.
pub const MAX_CATCH_UP: u64 = 8;

/// Deadlines `start + k period`. All times in nanoseconds of one monotonic clock.
#[derive(Debug, Clone)]
pub struct Pacer {
    period_ns: u64,
    next_ns: u64,
    overruns: u64,
    skipped: u64,
}

/// Decision of the pacer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plan {
    /// Nothing is due before this time.
    Wait {
        /// The next deadline \[ns\].
        until_ns: u64,
    },
    /// A tick is due.
    Run {
        /// How long ago it was due \[ns\].
        lateness_ns: u64,
    },
}

impl Pacer {
    /// The first deadline is one period after `now_ns`.
    pub fn new(now_ns: u64, period_ns: u64) -> Self {
        Self { period_ns, next_ns: now_ns + period_ns, overruns: 0, skipped: 0 }
    }

    /// Decision at `now_ns`. With more than [`MAX_CATCH_UP`] deadlines missed, the oldest ones are given up.
    pub fn plan(&mut self, now_ns: u64) -> Plan {
        if now_ns < self.next_ns {
            return Plan::Wait { until_ns: self.next_ns };
        }
        let missed = (now_ns - self.next_ns) / self.period_ns;
        let given_up = missed.saturating_sub(MAX_CATCH_UP);
        self.skipped += given_up;
        self.next_ns += given_up * self.period_ns;
        let lateness_ns = now_ns - self.next_ns;
        self.next_ns += self.period_ns;
        Plan::Run { lateness_ns }
    }

    /// A tick ended at `now_ns`; one that ends after the next deadline is an overrun.
    pub fn finish(&mut self, now_ns: u64) {
        self.overruns += u64::from(now_ns > self.next_ns);
    }

    /// Starts anew, as after a pause: nothing is caught up.
    pub fn restart(&mut self, now_ns: u64) {
        self.next_ns = now_ns + self.period_ns;
    }

    /// Ticks that ended after the next one was due.
    pub fn overruns(&self) -> u64 {
        self.overruns
    }

    /// Ticks given up because catching up is bounded.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Runs until the pacer waits, each tick lasting `tick_ns`; the number of ticks, and the clock then.
    fn drain(pacer: &mut Pacer, mut now_ns: u64, tick_ns: u64) -> (u64, u64) {
        let mut ticks = 0;
        while let Plan::Run { .. } = pacer.plan(now_ns) {
            ticks += 1;
            now_ns += tick_ns;
            pacer.finish(now_ns);
        }
        (ticks, now_ns)
    }

    #[test]
    fn on_time_nothing_is_counted() {
        let mut pacer = Pacer::new(0, MS);
        for k in 1..=100 {
            assert_eq!(pacer.plan(k * MS - 1), Plan::Wait { until_ns: k * MS });
            assert_eq!(pacer.plan(k * MS + 7), Plan::Run { lateness_ns: 7 });
            pacer.finish(k * MS + MS / 5);
        }
        assert_eq!((pacer.overruns(), pacer.skipped()), (0, 0));
    }

    #[test]
    fn a_short_stall_is_caught_up_completely() {
        let mut pacer = Pacer::new(0, MS);
        let (ticks, _) = drain(&mut pacer, 5 * MS, 0);
        assert_eq!(ticks, 5);
        assert_eq!(pacer.skipped(), 0);
    }

    #[test]
    fn a_long_stall_is_caught_up_by_eight_ticks_at_most() {
        let mut pacer = Pacer::new(0, MS);
        let (ticks, now_ns) = drain(&mut pacer, 500 * MS, 0);
        assert_eq!(ticks, 1 + MAX_CATCH_UP, "the tick that is due, and eight missed ones");
        assert_eq!(pacer.skipped(), 500 - ticks);
        assert_eq!(pacer.plan(now_ns), Plan::Wait { until_ns: 501 * MS }, "deadlines stay on the grid");
    }

    #[test]
    fn ticks_that_are_always_too_long_never_pile_up() {
        let mut pacer = Pacer::new(0, MS);
        let mut now_ns = MS;
        for _ in 0..1000 {
            let Plan::Run { lateness_ns } = pacer.plan(now_ns) else { panic!("always late") };
            assert!(lateness_ns < (MAX_CATCH_UP + 1) * MS);
            now_ns += 3 * MS;
            pacer.finish(now_ns);
        }
        assert_eq!(pacer.overruns(), 1000);
        assert!((1980..=2000).contains(&pacer.skipped()), "{}", pacer.skipped());
    }

    #[test]
    fn after_a_pause_nothing_is_caught_up() {
        let mut pacer = Pacer::new(0, MS);
        pacer.restart(700 * MS);
        assert_eq!(pacer.plan(700 * MS), Plan::Wait { until_ns: 701 * MS });
        assert_eq!(pacer.skipped(), 0);
    }
}
