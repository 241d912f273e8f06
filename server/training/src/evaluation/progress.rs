//! Progress of an evaluation.

use std::ops::ControlFlow;

/// The part of the work that begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress<'a> {
    /// Parts done.
    pub done: usize,
    /// Parts in all.
    pub all: usize,
    /// Name of the part that begins.
    pub part: &'a str,
}

/// Called before each part; a break ends the work.
pub type Observer<'a> = dyn FnMut(Progress<'_>) -> ControlFlow<()> + 'a;
