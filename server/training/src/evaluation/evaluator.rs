//! Evaluates enrichment methods on held-out states.

use nalgebra::Point3;
use plica_geometry::ReferenceSkin;
use plica_sim::enrichment::{Enricher, EnricherError, Examples, Touch};
use plica_sim::{Model, ModelError};

use super::measure::Patch;
use super::method_evaluation::{EvaluatedMethod, EvaluatedState, MethodEvaluation};
use super::methods::Method;
use super::prepared::{Outcome, Prepared};
use crate::database::Database;
use crate::obstacle::radius_m;
use crate::setup::{IN_REGION, Setup};

/// Name of the skin without enrichment.
pub const COARSE: &str = "coarse";
/// Least RMS of the detail; states below it are left out \[m\].
const LEAST_DETAIL_M: f64 = 2e-5;
/// Radius of the skin near the contact, in tool radii.
const NEAR_RADII: f64 = 3.0;

/// Why nothing can be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum EvaluationError {
    /// The coarse model cannot be built.
    #[error("coarse model")]
    Model(#[from] ModelError),
    /// A method cannot be prepared.
    #[error("method `{method}`")]
    Method {
        /// Its name.
        method: String,
        /// Why.
        source: EnricherError,
    },
    /// A held-out state belongs to another model.
    #[error("held-out example {index}: {found} {what}, the scene has {expected}")]
    Length {
        /// Its number.
        index: u32,
        /// Which array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The scene's.
        expected: usize,
    },
    /// Ended by the observer.
    #[error("interrupted")]
    Interrupted,
    /// No held-out example can be used.
    #[error(
        "none of {n} held-out examples lies in the trained region and has detail of {least_mm} mm or more",
        least_mm = 1e3 * LEAST_DETAIL_M
    )]
    NothingInRegion {
        /// Held-out examples.
        n: usize,
    },
}

/// Held-out states, and the examples that methods are trained on.
pub struct Evaluator {
    model: Model,
    whole: Patch,
    states: Vec<HeldOut>,
    left_out: usize,
    examples: Examples,
}

struct HeldOut {
    kind: String,
    displacements: Vec<[f32; 3]>,
    touch: Touch,
    near: Patch,
    tied: Vec<[f32; 3]>,
    independent: Option<Vec<[f32; 3]>>,
}

impl Evaluator {
    /// Prepares the states of `held_out` and the examples of `training`.
    ///
    /// # Errors
    /// See [`EvaluationError`].
    pub fn new(setup: &Setup, training: &Database, held_out: &Database) -> Result<Self, EvaluationError> {
        let model = Model::new(setup.coarse.clone())?;
        let skin = ReferenceSkin::new(&setup.coarse.skin);
        let areas = skin.vertex_areas();
        let whole = Patch::new(areas, |_| true);
        let mut states = Vec::new();
        for e in &held_out.examples {
            let nodes = ("nodes", e.displacements.len(), model.n_nodes());
            for (what, found, expected) in [nodes, ("skin vertices", e.detail.len(), model.n_skin())] {
                if found != expected {
                    return Err(EvaluationError::Length { index: e.record.index, what, found, expected });
                }
            }
            if whole.rms(&e.detail, None) < LEAST_DETAIL_M {
                continue;
            }
            let reach = NEAR_RADII * radius_m(&setup.coarse.tools[e.record.tool as usize].shape);
            let contact = Point3::from(e.contact_point);
            states.push(HeldOut {
                kind: e.record.kind.clone(),
                displacements: e.displacements.clone(),
                touch: e.touch(),
                near: Patch::new(areas, |v| (skin.skin().positions()[v] - contact).norm() <= reach),
                tied: e.detail.clone(),
                independent: e.independent_detail.clone(),
            });
        }
        let n = held_out.examples.len();
        if !states.iter().any(|s| s.kind == IN_REGION) {
            return Err(EvaluationError::NothingInRegion { n });
        }
        Ok(Self { model, whole, left_out: n - states.len(), states, examples: training.leading_examples(usize::MAX) })
    }

    /// Numbers of states in the trained region and outside of it.
    pub fn n_states(&self) -> [usize; 2] {
        let inside = self.states.iter().filter(|s| s.kind == IN_REGION).count();
        [inside, self.states.len() - inside]
    }

