//! The simulation thread's loop, without thread and clock.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::Instant;

use plica_sim::enrichment::LiveEnrichment;
use plica_sim::{Model, PoseSample, State, TickInput, TickReport, ToolPose, Workspace};
use triple_buffer::triple_buffer;

use super::command::{Command, EarlyEnd, EarlyEndCause, Outcome, Refusal, Reply, Returned};
use super::enrichment::Detail;
use super::force_steps::ForceSteps;
use super::frame::{Frame, Reading};
use super::outbox::{Cadences, Outbox, Present, ToolOutlet};
use super::ports::{CommandPort, FramePort, Ports, WrenchPort};
use super::snapshots::Snapshots;
use super::stage_timer::TurnProbe;
use super::statistics::Statistics;
use super::waker::Waker;

/// Poses per tool that may wait for a tick.
const POSE_QUEUE: usize = 256;
/// Poses per tool that wait while the simulation stands still by itself: the newest, as many as a tool's history holds.
const POSES_KEPT_IN_PAUSE: usize = 16;
/// Most poses of one [`Command::Step`].
const MAX_STEP_POSES: usize = crate::limits::MAX_STEP_POSES;
/// Wrenches per tool that may wait for their publisher.
const WRENCH_QUEUE: usize = 256;
/// Commands that may wait.
const COMMAND_QUEUE: usize = 4;

/// Options of a [`Loop`].
#[derive(Debug, Clone, Copy)]
pub struct LoopOptions {
    /// Skin frames per second of simulated time.
    pub publish_hz: f64,
    /// Wrenches per second of simulated time and tool.
    pub wrench_hz: f64,
    /// Whether ticks run on command only.
    pub lock_step: bool,
}

/// Result of a turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Turn {
    /// No tick: the simulation is paused.
    Still,
    /// A tick.
    Ticked(TickReport),
}

/// Drains the input queues, steps the model, fills the output queues.
///
/// The clock that a tick is told is simulated time, so that a state, its pose histories and the clock always belong
/// together: after a snapshot is restored, in lock-step, and in a run that was interrupted.
pub struct Loop {
    model: Arc<Model>,
    state: State,
    rest: State,
    workspace: Workspace,
    pose_queues: Vec<rtrb::Consumer<PoseSample>>,
    poses: Vec<ToolPose>,
    orders: rtrb::Consumer<Command>,
    replies: rtrb::Producer<Reply>,
    answered: Arc<Waker>,
    simulation: Arc<Waker>,
    snapshots: Snapshots,
    detail: Detail,
    outbox: Outbox,
    statistics: Arc<Statistics>,
    lock_step: bool,
    paused: bool,
    step: Step,
    report: TickReport,
}

/// The step that runs.
#[derive(Debug, Default)]
struct Step {
    ticks_left: u32,
    poses: Vec<ToolPose>,
    deadline: Option<Instant>,
    early: Option<EarlyEnd>,
    /// Interrupts to answer after the step.
    interrupts: u32,
}

impl Step {
    /// Makes the next tick the last one, so that a step that has used its poses has run at least one.
    fn cut(&mut self, cause: EarlyEndCause) {
        if self.ticks_left > 1 {
            self.early = Some(EarlyEnd { ticks_left: self.ticks_left - 1, cause });
            self.ticks_left = 1;
        }
    }
}

impl Loop {
    /// A loop at rest, and the far ends of its queues. Everything that a turn needs is allocated here.
    pub fn new(model: Arc<Model>, options: LoopOptions) -> (Self, Ports) {
        let rest = State::new(&model);
        let n_tools = model.n_tools();
        let (pose_producers, pose_queues) = (0..n_tools).map(|_| rtrb::RingBuffer::new(POSE_QUEUE)).unzip();
        let (orders_in, orders) = rtrb::RingBuffer::new(COMMAND_QUEUE);
        let (replies, replies_out) = rtrb::RingBuffer::new(COMMAND_QUEUE);
        let (answered, simulation) = (Arc::new(Waker::default()), Arc::new(Waker::default()));
        let statistics = Arc::new(Statistics::default());
        let (outbox, frames, wrenches, readings) = connect_outbox(&model, &rest, options, &simulation);
        let commands = CommandPort {
            orders: orders_in,
            replies: replies_out,
            answered: Arc::clone(&answered),
            simulation: Arc::clone(&simulation),
        };
        let ports =
            Ports { poses: pose_producers, commands, frames, wrenches, readings, statistics: Arc::clone(&statistics) };
        let this = Self {
            state: rest.clone(),
            snapshots: Snapshots::new(&rest),
            workspace: Workspace::new(&model),
            poses: Vec::with_capacity(n_tools * POSE_QUEUE + MAX_STEP_POSES),
            pose_queues,
            orders,
            replies,
            answered,
            simulation,
            detail: Detail::default(),
            outbox,
            statistics,
            lock_step: options.lock_step,
            paused: options.lock_step,
            step: Step::default(),
            report: TickReport::default(),
            rest,
            model,
        };
        (this, ports)
    }

