//! Case files of `plicad solve`: [`RawCase`] as typed, [`Case`] checked, [`Problem`] with its selections resolved.

mod arc;
mod checked;
mod extrapolation;
mod failure;
mod fibres;
mod follow;
mod held;
mod load;
mod material;
mod mesh;
mod news;
mod output;
mod probe;
mod problem;
mod raw;
mod reading;
mod select;
mod solution;
mod stable;
mod support;
mod tool;
mod tool_contact;

pub use checked::{ArcLength, Case, SolveOptions};
pub use failure::{Failure, StepError};
pub use follow::follow;
pub use load::Load;
pub use mesh::MeshSource;
pub use news::News;
pub use output::write_result;
pub use probe::Probe;
pub use problem::Problem;
pub use raw::RawCase;
pub use reading::Reading;
pub use solution::{LoadStep, Solution, Stability};
pub use support::Support;
pub use tool::Tool;

use std::sync::OnceLock;

use schemars::Schema;

/// JSON Schema of case files: every key with its meaning, unit and range.
pub fn schema() -> &'static Schema {
    static SCHEMA: OnceLock<Schema> = OnceLock::new();
    SCHEMA.get_or_init(|| schemars::schema_for!(RawCase))
}

#[cfg(test)]
mod tests;
