//! Local part of the stable Neo-Hookean material \[SGK18\], finite for every `F`:
//! `2/3 mu (I_C - 3) - 2/3 mu ln((I_C + 1)/4) - mu (J - 1) + 5/12 mu (J - 1)^2`.
//!
//! With the volumetric part `lambda/2 (J - 1)^2` this is \[SGK18\] for `mu_s = 4/3 mu`, `lambda_s = lambda + 5/6 mu`,
//! `alpha = 1 + 3/4 mu_s/lambda_s`, less its value at rest: `lambda_s/2 (J - alpha)^2 = lambda_s/2 (J - 1)^2 - mu (J - 1) +
//! const`. So divided, the local part is stable by itself; with all of `lambda_s` in the volumetric part its bulk modulus at
//! rest would be `-mu/6`.

use super::Slopes;
use super::deformation::{Deformation, log_remainder};

/// `mu (q + 2/3 (i/4 - ln(1 + i/4)) + 5/12 j^2)`.
pub(super) fn value(mu: f64, deformation: &Deformation) -> f64 {
    let Deformation { i, j, q, .. } = *deformation;
    mu * (q + 2.0 / 3.0 * log_remainder(0.25 * i) + 5.0 / 12.0 * j * j)
}

/// `psi_I = 2/3 mu (1 - 1/(4 + i))`, `psi_J = -mu + 5/6 mu j`, `psi_II = 2/3 mu/(4 + i)^2`, `psi_JJ = 5/6 mu`,
/// `2 psi_I + psi_J = mu (i/(3 (4 + i)) + 5/6 j)`.
pub(super) fn slopes(mu: f64, deformation: &Deformation) -> Slopes {
    let Deformation { i, j, .. } = *deformation;
    let s = 4.0 + i;
    Slopes {
        by_i: 2.0 / 3.0 * mu * (1.0 - 1.0 / s),
        by_j: mu * (5.0 / 6.0 * j - 1.0),
        balance: mu * (i / (3.0 * s) + 5.0 / 6.0 * j),
        by_ii: 2.0 / 3.0 * mu / (s * s),
        by_ij: 0.0,
        by_jj: 5.0 / 6.0 * mu,
    }
}
