//! What the simulation thread can be asked to do, and what it answers.

use plica_sim::ToolPose;
use plica_sim::enrichment::LiveEnrichment;

/// An order, obeyed between ticks.
#[derive(Debug)]
pub enum Command {
    /// Rest state, tick 0.
    Reset,
    /// Stops.
    Pause,
    /// Goes on.
    Resume,
    /// Runs ticks while stopped. The poses are applied before the first one.
    Step {
        /// How many.
        ticks: u32,
        /// Poses; the vector travels back in the reply, so that it is freed elsewhere.
        poses: Vec<ToolPose>,
    },
    /// Keeps the present state.
    Snapshot,
    /// Returns to a kept state.
    Restore {
        /// Number of the snapshot.
        id: u64,
    },
    /// Enriches with other examples from now on. What did so before travels back in the reply.
    Activate(Box<LiveEnrichment>),
}

/// Where the simulation stands after an order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time \[s\].
    pub sim_time_s: f64,
    /// Whether it stands still.
    pub paused: bool,
    /// Number of the snapshot that was taken.
    pub snapshot: Option<u64>,
    /// Counts activations of examples; 0 is the plain coarse skin.
    pub database_generation: u32,
}

/// Why an order was not obeyed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// Steps are for a simulation that stands still.
    NotPaused,
    /// In lock-step the simulation never runs by itself.
    LockStep,
    /// There is no such snapshot, or it has been overwritten.
    UnknownSnapshot,
    /// Steps of an earlier order are still running.
    Busy,
}

/// Answer to one order.
#[derive(Debug)]
pub struct Reply {
    /// What came of it.
    pub outcome: Result<Outcome, Refusal>,
    /// What came with the order or was replaced by it, to be freed by the asker.
    pub returned: Returned,
}

/// Memory on its way back from the simulation thread.
#[derive(Debug)]
pub enum Returned {
    /// There is none.
    Nothing,
    /// The vector of a [`Command::Step`].
    Poses(Vec<ToolPose>),
    /// What a [`Command::Activate`] has replaced.
    Enrichment(Option<Box<LiveEnrichment>>),
}
