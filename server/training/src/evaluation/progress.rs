//! Progress of an evaluation.

use std::ops::ControlFlow;

/// The part of the work that begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EvaluationProgress<'a> {
    /// Parts done.
    pub done: usize,
    /// Parts in all.
    pub all: usize,
    /// Name of the part that begins.
    pub part: &'a str,
}

/// Observer of an evaluation: called before each part. `Break` ends the evaluation.
pub type EvaluationObserver<'a> = dyn FnMut(EvaluationProgress<'_>) -> ControlFlow<()> + Send + 'a;
