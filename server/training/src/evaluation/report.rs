//! All methods on the same held-out states.

use std::ops::ControlFlow;

use plica_sim::enrichment::DEFAULT_METHOD;
use serde::{Deserialize, Serialize};

use super::degenerate::Degenerate;
use super::evaluator::{EvaluationError, Evaluator};
use super::method_evaluation::MethodEvaluation;
use super::methods::Method;
use super::progress::{EvaluationObserver, EvaluationProgress};
use super::slide::Slide;

/// Methods evaluated with fewer examples as well.
pub const WITH_FEWER: [&str; 3] = [DEFAULT_METHOD, "ssh12-blend", "ridge-vector"];
/// Numbers of examples.
pub const EXAMPLE_COUNTS: [usize; 4] = [16, 32, 64, 128];

/// All methods on the same held-out states.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Evaluation {
    /// Numbers of held-out states.
    pub held_out: Counts,
    /// The coarse skin, then every method with all examples.
    pub methods: Vec<MethodReport>,
    /// Some methods with fewer examples.
    pub by_examples: Vec<MethodEvaluation>,
    /// Along a slide, if it was asked for.
    pub slide: Option<Slide>,
    /// Name of the default method.
    pub default: String,
}

/// Numbers of states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Drawn as training draws.
    pub in_region: usize,
    /// All others.
    pub outside: usize,
    /// Left out, because their detail is below the threshold.
    pub left_out: usize,
}

/// A method on held-out states and on degenerate inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodReport {
    /// On held-out states.
    #[serde(flatten)]
    pub evaluation: MethodEvaluation,
    /// On degenerate inputs; the coarse skin has none.
    pub degenerate: Option<Degenerate>,
}

/// Evaluates `methods` with the first `n_examples` examples, and some of them with fewer.
///
/// # Errors
/// See [`EvaluationError`].
pub fn evaluate(
    evaluator: &Evaluator,
    methods: &[Method],
    n_examples: usize,
    observer: &mut EvaluationObserver<'_>,
) -> Result<Evaluation, EvaluationError> {
    let n_examples = n_examples.min(evaluator.n_examples());
    let with_fewer = methods.iter().filter(|m| WITH_FEWER.contains(&m.name.as_str()));
    let counts = EXAMPLE_COUNTS.into_iter().filter(|n| *n <= n_examples);
    let fewer: Vec<(&Method, usize)> = with_fewer.flat_map(|m| counts.clone().map(move |n| (m, n))).collect();
    let n_parts = methods.len() + fewer.len();
    let mut begin = |done, part: &str| match observer(EvaluationProgress { done, all: n_parts, part }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(EvaluationError::Interrupted),
    };
    let mut all = vec![MethodReport { evaluation: evaluator.coarse()?, degenerate: None }];
    for (done, method) in methods.iter().enumerate() {
        begin(done, &method.name)?;
        let evaluation = evaluator.evaluate(method, n_examples)?;
        all.push(MethodReport { evaluation, degenerate: Some(evaluator.degenerate(method, n_examples)?) });
    }
    let mut by_examples = Vec::new();
    for (done, (method, n)) in fewer.into_iter().enumerate() {
        begin(methods.len() + done, &format!("{} with {n} examples", method.name))?;
        by_examples.push(evaluator.evaluate(method, n)?);
    }
    let [in_region, outside] = evaluator.n_states();
    Ok(Evaluation {
        held_out: Counts { in_region, outside, left_out: evaluator.n_left_out() },
        methods: all,
        by_examples,
        slide: None,
        default: DEFAULT_METHOD.to_owned(),
    })
}
