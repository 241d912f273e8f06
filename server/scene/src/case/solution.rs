//! The solution of a case.

use nalgebra::Vector3;
use plica_accurate::Info;
use serde::Serialize;

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

/// An equilibrium under all loads.
#[derive(Debug, Clone)]
pub struct Solution {
    pub(super) x: Vec<Vector3<f64>>,
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
}
