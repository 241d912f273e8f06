//! The solution of a case.

use nalgebra::Vector3;
use plica_accurate::Info;
use plica_accurate::contact::ContactInfo;
use serde::Serialize;

use super::tool_contact::ToolLoad;

/// A converged load step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadStep {
    /// Share of the loads at its end.
    pub load: f64,
    /// Newton steps.
    pub iterations: u32,
    /// Newton steps whose matrix was not positive definite.
    pub indefinite_steps: u32,
    /// Halvings by the line search.
    pub halvings: u32,
    /// Residual before every Newton step and at the end, as a share of the largest nodal force.
    pub residuals: Vec<f64>,
    /// Smallest `det F` of its result.
    pub smallest_jacobian: Option<f64>,
}

/// Stability of an equilibrium, by the signs of its tangent's eigenvalues.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stability {
    /// No eigenvalue is negative.
    Stable,
    /// So many are negative.
    Unstable(usize),
    /// The tangent is too near to a singular matrix to tell.
    Unknown,
}

impl Stability {
    pub(super) fn new(n_negative: Option<usize>) -> Self {
        match n_negative {
            Some(0) => Self::Stable,
            Some(n) => Self::Unstable(n),
            None => Self::Unknown,
        }
    }
}

/// An equilibrium under all loads.
#[derive(Debug, Clone)]
pub struct Solution {
    pub(super) x: Vec<Vector3<f64>>,
    /// Share of the loads that the body bears: 1 but at the end of an arc length.
    pub share: f64,
    /// Whether the equilibrium is stable.
    pub stability: Stability,
    /// Unstable equilibria that were left along their softest mode.
    pub n_left: u32,
    /// Shares of the loads at which these turned, by a parabola through three steps: limit points of an arc length.
    pub limit_loads: Vec<f64>,
    /// Load of each tool on the body.
    pub(super) tool_loads: Vec<ToolLoad>,
    /// Force of all tools on each node; empty without tools \[N\].
    pub(super) contact_forces: Vec<Vector3<f64>>,
    /// Converged load steps.
    pub steps: Vec<LoadStep>,
    /// Load steps that failed and were halved.
    pub n_failed: u32,
    /// Unknowns.
    pub n_unknowns: usize,
    /// Values of the Cholesky factor.
    pub n_factor_values: usize,
}

impl Solution {
    /// Positions of all nodes \[m\].
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.x
    }

    /// Newton steps of all converged load steps.
    pub fn iterations(&self) -> u32 {
        self.steps.iter().map(|step| step.iterations).sum()
    }

    /// Newton steps of them whose matrix was not positive definite.
    pub fn indefinite_steps(&self) -> u32 {
        self.steps.iter().map(|step| step.indefinite_steps).sum()
    }

    /// Smallest `det F` of the result.
    pub fn smallest_jacobian(&self) -> Option<f64> {
        self.steps.last().and_then(|step| step.smallest_jacobian)
    }
}

impl LoadStep {
    pub(super) fn new(load: f64, info: Info) -> Self {
        let Info { residuals, iterations, indefinite_steps, halvings, smallest_jacobian, .. } = info;
        Self { load, iterations, indefinite_steps, halvings, residuals, smallest_jacobian }
    }

    /// A step with contact; its history is that of the last solve alone.
    pub(super) fn of_contact(load: f64, info: &ContactInfo) -> Self {
        Self {
            load,
            iterations: info.newton_iterations,
            indefinite_steps: info.indefinite_steps,
            halvings: info.failed_increments,
            residuals: vec![info.residual],
            smallest_jacobian: info.smallest_jacobian,
        }
    }
}
