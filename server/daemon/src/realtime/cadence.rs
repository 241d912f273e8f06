//! Divides the tick rate by a factor that need not be an integer.

/// Schedule of events at a rate of their own, on ticks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cadence {
    per_tick: f64,
    phase: f64,
}

impl Cadence {
    /// `rate_hz` times per second of ticks of `timestep_s`, at most once a tick.
    pub(super) fn new(rate_hz: f64, timestep_s: f64) -> Self {
        // The first tick is due; the slack keeps 1000 Hz at 1 ms from missing a tick to rounding.
        let per_tick = (rate_hz * timestep_s + 1e-12).min(1.0);
        Self { per_tick, phase: 1.0 - per_tick }
    }

    /// Counts a tick. Returns whether an event is due.
    pub(super) fn advance(&mut self) -> bool {
        self.phase += self.per_tick;
        let due = self.phase >= 1.0;
        self.phase -= f64::from(u8::from(due)) * self.phase.floor();
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn due_in(rate_hz: f64, ticks: usize) -> usize {
        let mut cadence = Cadence::new(rate_hz, 1e-3);
        (0..ticks).filter(|_| cadence.advance()).count()
    }

    #[test]
    fn rates_are_kept_over_seconds() {
        assert_eq!(due_in(1000.0, 10_000), 10_000);
        assert_eq!(due_in(5000.0, 10_000), 10_000);
        assert!(due_in(90.0, 10_000).abs_diff(900) <= 1);
        assert!(due_in(2.0, 10_000).abs_diff(20) <= 1);
    }

    #[test]
    fn the_first_tick_is_due() {
        assert!(Cadence::new(2.0, 1e-3).advance());
    }
}
