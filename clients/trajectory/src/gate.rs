//! The check that a caller passes for poses.

/// Check of a pose: maps tool, position \[m\] and orientation `xyzw` of a line to the normalised orientation, or to a sentence
/// why the line is refused.
pub trait Gate: Fn(Option<&str>, [f64; 3], [f64; 4]) -> Result<[f64; 4], String> {}

impl<F: Fn(Option<&str>, [f64; 3], [f64; 4]) -> Result<[f64; 4], String>> Gate for F {}
