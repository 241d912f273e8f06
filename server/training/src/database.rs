//! The example database: one safetensors file (`server/training/FORMAT.md`).

mod plausible;
mod read;
mod tensors;
mod write;

use std::collections::BTreeMap;

use plica_accurate::TIE_VERSION;
use serde::{Deserialize, Serialize};

use crate::example::{Example, Record, Rejection};
use plica_sim::enrichment::Examples;

/// What the metadata calls the format.
pub const FORMAT: &str = "plica-examples";
/// Version of the format.
pub const FORMAT_VERSION: u32 = 1;
/// The only metadata key of the file.
pub const METADATA_KEY: &str = "plica";
/// Version of what an example is: interactions, drive, settling, acceptance. Databases of another one are refused.
pub const TANDEM_VERSION: u32 = 1;
/// Version of the accurate model and its solver: raised when its results change by more than rounding.
pub const SOLVER_VERSION: u32 = 1;
/// What `contact_point` means.
pub const CONTACT_POINT: &str = "tool axis (z) on the deformed coarse skin, pulled back to the reference skin; for a ball, \
                                 or where the axis misses, the centroid of weights 1 at gap <= 0 falling smoothly to 0 at 1 mm";

/// Largest database that is read.
pub const MAX_DATABASE_BYTES: u64 = 1 << 30;

pub use plausible::SceneLimits;

/// Examples of one scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Database {
    /// What holds for all of them.
    pub about: About,
    /// Examples in the order of their interactions.
    pub examples: Vec<Example>,
    /// Interactions that gave none.
    pub rejected: Vec<Rejection>,
}

impl Database {
    /// The first `n` examples, or all if there are fewer, as enrichment takes them. A training database is in farthest-point
    /// order, so that any leading part covers the region.
    pub fn leading_examples(&self, n: usize) -> Examples {
        let taken = &self.examples[..n.min(self.examples.len())];
        Examples {
            displacements: taken.iter().map(|e| e.displacements.clone()).collect(),
            details: taken.iter().map(|e| e.detail.clone()).collect(),
            touches: taken.iter().map(Example::touch).collect(),
        }
    }
}

/// What holds for all examples of a database.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// The scene they belong to.
    pub scene_hash: String,
    /// What they are for.
    pub kind: DatabaseKind,
    /// Seed of the interactions.
    pub seed: u64,
    /// What random numbers are.
    pub generator: String,
    /// What a contact point is.
    pub contact_point: String,
    /// Versions of `tandem`, `solver` and `tie`.
    pub versions: BTreeMap<String, u32>,
}

/// What examples are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DatabaseKind {
    /// Examples to learn from.
    Training,
    /// Held-out interactions that are never trained on.
    Evaluation,
}

impl DatabaseKind {
    /// As in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Training => "training",
            Self::Evaluation => "evaluation",
        }
    }
}

impl About {
    /// Of a database made by this version of the program.
    pub fn new(scene_hash: &str, kind: DatabaseKind, seed: u64) -> Self {
        Self {
            scene_hash: scene_hash.to_owned(),
            kind,
            seed,
            generator: crate::random::GENERATOR.to_owned(),
            contact_point: CONTACT_POINT.to_owned(),
            versions: versions(),
        }
    }
}

/// Versions that the examples depend on.
pub fn versions() -> BTreeMap<String, u32> {
    let named = [("tandem", TANDEM_VERSION), ("solver", SOLVER_VERSION), ("tie", TIE_VERSION)];
    named.into_iter().map(|(name, version)| (name.to_owned(), version)).collect()
}

/// The value of the metadata key.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Metadata {
    format: String,
    format_version: u32,
    about: About,
    examples: Vec<Record>,
    rejected: Vec<Rejection>,
    /// See [`tensors::checksum`].
    sha256: String,
}
