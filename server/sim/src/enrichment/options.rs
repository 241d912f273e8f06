//! What a way to enrich is made of.

use nalgebra::Vector3;

use super::field::{FieldOptions, Interpolator};
use super::layout::Coordinates;
use super::linear::LinearKind;
use super::modes::Precision;
use super::ssh12::Ssh12Options;

/// How the present state is compared with examples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Correlator {
    /// Not at all: the coarse dent is rescaled, nothing else.
    Rescale,
    /// The paper's.
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

/// A way to enrich. Lengths come from the coarse mesh: its cells are what detail is missing below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnrichmentOptions {
    /// How states are compared.
    pub correlator: Correlator,
    /// How detail is laid on the skin.
    pub field: FieldOptions,
    /// Radius of the chart around a contact point, in coarse cells.
    pub radius_cells: f64,
    /// Distance of the charts' anchors, in coarse cells.
    pub anchor_cells: f64,
    /// Geodesic or projected.
    pub coordinates: Coordinates,
    /// Whether what is not trusted fades to the coarse skin.
    pub fade: bool,
    /// Axes that stamps are laid out along.
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
