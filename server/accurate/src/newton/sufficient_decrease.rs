//! Sufficient decrease: acceptance test of a line search \[NW06, eq. 3.6a\].

use nalgebra::Vector3;

use crate::energy::Energy;

/// Smallest decrease of a step, as a share of the linear prediction \[NW06, eq. 3.6a\].
const SUFFICIENT_DECREASE: f64 = 1e-4;
/// Share of the energies below which their differences are rounding.
const ROUNDING: f64 = 1e-13;

/// Sum of energies and sum of their magnitudes \[J\].
#[derive(Debug, Clone, Copy)]
pub(super) struct Total {
    pub(super) value: f64,
    magnitude: f64,
}

impl Total {
    pub(super) fn of(energies: &[&dyn Energy], x: &[Vector3<f64>]) -> Self {
        let zero = Self { value: 0.0, magnitude: 0.0 };
        energies
            .iter()
            .map(|e| e.value(x))
            .fold(zero, |sum, value| Self { value: sum.value + value, magnitude: sum.magnitude + value.abs() })
    }
}

/// Start of a line search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    pub(super) total: Total,
    /// Derivative of the energy along the step \[J\].
    pub(super) slope: f64,
    /// Contribution of loads without a potential to the slope \[J\]: a line search holds their forces constant.
    pub(super) frozen_work: f64,
    /// Norm of the force at free coordinates \[N\].
    pub(super) norm: f64,
    pub(super) has_potential: bool,
}

/// Decision on a step length by energy differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Decision {
    Accept,
    Reject,
    /// The difference is rounding, or includes work of a load without a potential: forces decide.
    Undecided,
}

impl Start {
    pub(super) fn decide(&self, trial: &Total, length: f64) -> Decision {
        let rounding = ROUNDING * (self.total.magnitude + self.slope.abs());
        let change = trial.value - self.total.value + length * self.frozen_work;
        if !trial.value.is_finite() {
            Decision::Reject
        } else if change <= SUFFICIENT_DECREASE * length * self.slope {
            Decision::Accept
        } else if self.has_potential && change > rounding {
            Decision::Reject
        } else {
            Decision::Undecided
        }
    }
}
