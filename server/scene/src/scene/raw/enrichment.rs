//! What a scene says about enrichment, as typed.

#![allow(rustdoc::broken_intra_doc_links, reason = "units in brackets; the schema shows this text as it is")]

use plica_sim::enrichment::EnrichmentOptions;
use schemars::JsonSchema;
use serde::Deserialize;

/// How examples become detail on the skin. Lengths are in coarse cells: detail is what the coarse mesh misses below them.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawEnrichment {
    /// Examples to start with, as `plicad train` leaves them: path relative to the scene file. Left out: the plain coarse skin
    /// until a database is activated.
    pub database: Option<String>,
    /// How the present state is compared with the examples.
    pub method: RawEnrichmentMethod,
    /// How their detail is laid on the skin.
    pub interpolation: RawInterpolation,
    /// Coordinates around a contact point.
    pub coordinates: RawCoordinates,
    /// Radius of the chart around a contact point, in coarse cells.
    #[schemars(range(min = 0.5, max = 64.0))]
    pub radius_cells: f64,
    /// Texels of a stamp per side.
    #[schemars(range(min = 8, max = 256))]
    pub texels: u32,
    /// Modes that the examples' detail is reduced to; as many as examples or more keep the examples.
    #[schemars(range(min = 1, max = 100_000))]
    pub modes: u32,
    /// Whether detail that the examples do not cover fades to the coarse skin. Of `kriging` only; `ssh12` always does.
    pub fade: bool,
}

/// How the present state is compared with the examples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawEnrichmentMethod {
    /// Gaussian-process weights on the coarse skin around the contact point.
    Kriging,
    /// The paper's: likeness of the displacement vectors.
    Ssh12,
    /// Linear regression.
    Linear,
    /// Ridge regression.
    Ridge,
    /// Linear with harmonic regularisation.
    Harmonic,
    /// The position of the tool.
    Rbf,
    /// Not at all: the coarse dent is rescaled by what the examples say on average.
    Rescale,
}

/// How detail is laid on the skin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawInterpolation {
    /// Moved along with the contact point, in a chart around it.
    Stamp,
    /// Where the examples have it, vertex by vertex.
    Vector,
    /// A stamp near the contact point, vectors beyond.
    Blend,
    /// A stamp near the contact point, each example's own place beyond.
    Warp,
}

/// Coordinates around a contact point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawCoordinates {
    /// Along the surface.
    Exponential,
    /// Projected to the tangent plane: the paper's; folds where the surface turns.
    Orthogonal,
}

impl Default for RawEnrichment {
    fn default() -> Self {
        let d = EnrichmentOptions::default();
        Self {
            database: None,
            method: RawEnrichmentMethod::Kriging,
            interpolation: RawInterpolation::Stamp,
            coordinates: RawCoordinates::Exponential,
            radius_cells: d.radius_cells,
            texels: d.field.texels as u32,
            modes: d.field.modes as u32,
            fade: d.fade,
        }
    }
}
