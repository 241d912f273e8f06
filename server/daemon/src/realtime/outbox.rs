//! Hands frames, wrenches and readings to the threads that publish them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use plica_sim::{Model, NoProbe, State, TickReport};
use triple_buffer::Input;

use super::cadence::Cadence;
use super::enrichment::Detail;
use super::force_steps::ForceSteps;
use super::frame::{Frame, Reading, ToolFrame};
use super::stage_timer::TurnProbe;
use super::statistics::Statistics;
use super::waker::Waker;

/// Rate at which the frame of a sleeping object is repeated.
const SLEEPING_HZ: f64 = 2.0;

/// The simulation thread's ends of everything that leaves it.
#[derive(Debug)]
pub(super) struct Outbox {
    pub(super) frames: Input<Frame>,
    pub(super) readings: Input<Reading>,
    pub(super) wrenches: Vec<ToolOutlet>,
    pub(super) listening: Arc<AtomicBool>,
    pub(super) questions: Arc<AtomicU64>,
    pub(super) skin_waker: Arc<Waker>,
    pub(super) wrench_waker: Arc<Waker>,
    pub(super) cadences: Cadences,
    pub(super) answered: u64,
    pub(super) due: u64,
    pub(super) degraded: bool,
    pub(super) was_sleeping: bool,
    pub(super) max_penetration_m: f32,
    pub(super) fallbacks: u64,
    pub(super) dropped_contacts: u64,
    pub(super) force_steps: ForceSteps,
}

/// One tool's wrenches.
#[derive(Debug)]
pub(super) struct ToolOutlet {
    pub(super) queue: rtrb::Producer<ToolFrame>,
    pub(super) listening: Arc<AtomicBool>,
}

/// When frames and wrenches are due.
#[derive(Debug)]
pub(super) struct Cadences {
    skin: Cadence,
    sleeping_skin: Cadence,
    wrench: Cadence,
}

impl Cadences {
    pub(super) fn new(publish_hz: f64, wrench_hz: f64, timestep_s: f64) -> Self {
        Self {
            skin: Cadence::new(publish_hz, timestep_s),
            sleeping_skin: Cadence::new(SLEEPING_HZ.min(publish_hz), timestep_s),
            wrench: Cadence::new(wrench_hz, timestep_s),
        }
    }
}

/// Where the simulation stands.
#[derive(Clone, Copy)]
pub(super) struct Present<'a> {
    pub(super) model: &'a Model,
    pub(super) state: &'a State,
    pub(super) report: &'a TickReport,
}

impl Outbox {
    /// After a tick.
    pub(super) fn hand_out(
        &mut self,
        present: Present<'_>,
        detail: &mut Detail,
        statistics: &Statistics,
        probe: &mut impl TurnProbe,
    ) {
        self.note(present.report);
        self.force_steps.note(present.state.tick(), present.state.tools().iter().map(|tool| tool.force_n));
        self.hand_out_wrenches(present.state, detail, statistics);
        self.hand_out_frame(present, detail, probe);
        self.hand_out_reading(present, detail, false);
    }

    /// Without a tick: answers queries and updates the status.
    pub(super) fn hand_out_still(&mut self, present: Present<'_>, detail: &mut Detail) {
        self.answer(present, detail, false, &mut NoProbe);
        self.hand_out_reading(present, detail, true);
    }

    /// After a reset.
    pub(super) fn forget(&mut self) {
        self.max_penetration_m = 0.0;
        self.fallbacks = 0;
        self.dropped_contacts = 0;
        self.degraded = false;
    }

    fn note(&mut self, report: &TickReport) {
        self.degraded |= report.rolled_back;
        self.max_penetration_m = self.max_penetration_m.max(report.max_penetration_m);
        self.fallbacks += u64::from(report.fallbacks > 0);
        self.dropped_contacts += u64::from(report.dropped_contacts);
    }

    fn hand_out_wrenches(&mut self, state: &State, detail: &Detail, statistics: &Statistics) {
        if !self.cadences.wrench.advance() {
            return;
        }
        let mut any = false;
        for (tool, (outlet, reading)) in self.wrenches.iter_mut().zip(state.tools()).enumerate() {
            if !reading.present || !outlet.listening.load(Relaxed) {
                continue;
            }
            let frame = ToolFrame {
                tick: state.tick(),
                sim_time_s: state.sim_time_s(),
                reading: *reading,
                confidence: detail.confidence(tool),
            };
            let refused = outlet.queue.push(frame).is_err();
            statistics.wrench_drops.fetch_add(u64::from(refused), Relaxed);
            any = true;
        }
        if any {
            self.wrench_waker.wake();
        }
    }

    fn hand_out_frame(&mut self, present: Present<'_>, detail: &mut Detail, probe: &mut impl TurnProbe) {
        let sleeping = present.report.sleeping;
        let falls_asleep = sleeping && !self.was_sleeping;
        self.was_sleeping = sleeping;
        let cadence = if sleeping { &mut self.cadences.sleeping_skin } else { &mut self.cadences.skin };
        let due = (cadence.advance() || falls_asleep) && self.listening.load(Relaxed);
        self.answer(present, detail, due, probe);
    }

    /// Writes a frame if it is due or was requested.
    fn answer(&mut self, present: Present<'_>, detail: &mut Detail, due: bool, probe: &mut impl TurnProbe) {
        let Present { model, state, report } = present;
        let questions = self.questions.load(Relaxed);
        if !due && questions == self.answered {
            return;
        }
        self.answered = questions;
        self.due += u64::from(due);
        let frame = self.frames.input_buffer_mut();
        frame.tick = state.tick();
        frame.sim_time_s = state.sim_time_s();
        frame.newest_pose_source_time_ns = state.tools().iter().map(|t| t.pose_source_time_ns).max().unwrap_or(0);
        frame.degraded = self.degraded;
        frame.sleeping = report.sleeping;
        frame.due = self.due;
        frame.answers = questions;
        detail.write_skin(model, state, &mut frame.positions, probe);
        frame.degraded |= detail.is_left_out();
        frame.confidence = detail.least_confidence().unwrap_or(0.0);
        frame.database_generation = detail.generation();
        self.degraded &= !due;
        self.frames.publish();
        self.skin_waker.wake();
    }

    /// What the status says.
    pub(super) fn hand_out_reading(&mut self, present: Present<'_>, detail: &Detail, paused: bool) {
        let Present { state, report, .. } = present;
        let reading = self.readings.input_buffer_mut();
        reading.tick = state.tick();
        reading.sim_time_s = state.sim_time_s();
        reading.paused = paused;
        reading.rollbacks = state.rollbacks();
        reading.report = *report;
        reading.max_penetration_m = self.max_penetration_m;
        reading.fallbacks = self.fallbacks;
        reading.dropped_contacts = self.dropped_contacts;
        reading.database_generation = detail.generation();
        reading.confidence = detail.least_confidence();
        reading.tools.copy_from_slice(state.tools());
        self.force_steps.write(&mut reading.force_steps_n);
        self.readings.publish();
    }
}
