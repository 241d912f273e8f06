//! Local part of the linear material, `mu eps : eps` with `eps = sym G`.

use nalgebra::Matrix3;

use super::deformation::Deformation;

pub(super) fn value(mu: f64, deformation: &Deformation) -> f64 {
    mu * strain(deformation).norm_squared()
}

/// `2 mu eps`.
pub(super) fn stress(mu: f64, deformation: &Deformation) -> Matrix3<f64> {
    strain(deformation) * (2.0 * mu)
}

/// Small strain `eps`.
pub(super) fn strain(deformation: &Deformation) -> Matrix3<f64> {
    (deformation.gradient + deformation.gradient.transpose()) * 0.5
}
