//! Commands to the simulation thread, and their answers.

use std::time::Instant;

use plica_sim::ToolPose;
use plica_sim::enrichment::LiveEnrichment;

/// A command, executed between ticks.
#[derive(Debug)]
pub enum Command {
    /// Returns to the rest state and tick 0.
    Reset,
    /// Pauses the simulation.
    Pause,
    /// Resumes the simulation.
    Resume,
    /// Runs ticks while paused. Poses are applied before the first tick.
    Step {
        /// Number of ticks.
        ticks: u32,
        /// Poses; the vector travels back in the reply, so that it is freed elsewhere.
        poses: Vec<ToolPose>,
        /// Time at which the step stops early, after the tick that runs.
        deadline: Instant,
    },
    /// Ends the step that runs after its present tick; answered after that step.
    Interrupt,
    /// Stores the present state.
    Snapshot,
    /// Returns to a stored state.
    Restore {
        /// Number of the snapshot.
        id: u64,
    },
    /// Activates other examples. The former ones travel back in the reply.
    Activate(Box<LiveEnrichment>),
}

/// State of the simulation after a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time \[s\].
    pub sim_time_s: f64,
    /// Whether it is paused.
    pub paused: bool,
    /// Number of the snapshot that was taken.
    pub snapshot: Option<u64>,
    /// Counts activations of examples; 0 is the plain coarse skin.
    pub database_generation: u32,
    /// Why a step has stopped before its last tick.
    pub early: Option<EarlyEnd>,
}

/// A step that stopped before its last tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EarlyEnd {
    /// Ticks that did not run.
    pub ticks_left: u32,
    /// The cause.
    pub cause: EarlyEndCause,
}

/// Cause of an [`EarlyEnd`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EarlyEndCause {
    /// [`Command::Interrupt`].
    Interrupted,
    /// The deadline of the step.
    Deadline,
}

/// Why a command was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// Steps require a paused simulation.
    NotPaused,
    /// In lock-step the simulation cannot be resumed.
    LockStep,
    /// No such snapshot, or overwritten by a newer one.
    UnknownSnapshot,
    /// Steps of an earlier command still run.
    Busy,
}

/// Answer to one command.
#[derive(Debug)]
pub struct Reply {
    /// Result.
    pub outcome: Result<Outcome, Refusal>,
    /// Memory that came with the command or was replaced by it, to be freed by the sender.
    pub returned: Returned,
}

/// Memory on its way back from the simulation thread.
#[derive(Debug)]
pub enum Returned {
    /// No memory.
    Nothing,
    /// The vector of a [`Command::Step`].
    Poses(Vec<ToolPose>),
    /// Enrichment that a [`Command::Activate`] has replaced.
    Enrichment(Option<Box<LiveEnrichment>>),
}
