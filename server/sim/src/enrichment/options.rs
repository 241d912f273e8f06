//! Options of an enrichment method.

use nalgebra::Vector3;

use super::field::{FieldOptions, Interpolator};
use super::layout::Coordinates;
use super::linear::LinearKind;
use super::modes::Precision;
use super::ssh12::Ssh12Options;

/// Correlation of the present state with examples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Correlator {
    /// None: the coarse indentation is rescaled.
    Rescale,
    /// Similarity of displacement vectors, the paper's.
    Ssh12(Ssh12Options),
    /// A linear map.
    Linear(LinearKind),
    /// The position of the tool, with a width in coarse cells.
    Rbf {
        /// Width of the basis functions, in coarse cells.
        width_cells: f64,
    },
    /// Gaussian-process weights.
    Kriging,
}

/// Options of an enrichment method. Lengths are in cells of the coarse mesh, below which detail is missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnrichmentOptions {
    /// Correlation.
    pub correlator: Correlator,
    /// Interpolation.
    pub field: FieldOptions,
    /// Radius of the chart around a contact point, in coarse cells.
    pub radius_cells: f64,
    /// Distance of the charts' anchors, in coarse cells.
    pub anchor_cells: f64,
    /// Geodesic or projected.
    pub coordinates: Coordinates,
    /// Whether untrusted detail fades to the coarse skin.
    pub fade: bool,
    /// Axes of stamps.
    pub axes: [Vector3<f64>; 2],
}

impl Default for EnrichmentOptions {
    fn default() -> Self {
        Self {
            correlator: Correlator::Kriging,
            field: FieldOptions {
                interpolator: Interpolator::Stamp,
                texels: 32,
                window: [0.75, 1.0],
                modes: 32,
                precision: Precision::I16,
                control_variate: true,
            },
            radius_cells: 7.0,
            anchor_cells: 0.5,
            coordinates: Coordinates::Exponential,
            fade: true,
            axes: [Vector3::x(), Vector3::y()],
        }
    }
}
