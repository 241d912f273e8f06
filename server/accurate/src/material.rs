//! Hyperelastic materials: energy density, stress and tangent as functions of the deformation gradient.
//!
//! Every material is split in two. `psi(F; mu)`, its *local* part, is the material of the same `mu` with `lambda = 0`.
//! `U(J; lambda)`, its *volumetric* part, resists dilatation; a [`Solid`](crate::Solid) evaluates it at an element's mean
//! dilatation. In a homogeneous deformation the sum is the textbook material.

mod compressible_neo_hookean;
mod deformation;
mod exponential;
mod fibres;
mod linear;
mod modes;
mod stable_neo_hookean;
mod tangent;
mod volumetric;

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::energy::Projection;
pub(crate) use deformation::Deformation;
use fibres::FibreLaw;
pub use fibres::Fibres;
pub(crate) use tangent::Tangent;
pub(crate) use volumetric::Volumetric;

/// Material law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MaterialModel {
    /// `mu eps : eps + lambda/2 tr(eps)^2` with the small strain `eps = sym(F) - I`. Not invariant under rotations.
    Linear,
    /// `mu/2 (I_C - 3) - mu ln J + lambda/4 (J^2 - 1 - 2 ln J)` \[Wri08\]; infinite for `J <= 0`.
    CompressibleNeoHookean,
    /// `mu_s/2 (I_C - 3) + lambda_s/2 (J - alpha)^2 - mu_s/2 ln(I_C + 1)` \[SGK18\] with `mu_s = 4/3 mu`,
    /// `lambda_s = lambda + 5/6 mu`, `alpha = 1 + 3/4 mu_s / lambda_s`, less its value at rest; finite everywhere.
    StableNeoHookean,
    /// `mu/(2 b) (exp(b (I_C - 3 - 2 ln J)) - 1) + lambda/4 (J^2 - 1 - 2 ln J)`, which stiffens as soft tissue does \[Dem72\];
    /// infinite for `J <= 0`.
    Exponential {
        /// `b`, positive; the law is that of `CompressibleNeoHookean` where it tends to 0.
        exponent: f64,
    },
    /// Compressible Neo-Hookean with fibres, `k/2 (|F a| - 1)^2` more along their direction `a`: transversely isotropic.
    FibreReinforced(Fibres),
}

/// An elastic material; isotropic without fibres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Material law.
    pub model: MaterialModel,
    /// Young's modulus at rest \[Pa\], positive; across the fibres where there are any.
    pub young_modulus_pa: f64,
    /// Poisson's ratio at rest, between -1 and 1/2; with fibres the contraction across them over the extension along them.
    pub poisson_ratio: f64,
}

/// Lamé's parameters \[Pa\]; with fibres those of the matrix.
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
    /// The exponent is not positive and finite.
    #[error("the exponent is {exponent}, it must be positive and finite")]
    Exponent {
        /// Value.
        exponent: f64,
    },
    /// Young's modulus along the fibres is below that across them, or not finite.
    #[error(
        "Young's modulus along the fibres is {along_pa} Pa, it must be finite and at least that across them, {across_pa} Pa"
    )]
    FibreModulus {
        /// Along the fibres \[Pa\].
        along_pa: f64,
        /// Across them \[Pa\].
        across_pa: f64,
    },
    /// The fibre direction has no length.
    #[error("the fibre direction [{}, {}, {}] has no length", direction[0], direction[1], direction[2])]
    FibreDirection {
        /// Value.
        direction: [f64; 3],
    },
}

impl Material {
    /// The material with the given Lamé parameters, which are not those of a matrix with fibres: `E = mu (3 lambda + 2 mu) / (lambda + mu)`,
    /// `nu = lambda / (2 (lambda + mu))`.
    pub fn from_lame(model: MaterialModel, lame: Lame) -> Self {
        let Lame { lambda_pa: lambda, mu_pa: mu } = lame;
        let young_modulus_pa = mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu);
        Self { model, young_modulus_pa, poisson_ratio: lambda / (2.0 * (lambda + mu)) }
    }

    /// Lamé's parameters.
    pub fn lame(&self) -> Lame {
        let (e, nu) = (self.matrix_modulus_pa(), self.poisson_ratio);
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
        is_in_range.then_some(()).ok_or(MaterialError::PoissonRatio { poisson_ratio })?;
        self.check_model()
    }

    fn check_model(&self) -> Result<(), MaterialError> {
        match self.model {
            MaterialModel::Exponential { exponent } if !(exponent > 0.0 && exponent.is_finite()) => {
                Err(MaterialError::Exponent { exponent })
            }
            MaterialModel::FibreReinforced(Fibres { young_modulus_pa: along_pa, direction }) => {
                let across_pa = self.young_modulus_pa;
                if !(along_pa >= across_pa && along_pa.is_finite()) {
                    return Err(MaterialError::FibreModulus { along_pa, across_pa });
                }
                let has_length = direction.norm() > f64::MIN_POSITIVE && direction.norm().is_finite();
                has_length.then_some(()).ok_or(MaterialError::FibreDirection { direction: direction.into() })
            }
            _ => Ok(()),
        }
    }

    /// Young's modulus without fibres \[Pa\].
    fn matrix_modulus_pa(&self) -> f64 {
        match self.model {
            MaterialModel::FibreReinforced(fibres) => {
                fibres.matrix_modulus_pa(self.young_modulus_pa, self.poisson_ratio)
            }
            _ => self.young_modulus_pa,
        }
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
    ///
    /// Compressed fibres are projected by themselves.
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
    /// `lambda` of the volumetric part.
    pub(crate) lambda: f64,
    pub(crate) mu: f64,
    /// `lambda` of a second `U` that belongs to the local part.
    local_lambda: f64,
    fibres: Option<FibreLaw>,
}

