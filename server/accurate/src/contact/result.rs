//! Result, progress and errors of a press.

use nalgebra::Vector3;

use crate::newton::{Progress, SolveError};

/// Result of a press.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ContactInfo {
    /// Force on the tool \[N\].
    pub force_n: Vector3<f64>,
    /// Torque on the tool about its origin \[N m\].
    pub torque_nm: Vector3<f64>,
    /// Reference area of the points in contact \[m^2\].
    pub area_m2: f64,
    /// Points in contact.
    pub n_touching: usize,
    /// Deepest contact point inside the tool \[m\].
    pub max_penetration_m: f64,
    /// Error of complementarity: mean of `|g|` over the contact, weighted with the pressure \[m\].
    pub mean_gap_m: f64,
    /// Largest excess of a traction over `mu` times the point's pressure, as a share of the largest pressure.
    pub friction_excess: f64,
    /// Change of pressures and tractions in the last solve, as a share of the largest pressure.
    pub pressure_change: f64,
    /// Force left at a free coordinate, as a share of the largest nodal force.
    pub residual: f64,
    /// Increments solved.
    pub increments: u32,
    /// Increments that failed and were halved.
    pub failed_increments: u32,
    /// Solves between updates of multipliers.
    pub outer_iterations: u32,
    /// Newton steps.
    pub newton_iterations: u32,
    /// Newton steps whose matrix was not positive definite.
    pub indefinite_steps: u32,
    /// Smallest `det F` of the result, where an energy has one.
    pub smallest_jacobian: Option<f64>,
}

/// Progress, reported before every Newton step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactProgress {
    /// Share of the path at the end of the present increment.
    pub share: f64,
    /// Increments solved.
    pub increments: u32,
    /// Current Newton solve.
    pub newton: Progress,
}

/// Failure of a press. Positions and state are those of the last solved increment.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// Cancelled by the callback.
    #[error("cancelled at {:.0} % of the path", 100.0 * share)]
    Cancelled {
        /// Share of the path completed.
        share: f64,
    },
    /// A solve failed, even in small increments.
    #[error("at {:.0} % of the path, in an increment halved {halvings} times: {source}", 100.0 * share)]
    Solve {
        /// Share of the path completed.
        share: f64,
        /// Halvings.
        halvings: u32,
        /// Cause.
        source: SolveError,
    },
    /// Pressures and friction do not converge, even in small increments.
    #[error(
        "at {:.0} % of the path, in an increment halved {halvings} times: update {max_updates} still changes pressures by \
         {pressure_change:.1e} and tractions by {traction_change:.1e} of the largest pressure",
        100.0 * share
    )]
    Unsettled {
        /// Share of the path completed.
        share: f64,
        /// Halvings.
        halvings: u32,
        /// Last change of pressures.
        pressure_change: f64,
        /// Last change of tractions.
        traction_change: f64,
        /// Updates of the multipliers.
        max_updates: u32,
    },
}
