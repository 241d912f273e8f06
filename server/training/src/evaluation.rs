//! Evaluation: every way to enrich on the same held-out states.
//!
//! `E = |d' - d| / |d|` with the enricher's `d'` and the accurate `d = s_a - s_c`, area-weighted RMS over the skin: 1 is the plain
//! coarse skin. It flatters a bad coarse model, so millimetres stand beside it, against both references.

mod degenerate;
mod judge;
mod measure;
mod methods;
mod other_coarse;
mod pareto;
mod prepared;
mod progress;
mod report;
mod slide;
mod statistics;
mod verdict;

pub use degenerate::Degenerate;
pub use judge::{COARSE, EvaluationError, Judge};
pub use measure::Group;
pub use methods::{Method, methods};
pub use other_coarse::{OtherCoarse, OtherCoarseError, other_coarse};
pub use pareto::pareto_front;
pub use plica_sim::enrichment::DEFAULT_METHOD;
pub use progress::{Observer, Progress};
pub use report::{Counts, EXAMPLE_COUNTS, Evaluation, Judgement, WITH_FEWER, evaluate};
pub use slide::{Roughness, Slide, SlideError, slide};
pub use statistics::{Quantiles, rank_correlation};
pub use verdict::Verdict;