/// Largest `lambda / mu` of a local part: that of Poisson's ratio 1/3.
const LARGEST_LOCAL_RATIO: f64 = 2.0;

impl Law {
    pub(crate) fn new(material: &Material) -> Self {
        let Lame { lambda_pa, mu_pa } = material.lame();
        let fibres = match material.model {
            MaterialModel::FibreReinforced(fibres) => Some(fibres.law(material.matrix_modulus_pa())),
            _ => None,
        };
        Self { model: material.model, lambda: lambda_pa, mu: mu_pa, local_lambda: 0.0, fibres }
    }

    /// With `U` at every Gauss point as far as it is no stiffer than at Poisson's ratio 1/3, and the rest of it at an element's
    /// mean dilatation. Elements of second order need the former for their order, and the latter against locking.
    pub(crate) fn divided(material: &Material) -> Self {
        let whole = Self::new(material);
        let local_lambda = whole.lambda.min(LARGEST_LOCAL_RATIO * whole.mu);
        Self { lambda: whole.lambda - local_lambda, local_lambda, ..whole }
    }

    /// Whether two laws have the same constants; directions of fibres may differ.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        let constants = |law: &Self| (law.mu, law.lambda, law.local_lambda, std::mem::discriminant(&law.model));
        constants(self) == constants(other)
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
        let value = self.distortion_value(deformation);
        if self.local_lambda == 0.0 {
            return value;
        }
        value + volumetric::value(self.model, self.local_lambda, self.dilatation(deformation))
    }

    fn distortion_value(&self, deformation: &Deformation) -> f64 {
        match self.model {
            MaterialModel::Linear => linear::value(self.mu, deformation),
            MaterialModel::CompressibleNeoHookean => compressible_neo_hookean::value(self.mu, deformation),
            MaterialModel::StableNeoHookean => stable_neo_hookean::value(self.mu, deformation),
            MaterialModel::Exponential { exponent } => exponential::value(self.mu, exponent, deformation),
            MaterialModel::FibreReinforced(_) => {
                let fibres = self.fibres.map_or(0.0, |fibres| fibres.value(deformation));
                compressible_neo_hookean::value(self.mu, deformation) + fibres
            }
        }
    }

    /// `d psi / dF`.
    pub(crate) fn local_stress(&self, deformation: &Deformation) -> Matrix3<f64> {
        match self.model {
            MaterialModel::Linear => {
                let pressure = self.local_lambda * deformation.gradient.trace();
                linear::stress(self.mu, deformation) + Matrix3::from_diagonal_element(pressure)
            }
            _ => {
                let isotropic = self.slopes(deformation).stress(deformation);
                self.fibres.map_or(isotropic, |fibres| isotropic + fibres.stress(deformation))
            }
        }
    }

    /// Derivatives of the local part by the invariants, without fibres; not of the linear material.
    fn slopes(&self, deformation: &Deformation) -> Slopes {
        let mut slopes = self.distortion_slopes(deformation);
        if self.local_lambda != 0.0 {
            slopes.add(volumetric::derivatives(self.model, self.local_lambda, deformation.j));
        }
        slopes
    }

    fn distortion_slopes(&self, deformation: &Deformation) -> Slopes {
        match self.model {
            MaterialModel::Exponential { exponent } => exponential::slopes(self.mu, exponent, deformation),
            MaterialModel::StableNeoHookean => stable_neo_hookean::slopes(self.mu, deformation),
            _ => compressible_neo_hookean::slopes(self.mu, deformation),
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
    /// `psi_IJ`.
    by_ij: f64,
    /// `psi_JJ`.
    by_jj: f64,
}

impl Slopes {
    /// Adds a function of `J`.
    fn add(&mut self, volumetric: Volumetric) {
        self.by_j += volumetric.slope;
        self.balance += volumetric.slope;
        self.by_jj += volumetric.curvature(Projection::Exact);
    }

    /// `P = 2 psi_I F + psi_J C = (2 psi_I + psi_J) F + psi_J (C - F)`, `C = cof F`.
    fn stress(&self, deformation: &Deformation) -> Matrix3<f64> {
        deformation.f() * self.balance + deformation.cofactor_less_f() * self.by_j
    }
}

fn unit(axis: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 })
}
