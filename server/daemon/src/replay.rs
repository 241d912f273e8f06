//! The loop without bus or clock, fed with timed poses, for `simulate` and `bench`.

use std::sync::Arc;

use plica_scene::motion::TimedPose;
use plica_sim::enrichment::LiveEnrichment;
use plica_sim::{Model, TickReport};

use crate::realtime::{Frame, Loop, LoopOptions, Ports, Turn, TurnProbe};

/// A loop with a list of timed poses.
pub struct Replay {
    core: Loop,
    ports: Ports,
    poses: Vec<TimedPose>,
    next: usize,
}

impl Replay {
    /// A loop at rest. `poses` in order of time.
    pub fn new(model: Arc<Model>, poses: Vec<TimedPose>) -> Self {
        let (core, ports) = Loop::new(model, LoopOptions { publish_hz: 1000.0, wrench_hz: 1000.0, lock_step: false });
        Self { core, ports, poses, next: 0 }
    }

    /// Activates an enrichment.
    pub fn enrich(&mut self, live: Box<LiveEnrichment>) {
        self.core.enrich(live);
    }

    /// Delivers the poses that are due, then runs one tick.
    pub fn tick(&mut self, probe: &mut impl TurnProbe) -> TickReport {
        self.deliver();
        self.turn(probe)
    }

    /// Delivers the poses that are due.
    pub fn deliver(&mut self) {
        // Half a microsecond covers the rounding of k h against a decimal time.
        let clock_s = self.core.state().sim_time_s() + 0.5e-6;
        while let Some(timed) = self.poses.get(self.next).filter(|p| p.time_s <= clock_s) {
            // A full queue holds 256 poses of one tick; more of them change nothing, since the newest ones are left out.
            let _ = self.ports.poses[timed.tool].push(timed.sample);
            self.next += 1;
        }
    }

    /// Takes one tick with what has been delivered.
    pub fn turn(&mut self, probe: &mut impl TurnProbe) -> TickReport {
        match self.core.turn(probe) {
            Turn::Ticked(report) => report,
            Turn::Still => TickReport::default(),
        }
    }

    /// Asks for a frame after the next tick.
    pub fn want_frame(&mut self) {
        self.ports.frames.ask();
    }

    /// The newest frame that was asked for.
    pub fn frame(&mut self) -> &Frame {
        self.ports.frames.frames.read()
    }

    /// The loop.
    pub fn core(&self) -> &Loop {
        &self.core
    }

    /// The loop's far ends.
    pub fn ports(&mut self) -> &mut Ports {
        &mut self.ports
    }
}
