//! Configurations that the chart compares.

use plica_scene::Config;
use plica_sim::ElementKind;
use plica_sim::enrichment::{FieldOptions, Precision};
use plica_training::Setup;
use plica_training::evaluation::{COARSE, DEFAULT_METHOD, EXAMPLE_COUNTS, Method, WITH_FEWER, methods};
use toml::Value;

/// Texels along a stamp's side.
const TEXELS: [usize; 4] = [8, 16, 32, 64];
/// Modes that stamps are compressed to.
const MODES: [usize; 4] = [8, 16, 32, 128];

/// One configuration to measure.
#[derive(Debug, Clone)]
pub(super) struct Configuration {
    /// Name of the point.
    pub(super) name: String,
    /// Parameter that is varied; one colour in the picture.
    pub(super) family: &'static str,
    /// Model and method.
    pub(super) what: What,
}

/// Another value of a key in a table of the object.
#[derive(Debug, Clone)]
pub(super) struct Change {
    pub(super) table: &'static str,
    pub(super) key: &'static str,
    pub(super) value: Value,
}

/// Model and method of a configuration.
#[derive(Debug, Clone)]
pub(super) enum What {
    /// The scene's coarse skin.
    Coarse,
    /// The scene's coarse model, enriched.
    Enriched {
        /// Method.
        method: Box<Method>,
        /// Number of training examples, from the first on.
        examples: usize,
    },
    /// Another coarse model: changes in the scene's `coarse` and `skin` tables.
    OtherCoarse(Vec<Change>),
}

pub(super) const FAMILIES: [&str; 6] =
    ["coarse model", "method", "number of examples", "stamp texels", "modes", "stored precision"];

impl Configuration {
    pub(super) fn is_other_coarse(&self) -> bool {
        matches!(self.what, What::OtherCoarse(_))
    }
}

/// All configurations; `quick` leaves out other coarse models.
pub(super) fn configurations(config: &Config, setup: &Setup, n_examples: usize, quick: bool) -> Vec<Configuration> {
    let [coarse, method, of_examples, texels, modes, precision] = FAMILIES;
    let mut all = vec![Configuration { name: COARSE.to_owned(), family: coarse, what: What::Coarse }];
    let mut add = |name: String, family, method: Method, examples| {
        let method = Box::new(Method { name: name.clone(), ..method });
        all.push(Configuration { name, family, what: What::Enriched { method, examples } });
    };
    let known = methods(setup.stamp_axes);
    known.iter().for_each(|m| add(m.name.clone(), method, m.clone(), n_examples));
    for m in known.iter().filter(|m| WITH_FEWER.contains(&m.name.as_str())) {
        let fewer = EXAMPLE_COUNTS.into_iter().filter(|n| *n < n_examples);
        fewer.for_each(|n| add(format!("{}, {n} examples", m.name), of_examples, m.clone(), n));
    }
    let default = known.iter().find(|m| m.name == DEFAULT_METHOD).expect("the default is a method");
    let own = default.options.field;
    let mut vary = |what: String, family, field: FieldOptions| {
        if field != own {
            let mut varied = default.clone();
            varied.options.field = field;
            add(format!("{DEFAULT_METHOD}, {what}"), family, varied, n_examples);
        }
    };
    TEXELS.into_iter().for_each(|n| vary(format!("{n} texels"), texels, FieldOptions { texels: n, ..own }));
    MODES.into_iter().for_each(|n| vary(format!("{n} modes"), modes, FieldOptions { modes: n, ..own }));
    for (name, stored) in [("f32", Precision::F32), ("i16", Precision::I16)] {
        vary(name.to_owned(), precision, FieldOptions { precision: stored, ..own });
    }
    if !quick {
        let others = other_models(config).into_iter();
        all.extend(others.map(|(name, changes)| Configuration {
            name: format!("{COARSE}, {name}"),
            family: coarse,
            what: What::OtherCoarse(changes),
        }));
    }
    all
}

/// Other coarse models: element, substeps, tolerance, embedding, divisions.
fn other_models(config: &Config) -> Vec<(String, Vec<Change>)> {
    let change = |table, key, value| Change { table, key, value };
    let object = config.object();
    let element = match object.element() {
        ElementKind::EnhancedStrain => "full_integration",
        ElementKind::FullIntegration => "enhanced_strain",
    };
    let divisions = |factor: f64| {
        let scaled = object.divisions().map(|n| ((factor * n as f64).round() as i64).max(1));
        let name = scaled.map(|n| n.to_string()).join("x");
        (name, vec![change("coarse", "divisions", Value::Array(scaled.map(Value::Integer).to_vec()))])
    };
    let substeps = i64::from(object.substeps()) * 2;
    let tolerance = 10.0 * object.solver().tolerance;
    let mut all = vec![
        (element.replace('_', " "), vec![change("coarse", "element", Value::String(element.to_owned()))]),
        (format!("{substeps} substeps"), vec![change("coarse", "substeps", Value::Integer(substeps))]),
        (format!("tolerance {tolerance:.0e}"), vec![change("coarse.solver", "tolerance", Value::Float(tolerance))]),
        ("trilinear embedding".to_owned(), vec![change("skin", "embedding", Value::String("trilinear".to_owned()))]),
    ];
    all.extend([0.75, 1.5, 2.0].map(divisions));
    all
}
