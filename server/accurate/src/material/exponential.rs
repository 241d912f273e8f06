//! Local part of the exponential (Fung-type) material, `mu/(2 b) (exp(b Q) - 1)`, `Q = I_C - 3 - 2 ln J`.
//!
//! Without change of volume it is the law of \[Dem72\], `Q = I_C - 3`. The logarithm keeps `Q` of second order at rest, so that
//! `E` and `nu` there are those given, and convex in `(F, J)`: the exponential of it is polyconvex. As `b` goes to 0 the law
//! becomes the compressible Neo-Hookean one, whose volumetric part it shares.

use super::Slopes;
use super::deformation::{Deformation, log_remainder};

/// `mu/(2 b) (exp(b Q) - 1)`; infinite for `J <= 0` and where the exponential overflows.
pub(super) fn value(mu: f64, exponent: f64, deformation: &Deformation) -> f64 {
    mu / (2.0 * exponent) * (exponent * stretching(deformation)).exp_m1()
}

/// With `e = exp(b Q)`: `psi_I = mu e/2`, `psi_J = -mu e/J`, `psi_II = b mu e/2`, `psi_IJ = -b mu e/J`,
/// `psi_JJ = (1 + 2 b) mu e/J^2`, `2 psi_I + psi_J = mu e j/J`.
pub(super) fn slopes(mu: f64, exponent: f64, deformation: &Deformation) -> Slopes {
    let j = deformation.jacobian();
    let stiffened = mu * (exponent * stretching(deformation)).exp();
    Slopes {
        by_i: 0.5 * stiffened,
        by_j: -stiffened / j,
        balance: stiffened * deformation.j / j,
        by_ii: 0.5 * exponent * stiffened,
        by_ij: -exponent * stiffened / j,
        by_jj: (1.0 + 2.0 * exponent) * stiffened / (j * j),
    }
}

/// `Q = 2 (q + j - ln(1 + j))`.
fn stretching(deformation: &Deformation) -> f64 {
    let remainder = log_remainder(deformation.j);
    if remainder == f64::INFINITY { remainder } else { 2.0 * (deformation.q + remainder) }
}
