//! The run-time phase of Plica: one soft object, stepped by an implicit corotational finite-element method against tools.
//!
//! Three boxes: a [`Model`] is built once and never changes, a [`State`] holds all that a tick changes and can be
//! copied as a snapshot, a [`Workspace`] is scratch that means nothing between calls. [`tick`](tick()) takes one time
//! step and
//! allocates nothing.
//!
//! This crate knows no bus, no thread and no clock: time is an argument. Run-time arithmetic is `f32`, construction is `f64`.

mod contact;
mod description;
mod element;
mod embedding;
pub mod enrichment;
pub mod kernels;
mod lanes;
mod model;
mod pose_ring;
mod probe;
mod report;
mod rotation;
mod smoothstep;
mod solver;
mod source_clock;
mod state;
mod step;
mod tick;
mod tool;
mod workspace;

pub use description::{
    ContactOptions, Coupling, ElementKind, Material, ModelDescription, Plane, Preconditioner, Sampling, SleepOptions,
    SolverOptions, SpringCoupling, ToolDescription, ToolShape,
};
pub use element::{lumped_mass, rest_stiffness};
pub use model::{Cost, Model, ModelError};
pub use probe::{NoProbe, Probe, Stage};
pub use report::{ContactReading, TickReport, ToolReading};
pub use state::State;
pub use tick::tick;
pub use tool::{PoseSample, ToolPose, world_from_tool};
pub use workspace::Workspace;

/// Input of one tick: time, and device poses received since the last tick.
#[derive(Debug, Clone, Copy)]
pub struct TickInput<'a> {
    /// The caller's clock at this tick \[s\]. Measures staleness and interpolation; must not run backwards.
    pub clock_s: f64,
    /// Device poses that arrived since the last tick, in order of arrival.
    pub poses: &'a [ToolPose],
}
