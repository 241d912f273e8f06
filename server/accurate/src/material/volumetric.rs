//! Volumetric part of a material as a function of the dilatation `j`: `tr(F) - 3` of the linear one, `J - 1` of the others.
//! The exponential and the fibre-reinforced material have that of the compressible Neo-Hookean one.

use super::MaterialModel;
use super::deformation::log_remainder;
use crate::energy::Projection;

/// Derivatives of the volumetric part.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Volumetric {
    /// `U'`: mean pressure, positive in tension \[Pa\].
    pub(crate) slope: f64,
    /// `U''` \[Pa\].
    curvature: f64,
    may_clamp: bool,
}

impl Volumetric {
    /// `U''`, not below 0 in a projected Hessian. (The linear material keeps its sign: its element is positive semi-definite
    /// as a whole.)
    pub(crate) fn curvature(&self, projection: Projection) -> f64 {
        if self.may_clamp && projection == Projection::PositiveSemidefinite {
            self.curvature.max(0.0)
        } else {
            self.curvature
        }
    }
}

/// `lambda/2 j^2`, or `lambda/4 (J^2 - 1 - 2 ln J) = lambda/4 (j^2 + 2 (j - ln(1 + j)))`, infinite for `J <= 0`.
pub(super) fn value(model: MaterialModel, lambda: f64, j: f64) -> f64 {
    if matches!(model, MaterialModel::Linear | MaterialModel::StableNeoHookean) {
        return 0.5 * lambda * j * j;
    }
    let remainder = log_remainder(j);
    if remainder == f64::INFINITY { remainder } else { 0.25 * lambda * (j * j + 2.0 * remainder) }
}

/// `lambda j` and `lambda`, or `lambda/2 (J - 1/J) = lambda/2 j (2 + j)/J` and `lambda/2 (1 + 1/J^2)`.
pub(super) fn derivatives(model: MaterialModel, lambda: f64, j: f64) -> Volumetric {
    let may_clamp = model != MaterialModel::Linear;
    if matches!(model, MaterialModel::Linear | MaterialModel::StableNeoHookean) {
        return Volumetric { slope: lambda * j, curvature: lambda, may_clamp };
    }
    let jacobian = 1.0 + j;
    let slope = 0.5 * lambda * j * (2.0 + j) / jacobian;
    Volumetric { slope, curvature: 0.5 * lambda * (1.0 + 1.0 / (jacobian * jacobian)), may_clamp }
}
