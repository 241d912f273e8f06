//! Hyperelastic materials: energy density, stress and tangent as functions of the deformation gradient.
//!
//! Every material is split in two. `psi(F; mu)`, its *local* part, is the material of the same `mu` with `lambda = 0`.
//! `U(J; lambda)`, its *volumetric* part, resists dilatation; a [`Solid`](crate::Solid) evaluates it at an element's mean
//! dilatation. In a homogeneous deformation the sum is the textbook material.

mod compressible_neo_hookean;
mod deformation;
mod linear;
mod modes;
mod stable_neo_hookean;
mod tangent;
mod volumetric;

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::energy::Projection;
pub(crate) use deformation::Deformation;
pub(crate) use tangent::Tangent;
pub(crate) use volumetric::Volumetric;

/// Material law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MaterialModel {
    /// `mu eps : eps + lambda/2 tr(eps)^2` with the small strain `eps = sym(F) - I`. Not invariant under rotations.
    Linear,
    /// `mu/2 (I_C - 3) - mu ln J + lambda/4 (J^2 - 1 - 2 ln J)` \[Wri08\]; infinite for `J <= 0`.
    CompressibleNeoHookean,
    /// `mu_s/2 (I_C - 3) + lambda_s/2 (J - alpha)^2 - mu_s/2 ln(I_C + 1)` \[SGK18\] with `mu_s = 4/3 mu`,
    /// `lambda_s = lambda + 5/6 mu`, `alpha = 1 + 3/4 mu_s / lambda_s`, less its value at rest; finite everywhere.
    StableNeoHookean,
}

/// An isotropic elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Material law.
    pub model: MaterialModel,
    /// Young's modulus at rest \[Pa\], positive.
    pub young_modulus_pa: f64,
    /// Poisson's ratio at rest, between -1 and 1/2.
    pub poisson_ratio: f64,
}

/// Lamé's parameters \[Pa\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lame {
    /// `lambda = E nu / ((1 + nu) (1 - 2 nu))`.
    pub lambda_pa: f64,
    /// Shear modulus `mu = E / (2 (1 + nu))`.
    pub mu_pa: f64,
}

/// Error of material parameters.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// Young's modulus is not positive and finite.
    #[error("Young's modulus is {young_modulus_pa} Pa, it must be positive and finite")]
    YoungModulus {
        /// Value \[Pa\].
        young_modulus_pa: f64,
    },
    /// Poisson's ratio is out of range.
    #[error("Poisson's ratio is {poisson_ratio}, it must lie between -1 and 0.5, both excluded")]
    PoissonRatio {
        /// Value.
        poisson_ratio: f64,
    },
}

impl Material {
    /// The material with the given Lamé parameters: `E = mu (3 lambda + 2 mu) / (lambda + mu)`,
    /// `nu = lambda / (2 (lambda + mu))`.
    pub fn from_lame(model: MaterialModel, lame: Lame) -> Self {
        let Lame { lambda_pa: lambda, mu_pa: mu } = lame;
        let young_modulus_pa = mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu);
        Self { model, young_modulus_pa, poisson_ratio: lambda / (2.0 * (lambda + mu)) }
    }

    /// Lamé's parameters.
    pub fn lame(&self) -> Lame {
        let (e, nu) = (self.young_modulus_pa, self.poisson_ratio);
        let mu_pa = e / (2.0 * (1.0 + nu));
        Lame { lambda_pa: 2.0 * mu_pa * nu / (1.0 - 2.0 * nu), mu_pa }
    }

    /// Checks that the stiffness at rest is positive definite.
    ///
    /// # Errors
    /// See [`MaterialError`].
    pub fn check(&self) -> Result<(), MaterialError> {
        let (young_modulus_pa, poisson_ratio) = (self.young_modulus_pa, self.poisson_ratio);
        if !(young_modulus_pa > 0.0 && young_modulus_pa.is_finite()) {
            return Err(MaterialError::YoungModulus { young_modulus_pa });
        }
        let is_in_range = poisson_ratio > -1.0 && poisson_ratio < 0.5;
        is_in_range.then_some(()).ok_or(MaterialError::PoissonRatio { poisson_ratio })
    }

    /// Energy per rest volume \[J/m^3\], 0 at rest; infinite where `F` is not admissible.
    pub fn energy_density(&self, f: &Matrix3<f64>) -> f64 {
        let law = Law::new(self);
        let deformation = Deformation::new(f - Matrix3::identity());
        law.local_value(&deformation) + law.volumetric_value(law.dilatation(&deformation))
    }

    /// First Piola-Kirchhoff stress `P = d psi / dF` \[Pa\]: force per rest area.
    pub fn first_piola_stress(&self, f: &Matrix3<f64>) -> Matrix3<f64> {
        let law = Law::new(self);
        let deformation = Deformation::new(f - Matrix3::identity());
        let pressure = law.volumetric(law.dilatation(&deformation)).slope;
        law.local_stress(&deformation) + law.dilatation_gradient(&deformation) * pressure
    }

    /// `dP / dF` \[Pa\], over `vec F` by columns; `projection` treats the local part and the curvature of `J` together, and
    /// leaves what is positive semi-definite as it is, bit for bit.
    pub fn tangent(&self, f: &Matrix3<f64>, projection: Projection) -> SMatrix<f64, 9, 9> {
        let law = Law::new(self);
        let deformation = Deformation::new(f - Matrix3::identity());
        let volumetric = law.volumetric(law.dilatation(&deformation));
        let tangent = Tangent::new(&law, &deformation, volumetric.slope, projection);
        let curvature = volumetric.curvature(projection);
        let gradient = law.dilatation_gradient(&deformation);
        let mut out = SMatrix::<f64, 9, 9>::zeros();
        for a in 0..3 {
            for b in 0..3 {
                let block =
                    tangent.block(&unit(a), &unit(b)) + curvature * gradient.column(a) * gradient.column(b).transpose();
                out.fixed_view_mut::<3, 3>(3 * a, 3 * b).copy_from(&block);
            }
        }
        out
    }
}

