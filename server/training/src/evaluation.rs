//! Evaluation: every enrichment method on the same held-out states.
//!
//! `E = |d' - d| / |d|` with the enricher's `d'` and the accurate `d = s_a - s_c`, area-weighted RMS over the skin: 1 is the plain
//! coarse skin. It flatters a bad coarse model, so millimetres stand beside it, against both references.

mod degenerate;
mod evaluator;
mod measure;
mod method_evaluation;
mod methods;
mod other_coarse;
mod pareto;
mod prepared;
mod progress;
mod report;
mod slide;
mod statistics;

pub use degenerate::Degenerate;
pub use evaluator::{COARSE, EvaluationError, Evaluator};
pub use measure::Group;
pub use method_evaluation::MethodEvaluation;
pub use methods::{Method, methods};
pub use other_coarse::{OtherCoarse, OtherCoarseError, other_coarse};
pub use pareto::pareto_front;
pub use plica_sim::enrichment::DEFAULT_METHOD;
pub use progress::{EvaluationObserver, EvaluationProgress};
pub use report::{Counts, EXAMPLE_COUNTS, Evaluation, MethodReport, WITH_FEWER, evaluate};
pub use slide::{Roughness, Slide, SlideError, slide};
pub use statistics::{Quantiles, rank_correlation};
