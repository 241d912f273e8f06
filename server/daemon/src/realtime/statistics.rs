//! Counters that the simulation thread writes and any thread may read.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use plica_sim::Stage;

use super::histogram::AtomicHistogram;

/// Simulated time \[s\], written by the simulation thread.
#[derive(Debug, Default)]
pub struct SimTime(AtomicU64);

impl SimTime {
    pub(super) fn set(&self, time_s: f64) {
        self.0.store(time_s.to_bits(), Relaxed);
    }

    /// Simulated time \[s\].
    pub fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Relaxed))
    }
}

/// Written by the simulation thread alone.
#[derive(Debug, Default)]
pub struct Statistics {
    /// Turns of the loop, ticks or not: the thread lives while they rise.
    pub turns: AtomicU64,
    /// Simulated time at the next tick.
    pub sim_time: SimTime,
    /// Duration of whole ticks.
    pub tick: AtomicHistogram,
    /// Duration of each stage, in the order of [`Stage::ALL`].
    pub stages: [AtomicHistogram; Stage::ALL.len()],
    /// How late the thread woke up.
    pub lateness: AtomicHistogram,
    /// Ticks that ended after the next one was due.
    pub overruns: AtomicU64,
    /// Ticks given up because catching up is bounded.
    pub skipped: AtomicU64,
    /// Wrenches that were made while their queue was full.
    pub wrench_drops: AtomicU64,
}
