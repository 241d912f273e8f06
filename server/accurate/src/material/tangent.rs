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
        tangent.project(projection);
        tangent
    }

    /// Of an energy density `w(J)`, given `w'` and `w''`.
    pub(crate) fn of_volume(deformation: &Deformation, slope: f64, curvature: f64, projection: Projection) -> Self {
        let mut tangent = Self {
            f: deformation.f(),
            cofactor: deformation.cofactor(),
            factors: Factors {
                identity: 0.0,
                along_f: 0.0,
                along_both: 0.0,
                along_cofactor: curvature,
                curvature: slope,
            },
            transposition: 0.0,
            negative: NegativeModes::default(),
            fibres: None,
        };
        tangent.project(projection);
        tangent
    }

    fn project(&mut self, projection: Projection) {
        if projection == Projection::PositiveSemidefinite {
            self.negative = NegativeModes::new(&self.f, &self.factors);
        }
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
        self.block_of(&self.image(a), &self.image(b))
    }

    fn image(&self, gradient: &Vector3<f64>) -> Image {
        Image { gradient: *gradient, by_f: self.f * gradient, by_cofactor: self.cofactor * gradient }
    }

    fn block_of(&self, a: &Image, b: &Image) -> Matrix3<f64> {
        let w = self.f * a.gradient.cross(&b.gradient) * self.factors.curvature;
        // u . (v x w) = -u^T [w]_x v.
        let bend = Matrix3::new(0.0, w.z, -w.y, -w.z, 0.0, w.x, w.y, -w.x, 0.0);
        let mut block = Matrix3::from_diagonal_element(self.factors.identity * a.gradient.dot(&b.gradient))
            + a.by_f * b.by_f.transpose() * self.factors.along_f
            + a.by_cofactor * b.by_cofactor.transpose() * self.factors.along_cofactor
            + bend;
        if self.transposition != 0.0 {
            block += b.gradient * a.gradient.transpose() * self.transposition;
        }
        if !self.negative.is_empty() {
            block += self.negative.lift(&a.gradient, &b.gradient);
        }
        if self.factors.along_both != 0.0 {
            let mixed = a.by_f * b.by_cofactor.transpose() + a.by_cofactor * b.by_f.transpose();
            block += mixed * self.factors.along_both;
        }
        if let Some(fibres) = &self.fibres {
            block += fibres.block(&a.gradient, &b.gradient);
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
        let images = gradients.map(|gradient| self.image(&gradient));
        for a in 0..N {
            for b in 0..=a {
                blocks[a][b] += self.block_of(&images[a], &images[b]) * weight;
            }
        }
    }
}

/// A gradient with its products, which every block of it shares.
struct Image {
    gradient: Vector3<f64>,
    by_f: Vector3<f64>,
    by_cofactor: Vector3<f64>,
}
