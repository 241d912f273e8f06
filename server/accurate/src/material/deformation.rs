//! A deformation and its invariants, without the rounding of differences from rest.

use nalgebra::Matrix3;

/// `G = F - I` and what the materials need of it. At small strains every difference from rest keeps its relative accuracy,
/// so that energies of 1e-12 of the modulus are still good for a line search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deformation {
    /// `G`, displacement gradient.
    pub(crate) gradient: Matrix3<f64>,
    /// `i = I_C - 3 = 2 tr G + G : G`.
    pub(crate) i: f64,
    /// `j = J - 1 = tr G + II_G + det G`.
    pub(crate) j: f64,
    /// `q = i / 2 - j = G : G / 2 - II_G - det G`, of second order in `G`.
    pub(crate) q: f64,
}

impl Deformation {
    pub(crate) fn new(gradient: Matrix3<f64>) -> Self {
        let g = &gradient;
        let trace = g.trace();
        let minors = minor(g, 0, 1) + minor(g, 1, 2) + minor(g, 0, 2);
        let (square, determinant) = (g.norm_squared(), g.determinant());
        Self {
            i: 2.0 * trace + square,
            j: trace + minors + determinant,
            q: 0.5 * square - minors - determinant,
            gradient,
        }
    }

    /// `F`.
    pub(crate) fn f(&self) -> Matrix3<f64> {
        self.gradient + Matrix3::identity()
    }

    /// `J = det F`.
    pub(crate) fn jacobian(&self) -> f64 {
        1.0 + self.j
    }

    /// `C = dJ / dF = cof F`.
    pub(crate) fn cofactor(&self) -> Matrix3<f64> {
        cofactor(&self.f())
    }

    /// `C - F = tr(G) I - G - G^T + cof G`.
    pub(crate) fn cofactor_less_f(&self) -> Matrix3<f64> {
        let g = &self.gradient;
        cofactor(g) - g - g.transpose() + Matrix3::from_diagonal_element(g.trace())
    }
}

/// `cof A`, with `cof(A)^T A = det(A) I`: columns are cross products of the columns of `A`.
pub(crate) fn cofactor(a: &Matrix3<f64>) -> Matrix3<f64> {
    let (x, y, z) = (a.column(0), a.column(1), a.column(2));
    Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)])
}

/// `x - ln(1 + x)`, accurate for small `x` too; infinite for `x <= -1`.
pub(crate) fn log_remainder(x: f64) -> f64 {
    if x <= -1.0 {
        f64::INFINITY
    } else if x.abs() < 1e-2 {
        // x^2 / 2 - x^3 / 3 + ... by Horner's rule.
        (2..=10).rev().fold(0.0, |sum, n| 1.0 / n as f64 - x * sum) * x * x
    } else {
        x - x.ln_1p()
    }
}

fn minor(g: &Matrix3<f64>, a: usize, b: usize) -> f64 {
    g[(a, a)] * g[(b, b)] - g[(a, b)] * g[(b, a)]
}
