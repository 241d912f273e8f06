//! How an accurate solve went.

use serde::{Deserialize, Serialize};

/// A result with an element below this `det F` is not stored.
pub const SMALLEST_JACOBIAN: f64 = 0.05;

/// How an accurate solve went.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolveInfo {
    /// Newton steps.
    pub iterations: u32,
    /// Newton steps whose matrix was not positive definite.
    pub indefinite_steps: u32,
    /// Largest force left at a free coordinate, as a share of the largest nodal force.
    pub residual: f64,
    /// Smallest `det F`.
    pub smallest_jacobian: f64,
}

impl SolveInfo {
    /// Whether an element is all but inverted.
    pub fn is_turned_over(&self) -> bool {
        self.smallest_jacobian < SMALLEST_JACOBIAN
    }

    /// Of this solve and the one that went on from it.
    pub fn followed_by(&self, next: &Self) -> Self {
        Self {
            iterations: self.iterations + next.iterations,
            indefinite_steps: self.indefinite_steps + next.indefinite_steps,
            ..*next
        }
    }
}
