//! Case files of `plicad solve`: [`RawCase`] as typed, [`Case`] checked, [`Problem`] with its selections resolved.

mod checked;
mod follow;
mod held;
mod material;
mod mesh;
mod output;
mod probe;
mod problem;
mod raw;
mod reading;
mod select;
mod solution;
mod support;

pub use checked::{Case, SolveOptions};
pub use follow::{Failure, News, follow};
pub use mesh::MeshSource;
pub use output::write_result;
pub use probe::Probe;
pub use problem::{Load, Problem};
pub use raw::RawCase;
pub use reading::Reading;
pub use solution::{LoadStep, Solution};
pub use support::Support;

use std::sync::OnceLock;

use schemars::Schema;

/// JSON Schema of case files: every key with its meaning, unit and range.
pub fn schema() -> &'static Schema {
    static SCHEMA: OnceLock<Schema> = OnceLock::new();
    SCHEMA.get_or_init(|| schemars::schema_for!(RawCase))
}

#[cfg(test)]
mod tests;
