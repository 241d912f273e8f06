//! `[objects.<name>.enrichment]`, checked.

use std::path::PathBuf;

use nalgebra::Vector3;
use plica_sim::enrichment::{
    Coordinates, Correlator, EnrichmentOptions, FieldOptions, Interpolator, LinearKind, Ssh12Options,
};

use super::raw::{RawCoordinates, RawEnrichment, RawEnrichmentMethod, RawInterpolation};
use crate::checks::Check;
use crate::error::ConfigError;

/// Width of radial basis functions, in coarse cells.
const RBF_WIDTH_CELLS: f64 = 4.0 / 3.0;
/// Shares of a chart's radius between which a blend or a warp passes from near to far.
const WIDE_WINDOW: [f64; 2] = [0.5, 1.0];

/// How examples become detail on the skin.
#[derive(Debug, Clone, PartialEq)]
pub struct EnrichmentConfig {
    /// The way.
    pub options: EnrichmentOptions,
    /// Examples to start with.
    pub database: Option<PathBuf>,
}

/// `axes` are those that stamps are laid out along.
pub(super) fn check(
    c: &Check<'_>,
    raw: &RawEnrichment,
    axes: [Vector3<f64>; 2],
) -> Result<EnrichmentConfig, ConfigError> {
    let default = EnrichmentOptions::default();
    let correlator = correlator(raw.method);
    let interpolator = interpolator(raw.interpolation);
    let is_wide = matches!(interpolator, Interpolator::Blend | Interpolator::Warp);
    let folder = c.document().file().parent().map(PathBuf::from).unwrap_or_default();
    Ok(EnrichmentConfig {
        options: EnrichmentOptions {
            correlator,
            field: FieldOptions {
                interpolator,
                texels: raw.texels as usize,
                window: if is_wide { WIDE_WINDOW } else { default.field.window },
                modes: raw.modes as usize,
                control_variate: matches!(correlator, Correlator::Kriging | Correlator::Rescale),
                ..default.field
            },
            radius_cells: raw.radius_cells,
            coordinates: match raw.coordinates {
                RawCoordinates::Exponential => Coordinates::Exponential,
                RawCoordinates::Orthogonal => Coordinates::Orthogonal,
            },
            fade: raw.fade,
            axes,
            ..default
        },
        database: raw.database.as_ref().map(|typed| folder.join(typed)),
    })
}

fn correlator(raw: RawEnrichmentMethod) -> Correlator {
    match raw {
        RawEnrichmentMethod::Kriging => Correlator::Kriging,
        RawEnrichmentMethod::Ssh12 => Correlator::Ssh12(Ssh12Options::default()),
        RawEnrichmentMethod::Linear => Correlator::Linear(LinearKind::Regression),
        RawEnrichmentMethod::Ridge => Correlator::Linear(LinearKind::Ridge),
        RawEnrichmentMethod::Harmonic => Correlator::Linear(LinearKind::Harmonic),
        RawEnrichmentMethod::Rbf => Correlator::Rbf { width_cells: RBF_WIDTH_CELLS },
        RawEnrichmentMethod::Rescale => Correlator::Rescale,
    }
}

fn interpolator(raw: RawInterpolation) -> Interpolator {
    match raw {
        RawInterpolation::Stamp => Interpolator::Stamp,
        RawInterpolation::Vector => Interpolator::Vector,
        RawInterpolation::Blend => Interpolator::Blend,
        RawInterpolation::Warp => Interpolator::Warp,
    }
}
