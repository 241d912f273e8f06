//! Enrichment of a scene, as typed.

#![allow(rustdoc::broken_intra_doc_links, reason = "units in brackets; the schema shows this text as it is")]

use plica_sim::enrichment::DEFAULT_METHOD;
use schemars::JsonSchema;
use serde::Deserialize;

/// Enrichment method and its options. Lengths are in coarse cells, since detail is the part of the deformation below their size.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawEnrichment {
    /// Database to start with, as `plicad train` writes it; path relative to the scene file. Left out: the plain coarse skin until
    /// a database is activated.
    pub database: Option<String>,
    /// Name of a method, as `plicad evaluate` measures it: `kriging-stamp` (the default), `kriging-blend`, `ssh12-vector`, `rescale`,
    /// ...; an unknown name lists all. Or its family alone: `kriging`, `ssh12`, `linear`, `ridge`, `harmonic`, `rbf`, `rescale`.
    pub method: String,
    /// Interpolation of a family. Left out: stamps; vectors for the families that are measured with vectors only.
    pub interpolation: Option<RawInterpolation>,
    /// Coordinates around a contact point. Left out, like all keys below: those of the method.
    pub coordinates: Option<RawCoordinates>,
    /// Radius of the chart around a contact point, in coarse cells.
    #[schemars(range(min = 0.5, max = 64.0))]
    pub radius_cells: Option<f64>,
    /// Texels of a stamp per side.
    #[schemars(range(min = 8, max = 256))]
    pub texels: Option<u32>,
    /// Modes that the examples' detail is reduced to; as many as examples or more keep the examples.
    #[schemars(range(min = 1, max = 100_000))]
    pub modes: Option<u32>,
    /// Whether detail fades to the coarse skin where examples do not cover the state.
    pub fade: Option<bool>,
}

/// Interpolation of detail on the skin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawInterpolation {
    /// Stamp: moved with the contact point, in a chart around it.
    Stamp,
    /// Vector: at the place of the examples, vertex by vertex.
    Vector,
    /// A stamp near the contact point, vectors beyond.
    Blend,
    /// A stamp near the contact point, the place of each example beyond.
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
        Self {
            database: None,
            method: DEFAULT_METHOD.to_owned(),
            interpolation: None,
            coordinates: None,
            radius_cells: None,
            texels: None,
            modes: None,
            fade: None,
        }
    }
}