    /// Held-out examples left out, because their detail is below the threshold.
    pub fn n_left_out(&self) -> usize {
        self.left_out
    }

    /// Number of training examples.
    pub fn n_examples(&self) -> usize {
        self.examples.touches.len()
    }

    /// The first `n` training examples.
    pub(super) fn examples(&self, n: usize) -> Examples {
        let n = n.min(self.n_examples());
        Examples {
            displacements: self.examples.displacements[..n].to_vec(),
            details: self.examples.details[..n].to_vec(),
            touches: self.examples.touches[..n].to_vec(),
        }
    }

    /// Builds the enricher of a method and its scratch memory.
    pub(super) fn prepare(&self, method: &Method, examples: &Examples) -> Result<Prepared<'_>, EvaluationError> {
        let failed = |source| EvaluationError::Method { method: method.name.clone(), source };
        let enricher = Enricher::new(&self.model, examples, method.options).map_err(failed)?;
        Ok(Prepared::new(&self.model, enricher))
    }

    /// Area-weighted RMS over the skin \[m\].
    pub(super) fn rms(&self, detail: &[[f32; 3]]) -> f64 {
        self.whole.rms(detail, None)
    }

    /// Largest length over the skin \[m\].
    pub(super) fn largest(&self, detail: &[[f32; 3]]) -> f64 {
        self.whole.largest(detail, None)
    }

    /// `E` of `detail` against `tied`; `None` where `tied` is below the threshold.
    pub(super) fn ratio(&self, detail: &[[f32; 3]], tied: &[[f32; 3]]) -> Option<f64> {
        let own = self.rms(tied);
        (own >= LEAST_DETAIL_M).then(|| self.whole.rms(detail, Some(tied)) / own)
    }

    /// Evaluates `method`, trained on the first `n_examples` examples, on all states.
    ///
    /// # Errors
    /// [`EvaluationError::Method`].
    pub fn evaluate(&self, method: &Method, n_examples: usize) -> Result<MethodEvaluation, EvaluationError> {
        self.evaluate_with(method, &self.examples(n_examples))
    }

    pub(super) fn evaluate_with(
        &self,
        method: &Method,
        examples: &Examples,
    ) -> Result<MethodEvaluation, EvaluationError> {
        let mut prepared = self.prepare(method, examples)?;
        let states = self.run(|s| prepared.evaluate_timed(&s.displacements, &s.touch));
        let evaluated = EvaluatedMethod {
            name: &method.name,
            correlator: method.correlator(),
            interpolator: method.interpolator(),
            n_examples: examples.touches.len(),
            table_bytes: prepared.table_bytes(),
        };
        let nothing = || EvaluationError::NothingInRegion { n: self.states.len() };
        MethodEvaluation::of(&evaluated, &states).ok_or_else(nothing)
    }

    /// The skin without enrichment: `E` is 1, the errors in millimetres are those of the coarse model.
    ///
    /// # Errors
    /// [`EvaluationError::NothingInRegion`].
    pub fn coarse(&self) -> Result<MethodEvaluation, EvaluationError> {
        let nothing = vec![[0.0; 3]; self.model.n_skin()];
        let states = self.run(|_| Outcome { detail: nothing.clone(), confidence: 0.0, time_us: 0.0 });
        let no_state = || EvaluationError::NothingInRegion { n: self.states.len() };
        let evaluated =
            EvaluatedMethod { name: COARSE, correlator: "none", interpolator: "none", n_examples: 0, table_bytes: 0 };
        MethodEvaluation::of(&evaluated, &states).ok_or_else(no_state)
    }

    fn run(&self, mut outcome: impl FnMut(&HeldOut) -> Outcome) -> Vec<EvaluatedState<'_>> {
        let evaluate = |state| {
            let Outcome { detail, confidence, time_us } = outcome(state);
            let independent = state.independent.as_deref();
            let whole = self.whole.measure(&detail, &state.tied, independent)?;
            let near = state.near.measure(&detail, &state.tied, independent);
            Some(EvaluatedState { kind: &state.kind, whole, near, confidence, time_us })
        };
        self.states.iter().filter_map(evaluate).collect()
    }
}
