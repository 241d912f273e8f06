//! The far ends of the simulation thread's queues.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use plica_sim::PoseSample;
use triple_buffer::Output;

use super::command::{Command, Reply};
use super::frame::{Frame, Reading, ToolFrame};
use super::statistics::Statistics;
use super::waker::Waker;

/// Far ends of the queues of a running [`Loop`](super::Loop).
#[derive(Debug)]
pub struct Ports {
    /// Device poses, one queue per tool.
    pub poses: Vec<rtrb::Producer<PoseSample>>,
    /// Commands.
    pub commands: CommandPort,
    /// Skin frames.
    pub frames: FramePort,
    /// Wrenches, one queue per tool.
    pub wrenches: Vec<WrenchPort>,
    /// State of the simulation.
    pub readings: Output<Reading>,
    /// Counters and histograms.
    pub statistics: Arc<Statistics>,
}

/// Commands and their answers.
#[derive(Debug)]
pub struct CommandPort {
    /// Commands.
    pub orders: rtrb::Producer<Command>,
    /// Answers in the same order.
    pub replies: rtrb::Consumer<Reply>,
    /// Woken when an answer is there.
    pub answered: Arc<Waker>,
    /// Wakes the simulation thread, which sleeps in lock-step.
    pub simulation: Arc<Waker>,
}

/// Skin frames, the newest only.
#[derive(Debug)]
pub struct FramePort {
    /// The newest frame.
    pub frames: Output<Frame>,
    /// Whether a client listens; otherwise no frame is made at the publishing rate.
    pub listening: Arc<AtomicBool>,
    /// Number of queries so far.
    pub questions: Arc<AtomicU64>,
    /// Woken when a frame is there.
    pub published: Arc<Waker>,
    /// Wakes the simulation thread, which sleeps in lock-step.
    pub simulation: Arc<Waker>,
}

impl FramePort {
    /// Requests a frame, due or not; the first frame whose `answers` has reached the returned number answers it.
    pub fn ask(&self) -> u64 {
        let number = self.questions.fetch_add(1, Relaxed) + 1;
        self.simulation.wake();
        number
    }
}

/// Wrenches of one tool.
#[derive(Debug)]
pub struct WrenchPort {
    /// In order of ticks.
    pub wrenches: rtrb::Consumer<ToolFrame>,
    /// Whether a client listens; otherwise no wrench is made.
    pub listening: Arc<AtomicBool>,
    /// Woken when wrenches are there. One waker serves all tools.
    pub published: Arc<Waker>,
}
