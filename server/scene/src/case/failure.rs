//! Failures of a solve.

use plica_accurate::SolveError;
use plica_accurate::contact::ContactError;

/// Why a load step has no equilibrium.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// Newton's method failed.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// Contact with the tools failed.
    #[error("contact with the tools: {0}")]
    Contact(#[from] ContactError),
}

/// Why the loads cannot be applied completely.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The smallest load step failed.
    #[error("no equilibrium beyond {reached:.4} of the loads: {error}, on the way to {target:.4}")]
    Stuck {
        /// Share of the loads with an equilibrium.
        reached: f64,
        /// Share of the failed step.
        target: f64,
        /// Error of the last attempt.
        error: StepError,
    },
    /// Ended by the observer, or out of memory.
    #[error(transparent)]
    Solve(#[from] StepError),
}

impl StepError {
    /// Whether smaller steps cannot help.
    pub(super) fn is_final(&self) -> bool {
        matches!(
            self,
            Self::Solve(SolveError::Cancelled { .. } | SolveError::Factor(_))
                | Self::Contact(
                    ContactError::Cancelled { .. } | ContactError::Solve { source: SolveError::Factor(_), .. }
                )
        )
    }
}
