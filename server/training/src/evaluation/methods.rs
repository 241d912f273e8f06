//! The ways to enrich that are compared, by name.

use nalgebra::Vector3;
use plica_sim::enrichment::{
    Coordinates, Correlator, EnrichmentOptions, FieldOptions, Interpolator, LinearKind, Precision, Ssh12Options,
};

/// Name of the default way.
pub const DEFAULT_METHOD: &str = "kriging-stamp";

/// A way to enrich, with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// `correlator-interpolator`, and what is special.
    pub name: String,
    /// What it is.
    pub options: EnrichmentOptions,
}

/// Radius of the paper's blend, in coarse cells: with the default chart, which covers most of the object, it would be a stamp.
const BLEND_CELLS: f64 = 2.0;
/// Width of radial basis functions, in coarse cells.
const RBF_CELLS: f64 = 1.33;

impl Method {
    fn new(name: &str, options: EnrichmentOptions) -> Self {
        Self { name: name.to_owned(), options }
    }

    /// How states are compared.
    pub fn correlator(&self) -> &'static str {
        match self.options.correlator {
            Correlator::Rescale => "rescale",
            Correlator::Ssh12(_) => "ssh12",
            Correlator::Linear(LinearKind::Regression) => "linear",
            Correlator::Linear(LinearKind::Ridge) => "ridge",
            Correlator::Linear(LinearKind::Harmonic) => "harmonic",
            Correlator::Rbf { .. } => "rbf",
            Correlator::Kriging => "kriging",
        }
    }

    /// How detail is laid on the skin.
    pub fn interpolator(&self) -> &'static str {
        match (self.options.correlator, self.options.field.interpolator) {
            (Correlator::Rescale, _) => "none",
            (_, Interpolator::Vector) => "vector",
            (_, Interpolator::Stamp) => "stamp",
            (_, Interpolator::Blend) => "blend",
            (_, Interpolator::Warp) => "warp",
        }
    }
}

/// All of them, with stamps laid out along `axes`. The paper's own, `ssh12`, is as in the paper: no null example, examples as
/// they are.
pub fn methods(axes: [Vector3<f64>; 2]) -> Vec<Method> {
    let own = EnrichmentOptions { axes, ..EnrichmentOptions::default() };
    let own_on = |interpolator| EnrichmentOptions { field: FieldOptions { interpolator, ..own.field }, ..own };
    let mut all = vec![
        Method::new(DEFAULT_METHOD, own),
        Method::new(
            "kriging-stamp-plain",
            EnrichmentOptions { field: FieldOptions { control_variate: false, ..own.field }, ..own },
        ),
        Method::new("kriging-stamp-orthogonal", EnrichmentOptions { coordinates: Coordinates::Orthogonal, ..own }),
        Method::new("kriging-vector", own_on(Interpolator::Vector)),
        Method::new("kriging-blend", own_on(Interpolator::Blend)),
        Method::new("kriging-warp", own_on(Interpolator::Warp)),
        Method::new("rescale", EnrichmentOptions { correlator: Correlator::Rescale, ..own }),
    ];
    let plain = FieldOptions {
        control_variate: false,
        window: [0.5, 1.0],
        modes: usize::MAX,
        precision: Precision::F32,
        ..own.field
    };
    let plain = |correlator, interpolator| {
        let radius_cells = if interpolator == Interpolator::Blend { BLEND_CELLS } else { own.radius_cells };
        EnrichmentOptions { correlator, radius_cells, field: FieldOptions { interpolator, ..plain }, ..own }
    };
    let baselines = [
        ("ridge-vector", Correlator::Linear(LinearKind::Ridge)),
        ("linear-vector", Correlator::Linear(LinearKind::Regression)),
        ("harmonic-vector", Correlator::Linear(LinearKind::Harmonic)),
        ("rbf-vector", Correlator::Rbf { width_cells: RBF_CELLS }),
    ];
    all.extend(baselines.map(|(name, correlator)| Method::new(name, plain(correlator, Interpolator::Vector))));
    let paper = Ssh12Options { null_weight: 0.0, ..Ssh12Options::default() };
    let papers = [
        ("ssh12-vector", paper, Interpolator::Vector),
        ("ssh12-stamp", paper, Interpolator::Stamp),
        ("ssh12-blend", paper, Interpolator::Blend),
        ("ssh12-warp", paper, Interpolator::Warp),
        ("ssh12-blend-null", Ssh12Options::default(), Interpolator::Blend),
        ("ssh12-vector-literal", Ssh12Options { literal: true, ..paper }, Interpolator::Vector),
    ];
    all.extend(papers.map(|(name, options, on)| Method::new(name, plain(Correlator::Ssh12(options), on))));
    all
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_say_what_methods_are() {
        let all = methods([Vector3::x(), Vector3::y()]);
        assert_eq!(all.iter().map(|m| &m.name).collect::<BTreeSet<_>>().len(), all.len(), "a name stands twice");
        assert_eq!(
            all.iter().find(|m| m.name == DEFAULT_METHOD).map(|m| m.options),
            Some(EnrichmentOptions::default())
        );
        for m in all.iter().filter(|m| m.interpolator() != "none") {
            assert!(m.name.starts_with(&format!("{}-{}", m.correlator(), m.interpolator())), "{}", m.name);
        }
    }
}
