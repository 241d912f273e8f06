//! Named methods: the one table that scenes, `plicad evaluate` and `plicad chart` read, so that a served method is the
//! one measured under its name.

use nalgebra::Vector3;

use super::field::{FieldOptions, Interpolator};
use super::layout::Coordinates;
use super::linear::LinearKind;
use super::modes::Precision;
use super::options::{Correlator, EnrichmentOptions};
use super::ssh12::Ssh12Options;

/// Name of the default method.
pub const DEFAULT_METHOD: &str = "kriging-stamp";

/// Chart radius of a blend without control variate, in coarse cells: the default chart covers most of the object and
/// would make the blend a stamp.
const BLEND_CELLS: f64 = 2.0;
/// Width of radial basis functions, in coarse cells.
const RBF_CELLS: f64 = 1.33;

/// One row of the table.
#[derive(Debug, Clone, Copy)]
pub struct NamedMethod {
    /// `family-interpolation`, then the variant.
    pub name: &'static str,
    /// One line about the method.
    pub summary: &'static str,
    options: fn() -> EnrichmentOptions,
}

/// All named methods, the default first.
pub const METHODS: &[NamedMethod] = &[
    NamedMethod {
        name: DEFAULT_METHOD,
        summary: "Gaussian-process weights, stamps that move with the contact; the default",
        options: EnrichmentOptions::default,
    },
    NamedMethod {
        name: "kriging-stamp-plain",
        summary: "the default without control variate",
        options: || with_field(|field| FieldOptions { control_variate: false, ..field }),
    },
    NamedMethod {
        name: "kriging-stamp-orthogonal",
        summary: "the default with coordinates projected to the tangent plane, as in the paper",
        options: || EnrichmentOptions { coordinates: Coordinates::Orthogonal, ..EnrichmentOptions::default() },
    },
    NamedMethod {
        name: "kriging-vector",
        summary: "Gaussian-process weights, detail at the vertices of the examples",
        options: || combined(Correlator::Kriging, Interpolator::Vector),
    },
    NamedMethod {
        name: "kriging-blend",
        summary: "Gaussian-process weights, a stamp near the contact and vectors beyond",
        options: || combined(Correlator::Kriging, Interpolator::Blend),
    },
    NamedMethod {
        name: "kriging-warp",
        summary: "Gaussian-process weights, a stamp near the contact and the place in each example beyond; slow",
        options: || combined(Correlator::Kriging, Interpolator::Warp),
    },
    NamedMethod {
        name: "rescale",
        summary: "the coarse indentation rescaled by the mean of the examples; no examples at run time",
        options: || combined(Correlator::Rescale, Interpolator::Stamp),
    },
    NamedMethod {
        name: "ridge-vector",
        summary: "ridge regression",
        options: || combined(Correlator::Linear(LinearKind::Ridge), Interpolator::Vector),
    },
    NamedMethod {
        name: "linear-vector",
        summary: "linear regression",
        options: || combined(Correlator::Linear(LinearKind::Regression), Interpolator::Vector),
    },
    NamedMethod {
        name: "harmonic-vector",
        summary: "linear regression with harmonic regularisation",
        options: || combined(Correlator::Linear(LinearKind::Harmonic), Interpolator::Vector),
    },
    NamedMethod {
        name: "rbf-vector",
        summary: "radial basis functions of the tool position",
        options: || combined(Correlator::Rbf { width_cells: RBF_CELLS }, Interpolator::Vector),
    },
    NamedMethod {
        name: "ssh12-vector",
        summary: "the paper's correlation, detail at the vertices of the examples",
        options: || paper(Interpolator::Vector),
    },
    NamedMethod {
        name: "ssh12-stamp",
        summary: "the paper's correlation, stamps that move with the contact",
        options: || paper(Interpolator::Stamp),
    },
    NamedMethod {
        name: "ssh12-blend",
        summary: "the paper's correlation, a stamp near the contact and vectors beyond",
        options: || paper(Interpolator::Blend),
    },
    NamedMethod {
        name: "ssh12-warp",
        summary: "the paper's correlation, a stamp near the contact and the place in each example beyond; slow",
        options: || paper(Interpolator::Warp),
    },
    NamedMethod {
        name: "ssh12-blend-null",
        summary: "ssh12-blend with a null example that fades detail out",
        options: || combined(Correlator::Ssh12(Ssh12Options::default()), Interpolator::Blend),
    },
    NamedMethod {
        name: "ssh12-vector-literal",
        summary: "ssh12-vector with the kernel of Eq. 10 as printed",
        options: || {
            let literal = Ssh12Options { literal: true, ..paper_options() };
            combined(Correlator::Ssh12(literal), Interpolator::Vector)
        },
    },
];

/// Families: the part of a name before the interpolation.
pub const FAMILIES: [&str; 7] = ["kriging", "ssh12", "linear", "ridge", "harmonic", "rbf", "rescale"];

impl EnrichmentOptions {
    /// The method with a name in [`METHODS`], with stamps laid out along `axes`.
    pub fn named(name: &str, axes: [Vector3<f64>; 2]) -> Option<Self> {
        METHODS.iter().find(|m| m.name == name).map(|m| m.options(axes))
    }

