//! Methods that are compared, by name.

use nalgebra::Vector3;
use plica_sim::enrichment::{Correlator, EnrichmentOptions, METHODS};

/// An enrichment method with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// Name in [`METHODS`], or of a variant of one.
    pub name: String,
    /// Options.
    pub options: EnrichmentOptions,
}

impl Method {
    /// Name of the correlation's family.
    pub fn correlator(&self) -> &'static str {
        self.options.correlator.family()
    }

    /// Name of the interpolation.
    pub fn interpolator(&self) -> &'static str {
        if self.options.correlator == Correlator::Rescale { "none" } else { self.options.field.interpolator.name() }
    }
}

/// All of [`METHODS`], with stamps laid out along `axes`.
pub fn methods(axes: [Vector3<f64>; 2]) -> Vec<Method> {
    METHODS.iter().map(|m| Method { name: m.name.to_owned(), options: m.options(axes) }).collect()
}