    /// Executes commands and, unless the simulation is paused, runs one tick.
    pub fn turn(&mut self, probe: &mut impl TurnProbe) -> Turn {
        self.obey_orders();
        if self.stands_still() {
            return self.stay();
        }
        self.take_poses();
        self.tick(probe);
        self.hand_out(probe);
        self.count_step();
        Turn::Ticked(self.report)
    }

    /// Enriches from now on, before it runs on a thread of its own; then [`Command::Activate`] does.
    pub fn enrich(&mut self, live: Box<LiveEnrichment>) {
        self.detail.activate(live, &self.model, &self.state);
    }

    /// The immutable part of the scene.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The state after the last tick.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Counters and histograms.
    pub fn statistics(&self) -> &Arc<Statistics> {
        &self.statistics
    }

    /// Whether ticks of a command are left.
    pub fn is_stepping(&self) -> bool {
        self.step.ticks_left > 0
    }

    /// Ends a step that is past its deadline after one more tick.
    pub fn end_late_step(&mut self, now: Instant) {
        if self.step.deadline.is_some_and(|deadline| now >= deadline) {
            self.step.cut(EarlyEndCause::Deadline);
        }
    }

    /// Whether ticks run on command only.
    pub fn is_lock_step(&self) -> bool {
        self.lock_step
    }

    /// Woken by commands and queries.
    pub fn waker(&self) -> &Arc<Waker> {
        &self.simulation
    }

    /// Runs ticks on a state that is thrown away, so that every page has been touched.
    pub fn warm_up(&mut self, probe: &mut impl TurnProbe) {
        let mut state = self.rest.clone();
        for _ in 0..20 {
            let input = TickInput { clock_s: state.sim_time_s(), poses: &[] };
            plica_sim::tick(&self.model, input, &mut state, &mut self.workspace, probe);
        }
    }

    fn stands_still(&self) -> bool {
        self.paused && !self.is_stepping()
    }

    fn stay(&mut self) -> Turn {
        if !self.lock_step {
            self.trim_poses();
        }
        let present = Present { model: &self.model, state: &self.state, report: &self.report };
        self.outbox.hand_out_still(present, &mut self.detail);
        Turn::Still
    }

    fn trim_poses(&mut self) {
        for queue in &mut self.pose_queues {
            while queue.slots() > POSES_KEPT_IN_PAUSE && queue.pop().is_ok() {}
        }
    }

    fn take_poses(&mut self) {
        self.poses.clear();
        for (tool, queue) in self.pose_queues.iter_mut().enumerate() {
            // As many as there is room for: a sender that is faster than this loop cannot hold it up.
            for _ in 0..queue.slots().min(POSE_QUEUE) {
                let Ok(sample) = queue.pop() else { break };
                self.poses.push(ToolPose { tool, sample });
            }
        }
        self.poses.extend(self.step.poses.drain(..).take(MAX_STEP_POSES));
    }

    fn tick(&mut self, probe: &mut impl TurnProbe) {
        let input = TickInput { clock_s: self.state.sim_time_s(), poses: &self.poses };
        self.report = plica_sim::tick(&self.model, input, &mut self.state, &mut self.workspace, probe);
        probe.leave();
        self.statistics.sim_time.set(self.state.sim_time_s());
        self.detail.follow(&self.model, &self.state, probe);
    }

    fn hand_out(&mut self, probe: &mut impl TurnProbe) {
        let present = Present { model: &self.model, state: &self.state, report: &self.report };
        self.outbox.hand_out(present, &mut self.detail, &self.statistics, probe);
    }

    fn count_step(&mut self) {
        if self.step.ticks_left == 1 {
            // Moved, not freed: the vector goes back with the reply.
            let Step { poses, early, interrupts, .. } = std::mem::take(&mut self.step);
            self.answer(Ok(None), Returned::Poses(poses), early);
            (0..interrupts).for_each(|_| self.reply(Ok(None), Returned::Nothing));
        }
        self.step.ticks_left = self.step.ticks_left.saturating_sub(1);
    }

    fn obey_orders(&mut self) {
        while let Ok(order) = self.orders.pop() {
            self.obey(order);
        }
    }

