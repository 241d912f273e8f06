//! `[objects.<name>.enrichment]`, checked.

use std::path::PathBuf;

use nalgebra::Vector3;
use plica_sim::enrichment::{Coordinates, EnrichmentOptions, FAMILIES, Interpolator, METHODS};

use super::raw::{RawCoordinates, RawEnrichment, RawInterpolation};
use crate::checks::Check;
use crate::error::ConfigError;

/// Enrichment method of a scene and its database.
#[derive(Debug, Clone, PartialEq)]
pub struct EnrichmentConfig {
    /// Options of the method.
    pub options: EnrichmentOptions,
    /// Database to start with.
    pub database: Option<PathBuf>,
}

/// Checks the table; stamps are laid out along `axes`.
pub(super) fn check(
    c: &Check<'_>,
    key: &str,
    raw: &RawEnrichment,
    axes: [Vector3<f64>; 2],
) -> Result<EnrichmentConfig, ConfigError> {
    let mut options = method(c, key, raw, axes)?;
    if let Some(texels) = raw.texels {
        options.field.texels = texels as usize;
    }
    if let Some(modes) = raw.modes {
        options.field.modes = modes as usize;
    }
    if let Some(radius_cells) = raw.radius_cells {
        options.radius_cells = radius_cells;
    }
    if let Some(coordinates) = raw.coordinates {
        options.coordinates = match coordinates {
            RawCoordinates::Exponential => Coordinates::Exponential,
            RawCoordinates::Orthogonal => Coordinates::Orthogonal,
        };
    }
    options.fade = raw.fade.unwrap_or(options.fade);
    let folder = c.document().file().parent().map(PathBuf::from).unwrap_or_default();
    Ok(EnrichmentConfig { options, database: raw.database.as_ref().map(|typed| folder.join(typed)) })
}

/// A row of [`METHODS`], or a family with an interpolation.
fn method(
    c: &Check<'_>,
    key: &str,
    raw: &RawEnrichment,
    axes: [Vector3<f64>; 2],
) -> Result<EnrichmentOptions, ConfigError> {
    let interpolator = raw.interpolation.map(interpolator);
    if let Some(options) = EnrichmentOptions::of_family(&raw.method, interpolator, axes) {
        return Ok(options);
    }
    let Some(options) = EnrichmentOptions::named(&raw.method, axes) else {
        let names: Vec<&str> = METHODS.iter().map(|m| m.name).collect();
        let advice =
            format!("choose one of {}; or a family, {}, with `interpolation`", names.join(", "), FAMILIES.join(", "));
        return Err(c.error(&format!("{key}.method"), format!("no method `{}`", raw.method), advice));
    };
    match interpolator {
        Some(other) if other != options.field.interpolator => {
            let problem = format!("`{}` contradicts method = \"{}\"", other.name(), raw.method);
            Err(c.error(&format!("{key}.interpolation"), problem, "remove one of the two"))
        }
        _ => Ok(options),
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
