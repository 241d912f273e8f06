//! Fibres of the transversely isotropic material: springs along one direction in a compressible Neo-Hookean matrix,
//! `W_f = k/2 (lambda_f - 1)^2` with the fibre stretch `lambda_f = |F a|`.

use nalgebra::{Matrix3, Vector3};

use super::deformation::Deformation;
use crate::energy::Projection;

/// Fibre family of a transversely isotropic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fibres {
    /// Young's modulus along the fibres at rest \[Pa\]; at least that across them.
    pub young_modulus_pa: f64,
    /// Direction at rest; of any length but 0.
    pub direction: Vector3<f64>,
}

/// Fibres ready for evaluation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FibreLaw {
    /// `k` \[Pa\].
    stiffness: f64,
    /// `a`, of unit length.
    direction: Vector3<f64>,
}

/// `d^2 W_f/dF^2 [u g^T, v h^T] = (a . g)(a . h) u^T curvature v`.
#[derive(Debug, Clone, Copy)]
pub(super) struct FibreTangent {
    direction: Vector3<f64>,
    curvature: Matrix3<f64>,
}

impl Fibres {
    /// Young's modulus of the matrix \[Pa\]. Pulled along the fibres, matrix and fibres act side by side and the matrix alone
    /// contracts: `E_f = E_m + k`. Pulled across, the fibres hold back the contraction along them: `1/E = (1 - nu^2 k/E_f)/E_m`.
    /// Hence `E_m = E (1 - nu^2)/(1 - nu^2 E/E_f)`.
    pub(super) fn matrix_modulus_pa(&self, across_pa: f64, poisson_ratio: f64) -> f64 {
        let square = poisson_ratio * poisson_ratio;
        across_pa * (1.0 - square) / (1.0 - square * across_pa / self.young_modulus_pa)
    }

    /// The law of the fibres in a matrix of the given modulus \[Pa\].
    pub(super) fn law(&self, matrix_modulus_pa: f64) -> FibreLaw {
        FibreLaw { stiffness: self.young_modulus_pa - matrix_modulus_pa, direction: self.direction.normalize() }
    }
}

impl FibreLaw {
    /// `F a` and `lambda_f - 1 = e/(1 + sqrt(1 + e))`, `e = |F a|^2 - 1 = 2 a . G a + |G a|^2`.
    fn stretch(&self, deformation: &Deformation) -> (Vector3<f64>, f64) {
        let moved = deformation.gradient * self.direction;
        let excess = 2.0 * self.direction.dot(&moved) + moved.norm_squared();
        (self.direction + moved, excess / (1.0 + (1.0 + excess).max(0.0).sqrt()))
    }

    pub(super) fn value(&self, deformation: &Deformation) -> f64 {
        0.5 * self.stiffness * self.stretch(deformation).1.powi(2)
    }

    /// `k (lambda_f - 1) n a^T` with `n = F a/lambda_f`; 0 where the fibre has no length.
    pub(super) fn stress(&self, deformation: &Deformation) -> Matrix3<f64> {
        let (along, strain) = self.stretch(deformation);
        let unit = along.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        unit * (self.stiffness * strain) * self.direction.transpose()
    }

    /// `k n n^T + k (1 - 1/lambda_f) (I - n n^T)`; projected without the second term where the fibre is shorter than at rest.
    pub(super) fn tangent(&self, deformation: &Deformation, projection: Projection) -> FibreTangent {
        let (along, strain) = self.stretch(deformation);
        let unit = along.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        let length = along.norm().max(f64::MIN_POSITIVE);
        let turning = match projection {
            Projection::PositiveSemidefinite => (strain / length).max(0.0),
            // Beyond this the curvature of a fibre of no length has no use.
            Projection::Exact => (strain / length).max(-1.0 / f64::EPSILON),
        };
        let across = Matrix3::identity() - unit * unit.transpose();
        let curvature = (unit * unit.transpose() + across * turning) * self.stiffness;
        FibreTangent { direction: self.direction, curvature }
    }
}

impl FibreTangent {
    pub(super) fn block(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Matrix3<f64> {
        self.curvature * (self.direction.dot(a) * self.direction.dot(b))
    }
}