    fn obey(&mut self, order: Command) {
        match order {
            Command::Pause => {
                self.paused = true;
                self.reply(Ok(None), Returned::Nothing);
            }
            Command::Resume if self.lock_step => self.reply(Err(Refusal::LockStep), Returned::Nothing),
            Command::Resume => {
                self.paused = false;
                self.reply(Ok(None), Returned::Nothing);
            }
            Command::Step { poses, .. } if !self.paused => self.reply(Err(Refusal::NotPaused), Returned::Poses(poses)),
            Command::Step { poses, .. } if self.is_stepping() => self.reply(Err(Refusal::Busy), Returned::Poses(poses)),
            Command::Step { ticks: 0, poses, .. } => self.reply(Ok(None), Returned::Poses(poses)),
            Command::Step { ticks, poses, deadline } => {
                self.step = Step { ticks_left: ticks, poses, deadline: Some(deadline), ..Step::default() };
            }
            Command::Interrupt if self.is_stepping() => {
                self.step.cut(EarlyEndCause::Interrupted);
                self.step.interrupts += 1;
            }
            Command::Interrupt => self.reply(Ok(None), Returned::Nothing),
            Command::Snapshot => {
                let id = self.snapshots.keep(&self.state);
                self.reply(Ok(Some(id)), Returned::Nothing);
            }
            Command::Reset => {
                self.restart();
                self.reply(Ok(None), Returned::Nothing);
            }
            Command::Restore { id } => {
                let found = self.snapshots.find(id).map(|kept| {
                    self.state.copy_from(kept);
                    self.detail.begin_anew(&self.model, &self.state);
                });
                self.reply(found.map(|()| None).ok_or(Refusal::UnknownSnapshot), Returned::Nothing);
            }
            Command::Activate(live) => {
                let retired = self.detail.activate(live, &self.model, &self.state);
                self.reply(Ok(None), Returned::Enrichment(retired));
            }
        }
    }

    fn restart(&mut self) {
        self.state.copy_from(&self.rest);
        self.detail.begin_anew(&self.model, &self.state);
        self.outbox.forget();
        self.report = TickReport::default();
        for queue in &mut self.pose_queues {
            while queue.pop().is_ok() {}
        }
    }

    fn reply(&mut self, result: Result<Option<u64>, Refusal>, returned: Returned) {
        self.answer(result, returned, None);
    }

    /// Updates the status and the clock before it sends the answer.
    fn answer(&mut self, result: Result<Option<u64>, Refusal>, returned: Returned, early: Option<EarlyEnd>) {
        self.statistics.sim_time.set(self.state.sim_time_s());
        let present = Present { model: &self.model, state: &self.state, report: &self.report };
        self.outbox.hand_out_reading(present, &self.detail, self.paused);
        let outcome = result.map(|snapshot| Outcome {
            tick: self.state.tick(),
            sim_time_s: self.state.sim_time_s(),
            paused: self.paused,
            snapshot,
            database_generation: self.detail.generation(),
            early,
        });
        // The sender never has more commands under way than there is room for answers.
        let _ = self.replies.push(Reply { outcome, returned });
        self.answered.wake();
    }
}

fn connect_outbox(
    model: &Model,
    rest: &State,
    options: LoopOptions,
    simulation: &Arc<Waker>,
) -> (Outbox, FramePort, Vec<WrenchPort>, triple_buffer::Output<Reading>) {
    let frame = Frame { positions: vec![[0.0; 3]; model.n_skin()], ..Frame::default() };
    let (frames, frames_out) = triple_buffer(&frame);
    let (readings, readings_out) = triple_buffer(&Reading {
        tools: rest.tools().to_vec(),
        force_steps_n: vec![0.0; model.n_tools()],
        ..Reading::default()
    });
    let (skin_waker, wrench_waker) = (Arc::new(Waker::default()), Arc::new(Waker::default()));
    let (listening, questions) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
    let tool = |_| {
        let (queue, wrenches) = rtrb::RingBuffer::new(WRENCH_QUEUE);
        let listening = Arc::new(AtomicBool::new(false));
        let port = WrenchPort { wrenches, listening: Arc::clone(&listening), published: Arc::clone(&wrench_waker) };
        (ToolOutlet { queue, listening }, port)
    };
    let (outlets, wrench_ports) = (0..model.n_tools()).map(tool).unzip();
    let frame_port = FramePort {
        frames: frames_out,
        listening: Arc::clone(&listening),
        questions: Arc::clone(&questions),
        published: Arc::clone(&skin_waker),
        simulation: Arc::clone(simulation),
    };
    let outbox = Outbox {
        frames,
        readings,
        wrenches: outlets,
        listening,
        questions,
        skin_waker,
        wrench_waker,
        cadences: Cadences::new(options.publish_hz, options.wrench_hz, model.timestep_s()),
        answered: 0,
        due: 0,
        degraded: false,
        was_sleeping: false,
        max_penetration_m: 0.0,
        fallbacks: 0,
        dropped_contacts: 0,
        force_steps: ForceSteps::new(model.n_tools(), model.timestep_s()),
    };
    (outbox, frame_port, wrench_ports, readings_out)
}
