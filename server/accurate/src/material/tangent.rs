//! Second derivatives of the local part, with the curvature of `J` under a mean pressure.

use nalgebra::{Matrix3, Vector3};

use super::deformation::Deformation;
use super::fibres::FibreTangent;
use super::modes::{Factors, NegativeModes};
use super::{Law, MaterialModel};
use crate::energy::Projection;

/// `d^2 psi / dF^2 + p d^2 J / dF^2`, given by its action on rank-one variations `dF = v g^T`. With `C = cof F`:
///
/// `H = 2 psi_I 1 + 4 psi_II F (x) F + 2 psi_IJ (F (x) C + C (x) F) + psi_JJ C (x) C + (psi_J + p) d^2 J`, `d^2 J [u a^T, v b^T] = u . (v x F (a x b))`.
///
/// Fibres add theirs. Projected, `-eta Q (x) Q` is added for every eigenvalue `eta < 0` with its eigenmatrix `Q` \[SGK19\].
pub(crate) struct Tangent {
    f: Matrix3<f64>,
    cofactor: Matrix3<f64>,
    factors: Factors,
    /// Factor of the transposition `dF -> dF^T` (linear material).
    transposition: f64,
    negative: NegativeModes,
    fibres: Option<FibreTangent>,
}

impl Tangent {
    pub(crate) fn new(law: &Law, deformation: &Deformation, pressure: f64, projection: Projection) -> Self {
        if law.model == MaterialModel::Linear {
            return Self::linear(law.mu, law.local_lambda);
        }
        let slopes = law.slopes(deformation);
        let mut tangent = Self {
            f: deformation.f(),
            cofactor: deformation.cofactor(),
            factors: Factors {
                identity: 2.0 * slopes.by_i,
                along_f: 4.0 * slopes.by_ii,
                along_both: 2.0 * slopes.by_ij,
                along_cofactor: slopes.by_jj,
                curvature: slopes.by_j + pressure,
            },
            transposition: 0.0,
            negative: NegativeModes::default(),
            fibres: law.fibres.map(|fibres| fibres.tangent(deformation, projection)),
        };
        if projection == Projection::PositiveSemidefinite {
            tangent.negative = NegativeModes::new(&tangent.f, &tangent.factors);
        }
        tangent
    }

    /// `2 mu sym + lambda I (x) I`, `lambda` of the local part: positive semi-definite, and the trace is linear in `F`.
    fn linear(mu: f64, lambda: f64) -> Self {
        Self {
            f: Matrix3::identity(),
            cofactor: Matrix3::identity(),
            factors: Factors { identity: mu, along_cofactor: lambda, ..Factors::default() },
            transposition: mu,
            negative: NegativeModes::default(),
            fibres: None,
        }
    }

    /// `B` with `u^T B v = H[u a^T, v b^T]`.
    pub(crate) fn block(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Matrix3<f64> {
        let (f, c) = (&self.f, &self.cofactor);
        let factors = &self.factors;
        let w = f * a.cross(b) * factors.curvature;
        // u . (v x w) = -u^T [w]_x v.
        let bend = Matrix3::new(0.0, w.z, -w.y, -w.z, 0.0, w.x, w.y, -w.x, 0.0);
        let mut block = Matrix3::from_diagonal_element(factors.identity * a.dot(b))
            + f * a * (f * b).transpose() * factors.along_f
            + c * a * (c * b).transpose() * factors.along_cofactor
            + bend
            + b * a.transpose() * self.transposition
            + self.negative.lift(a, b);
        if factors.along_both != 0.0 {
            block += (f * a * (c * b).transpose() + c * a * (f * b).transpose()) * factors.along_both;
        }
        if let Some(fibres) = &self.fibres {
            block += fibres.block(a, b);
        }
        block
    }

    /// Adds `weight` times [`Tangent::block`] of every pair of gradients to `blocks[a][b]`, `b <= a`.
    pub(crate) fn add_blocks<const N: usize>(
        &self,
        gradients: &[Vector3<f64>; N],
        weight: f64,
        blocks: &mut [[Matrix3<f64>; N]; N],
    ) {
        for a in 0..N {
            for b in 0..=a {
                blocks[a][b] += self.block(&gradients[a], &gradients[b]) * weight;
            }
        }
    }
}
