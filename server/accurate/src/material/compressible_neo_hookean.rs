//! Local part of the compressible Neo-Hookean material, `mu/2 (I_C - 3) - mu ln J` \[Wri08\].

use super::Slopes;
use super::deformation::{Deformation, log_remainder};

/// `mu (i/2 - ln(1 + j)) = mu (q + j - ln(1 + j))`; infinite for `J <= 0`.
pub(super) fn value(mu: f64, deformation: &Deformation) -> f64 {
    let remainder = log_remainder(deformation.j);
    if remainder == f64::INFINITY { remainder } else { mu * (deformation.q + remainder) }
}

/// `psi_I = mu/2`, `psi_J = -mu/J`, `psi_JJ = mu/J^2`, `2 psi_I + psi_J = mu j/J`.
pub(super) fn slopes(mu: f64, deformation: &Deformation) -> Slopes {
    let j = deformation.jacobian();
    Slopes {
        by_i: 0.5 * mu,
        by_j: -mu / j,
        balance: mu * deformation.j / j,
        by_ii: 0.0,
        by_ij: 0.0,
        by_jj: mu / (j * j),
    }
}