    /// The method of a family in [`FAMILIES`]. Without interpolation: stamps, or vectors where [`METHODS`] has no stamps of the family.
    pub fn of_family(family: &str, interpolator: Option<Interpolator>, axes: [Vector3<f64>; 2]) -> Option<Self> {
        let correlator = correlator(family)?;
        let has_stamps = METHODS.iter().any(|m| m.name == format!("{family}-{}", Interpolator::Stamp.name()));
        let is_stamp = has_stamps || correlator == Correlator::Rescale;
        let usual = if is_stamp { Interpolator::Stamp } else { Interpolator::Vector };
        Some(Self { axes, ..combined(correlator, interpolator.unwrap_or(usual)) })
    }
}

impl NamedMethod {
    /// Options with stamps laid out along `axes`.
    pub fn options(&self, axes: [Vector3<f64>; 2]) -> EnrichmentOptions {
        EnrichmentOptions { axes, ..(self.options)() }
    }
}

impl Correlator {
    /// Family in [`FAMILIES`].
    pub fn family(&self) -> &'static str {
        match self {
            Self::Kriging => "kriging",
            Self::Ssh12(_) => "ssh12",
            Self::Linear(LinearKind::Regression) => "linear",
            Self::Linear(LinearKind::Ridge) => "ridge",
            Self::Linear(LinearKind::Harmonic) => "harmonic",
            Self::Rbf { .. } => "rbf",
            Self::Rescale => "rescale",
        }
    }
}

impl Interpolator {
    /// Name, as in the name of a method.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Vector => "vector",
            Self::Stamp => "stamp",
            Self::Blend => "blend",
            Self::Warp => "warp",
        }
    }
}

fn correlator(family: &str) -> Option<Correlator> {
    Some(match family {
        "kriging" => Correlator::Kriging,
        "ssh12" => Correlator::Ssh12(paper_options()),
        "linear" => Correlator::Linear(LinearKind::Regression),
        "ridge" => Correlator::Linear(LinearKind::Ridge),
        "harmonic" => Correlator::Linear(LinearKind::Harmonic),
        "rbf" => Correlator::Rbf { width_cells: RBF_CELLS },
        "rescale" => Correlator::Rescale,
        _ => return None,
    })
}

/// Kriging and rescaling keep the default's storage and control variate; all others keep the examples exactly.
fn combined(correlator: Correlator, interpolator: Interpolator) -> EnrichmentOptions {
    let options = with_field(|field| FieldOptions { interpolator, ..field });
    if matches!(correlator, Correlator::Kriging | Correlator::Rescale) {
        return EnrichmentOptions { correlator, ..options };
    }
    let field = FieldOptions {
        control_variate: false,
        window: [0.5, 1.0],
        modes: usize::MAX,
        precision: Precision::F32,
        ..options.field
    };
    let radius_cells = if interpolator == Interpolator::Blend { BLEND_CELLS } else { options.radius_cells };
    EnrichmentOptions { correlator, field, radius_cells, ..options }
}

fn paper(interpolator: Interpolator) -> EnrichmentOptions {
    combined(Correlator::Ssh12(paper_options()), interpolator)
}

/// As in the paper, without a null example.
fn paper_options() -> Ssh12Options {
    Ssh12Options { null_weight: 0.0, ..Ssh12Options::default() }
}

fn with_field(change: impl Fn(FieldOptions) -> FieldOptions) -> EnrichmentOptions {
    let own = EnrichmentOptions::default();
    EnrichmentOptions { field: change(own.field), ..own }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    const AXES: [Vector3<f64>; 2] = [Vector3::new(0.0, 1.0, 0.0), Vector3::new(0.0, 0.0, 1.0)];

    #[test]
    fn names_agree_with_options() {
        assert_eq!(METHODS.iter().map(|m| m.name).collect::<BTreeSet<_>>().len(), METHODS.len(), "a name stands twice");
        for m in METHODS {
            let options = m.options(AXES);
            assert_eq!(EnrichmentOptions::named(m.name, AXES), Some(options));
            assert_eq!(options.axes, AXES);
            let (family, interpolation) = (options.correlator.family(), options.field.interpolator.name());
            let is_named = m.name == family || m.name.starts_with(&format!("{family}-{interpolation}"));
            assert!(is_named && FAMILIES.contains(&family), "{}", m.name);
        }
        let own = EnrichmentOptions { axes: AXES, ..EnrichmentOptions::default() };
        assert_eq!(EnrichmentOptions::named(DEFAULT_METHOD, AXES), Some(own));
        assert_eq!(EnrichmentOptions::named("krigging", AXES), None);
    }

    #[test]
    fn a_family_with_an_interpolation_is_the_row_of_that_name() {
        for family in FAMILIES {
            for on in [Interpolator::Vector, Interpolator::Stamp, Interpolator::Blend, Interpolator::Warp] {
                let both = EnrichmentOptions::of_family(family, Some(on), AXES);
                assert_eq!(both.map(|o| (o.correlator.family(), o.field.interpolator)), Some((family, on)));
                if let Some(row) = EnrichmentOptions::named(&format!("{family}-{}", on.name()), AXES) {
                    assert_eq!(both, Some(row), "{family}-{}", on.name());
                }
            }
        }
        for (family, row) in [("kriging", DEFAULT_METHOD), ("ssh12", "ssh12-stamp"), ("ridge", "ridge-vector")] {
            let alone = EnrichmentOptions::of_family(family, None, AXES);
            assert!(alone.is_some() && alone == EnrichmentOptions::named(row, AXES), "{family}");
        }
        assert_eq!(EnrichmentOptions::of_family("rescale", None, AXES), EnrichmentOptions::named("rescale", AXES));
        assert_eq!(EnrichmentOptions::of_family("kriging-stamp", None, AXES), None);
    }
}
