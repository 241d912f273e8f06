//! Times the stages of a tick.

use std::time::Instant;

use plica_sim::{Probe, Stage};

use super::statistics::Statistics;

/// A probe that is also called at the end of the last stage.
pub trait TurnProbe: Probe {
    /// The tick is over; what follows is handing it out.
    fn leave(&mut self) {}
}

impl TurnProbe for plica_sim::NoProbe {}

/// A probe that adds up the time spent in each stage; stages that alternate are summed.
#[derive(Debug)]
pub struct StageTimer {
    current: Option<Stage>,
    since: Instant,
    sums_ns: [u64; Stage::ALL.len()],
}

impl StageTimer {
    /// Outside of any stage.
    pub fn new() -> Self {
        Self { current: None, since: Instant::now(), sums_ns: [0; Stage::ALL.len()] }
    }

    /// The time of each stage since the last call \[ns\].
    pub fn take_ns(&mut self) -> [u64; Stage::ALL.len()] {
        std::mem::take(&mut self.sums_ns)
    }

    /// Records all stages.
    pub fn record(&mut self, statistics: &Statistics) {
        for (histogram, ns) in statistics.stages.iter().zip(self.take_ns()) {
            histogram.record(ns);
        }
    }

    fn close(&mut self, now: Instant) {
        if let Some(stage) = self.current {
            let index = Stage::ALL.iter().position(|s| *s == stage).expect("all stages are listed");
            self.sums_ns[index] += now.duration_since(self.since).as_nanos() as u64;
        }
        self.since = now;
    }
}

impl Default for StageTimer {
    fn default() -> Self {
        Self::new()
    }
}

impl TurnProbe for StageTimer {
    fn leave(&mut self) {
        self.close(Instant::now());
        self.current = None;
    }
}

impl Probe for StageTimer {
    fn enter(&mut self, stage: Stage) {
        self.close(Instant::now());
        self.current = Some(stage);
    }
}
