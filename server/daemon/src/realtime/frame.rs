//! Output of the simulation thread.

use plica_sim::{TickReport, ToolReading};

/// The skin after a tick.
#[derive(Debug, Clone, Default)]
pub struct Frame {
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time \[s\].
    pub sim_time_s: f64,
    /// Source time of the newest pose of any tool \[ns\].
    pub newest_pose_source_time_ns: u64,
    /// Whether a state was rolled back since the frame before, or detail that was not finite was left out.
    pub degraded: bool,
    /// Whether the object is at rest and this is a repeat.
    pub sleeping: bool,
    /// Least confidence over the tools in contact; 0 is the plain coarse skin.
    pub confidence: f32,
    /// Counts activations of examples; 0: none is active.
    pub database_generation: u32,
    /// World positions `[n_skin]` \[m\].
    pub positions: Vec<[f32; 3]>,
    /// Counts frames that are due for publishing; a frame made only for a query keeps the number.
    pub due: u64,
    /// Number of the newest query that this frame answers.
    pub answers: u64,
}

/// Force and torque on one tool after a tick.
#[derive(Debug, Clone, Copy)]
pub struct ToolFrame {
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time \[s\].
    pub sim_time_s: f64,
    /// The tool.
    pub reading: ToolReading,
    /// Confidence of the enrichment at this tool, when a frame was last made.
    pub confidence: f32,
}

/// State of the simulation, for the status.
#[derive(Debug, Clone, Default)]
pub struct Reading {
    /// Ticks since reset.
    pub tick: u64,
    /// Simulated time \[s\].
    pub sim_time_s: f64,
    /// Whether it is paused.
    pub paused: bool,
    /// Times that a state was rolled back.
    pub rollbacks: u64,
    /// The last tick.
    pub report: TickReport,
    /// Deepest penetration since reset \[m\].
    pub max_penetration_m: f32,
    /// Ticks since reset that repeated a solve with block Jacobi.
    pub fallbacks: u64,
    /// Contact rows since reset that were found and left out because a tool or plane had its `max_contacts`.
    pub dropped_contacts: u64,
    /// Counts activations of examples; 0: none is active.
    pub database_generation: u32,
    /// Least confidence over the tools in contact; `None` while no examples are active.
    pub confidence: Option<f32>,
    /// All tools, `[n_tools]`.
    pub tools: Vec<ToolReading>,
    /// Largest change of each tool's force from tick to tick lately, `[n_tools]` \[N\].
    pub force_steps_n: Vec<f64>,
}
