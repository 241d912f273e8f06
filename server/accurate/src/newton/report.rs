//! Parameters, progress, result and errors of a Newton solve.

use crate::factor::FactorError;

/// Stopping criteria.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Largest force left at a free coordinate, as a share of the largest nodal force of any single energy.
    pub tolerance: f64,
    /// Largest number of Newton steps.
    pub max_iterations: u32,
    /// Largest number of first steps that are taken in full, with stresses carried along linearly in the tangent, before the line
    /// search takes over from the start; 0 for the line search alone.
    pub max_full_steps: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self { tolerance: 1e-9, max_iterations: 100, max_full_steps: 0 }
    }
}

/// Statistics of a solve.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Info {
    /// Residual before every Newton step and at the end, as a share of the largest nodal force.
    pub residuals: Vec<f64>,
    /// Newton steps.
    pub iterations: u32,
    /// Steps whose matrix was not positive definite, so that the projected one was used.
    pub indefinite_steps: u32,
    /// Halvings of steps by the line search.
    pub halvings: u32,
    /// Steps taken in full that did not converge, so that the line search started anew.
    pub lost_steps: u32,
    /// Smallest `det F` of the result, where an energy has one.
    pub smallest_jacobian: Option<f64>,
}

/// Progress, reported before every Newton step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Newton steps taken.
    pub iteration: u32,
    /// Residual as a share of the largest nodal force.
    pub residual: f64,
}

/// Failure of a solve; `x` keeps its last iterate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// Too many steps.
    #[error(
        "residual {residual:.1e} of the largest force after {iterations} Newton steps, the tolerance is {tolerance:.1e}"
    )]
    NotConverged {
        /// Newton steps taken.
        iterations: u32,
        /// Residual left.
        residual: f64,
        /// Tolerance.
        tolerance: f64,
    },
    /// No step along the Newton direction helps.
    #[error("no step helps at residual {residual:.1e} of the largest force, after {iterations} Newton steps")]
    LineSearch {
        /// Newton steps taken.
        iterations: u32,
        /// Residual left.
        residual: f64,
    },
    /// The matrix cannot be made positive definite by any reasonable shift.
    #[error("the stiffness matrix is singular after {iterations} Newton steps: is the body held well enough?")]
    Singular {
        /// Newton steps taken.
        iterations: u32,
    },
    /// The starting point is not admissible, or holds a number that is not finite.
    #[error("the energy is not finite after {iterations} Newton steps: inverted elements, or a load beyond reason")]
    NotFinite {
        /// Newton steps taken.
        iterations: u32,
    },
    /// Cancelled by the callback.
    #[error("cancelled after {iterations} Newton steps")]
    Cancelled {
        /// Newton steps taken.
        iterations: u32,
    },
    /// No memory.
    #[error(transparent)]
    Factor(#[from] FactorError),
}

impl SolveError {
    /// Residual left, where it is known.
    pub fn residual(&self) -> Option<f64> {
        match self {
            Self::NotConverged { residual, .. } | Self::LineSearch { residual, .. } => Some(*residual),
            _ => None,
        }
    }
}