/// A material ready for evaluation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Law {
    pub(crate) model: MaterialModel,
    pub(crate) lambda: f64,
    pub(crate) mu: f64,
}

impl Law {
    pub(crate) fn new(material: &Material) -> Self {
        let Lame { lambda_pa, mu_pa } = material.lame();
        Self { model: material.model, lambda: lambda_pa, mu: mu_pa }
    }

    /// Argument of the volumetric part: `tr(F) - 3` of the linear material, `J - 1` of the others.
    pub(crate) fn dilatation(&self, deformation: &Deformation) -> f64 {
        match self.model {
            MaterialModel::Linear => deformation.gradient.trace(),
            _ => deformation.j,
        }
    }

    /// Its derivative by `F`.
    pub(crate) fn dilatation_gradient(&self, deformation: &Deformation) -> Matrix3<f64> {
        match self.model {
            MaterialModel::Linear => Matrix3::identity(),
            _ => deformation.cofactor(),
        }
    }

    /// `psi(F; mu)`, local part of the energy density.
    pub(crate) fn local_value(&self, deformation: &Deformation) -> f64 {
        match self.model {
            MaterialModel::Linear => linear::value(self.mu, deformation),
            MaterialModel::CompressibleNeoHookean => compressible_neo_hookean::value(self.mu, deformation),
            MaterialModel::StableNeoHookean => stable_neo_hookean::value(self.mu, deformation),
        }
    }

    /// `d psi / dF`.
    pub(crate) fn local_stress(&self, deformation: &Deformation) -> Matrix3<f64> {
        match self.model {
            MaterialModel::Linear => linear::stress(self.mu, deformation),
            _ => self.slopes(deformation).stress(deformation),
        }
    }

    /// Derivatives of the local part by the invariants; of the Neo-Hookean laws only.
    fn slopes(&self, deformation: &Deformation) -> Slopes {
        match self.model {
            MaterialModel::CompressibleNeoHookean => compressible_neo_hookean::slopes(self.mu, deformation),
            _ => stable_neo_hookean::slopes(self.mu, deformation),
        }
    }

    pub(crate) fn volumetric_value(&self, dilatation: f64) -> f64 {
        volumetric::value(self.model, self.lambda, dilatation)
    }

    pub(crate) fn volumetric(&self, dilatation: f64) -> Volumetric {
        volumetric::derivatives(self.model, self.lambda, dilatation)
    }
}

/// Derivatives of `psi(I_C, J)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slopes {
    /// `psi_I`.
    by_i: f64,
    /// `psi_J`.
    by_j: f64,
    /// `2 psi_I + psi_J`, 0 at rest, without the rounding of that sum.
    balance: f64,
    /// `psi_II`.
    by_ii: f64,
    /// `psi_JJ`.
    by_jj: f64,
}

impl Slopes {
    /// `P = 2 psi_I F + psi_J C = (2 psi_I + psi_J) F + psi_J (C - F)`, `C = cof F`.
    fn stress(&self, deformation: &Deformation) -> Matrix3<f64> {
        deformation.f() * self.balance + deformation.cofactor_less_f() * self.by_j
    }
}

fn unit(axis: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 })
}
