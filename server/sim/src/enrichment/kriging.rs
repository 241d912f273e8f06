//! Correlation by kriging: Gaussian-process weights on the features of a contact.
//!
//! `w = (K + lambda I)^-1 k`, `k(a, b) = f_a.f_b / v exp(-|f_a - f_b|^2 / (2 L^2 v)) exp(-|c_a - c_b|^2 / (2 l^2)) max(0, n_a.n_b)`
//!
//! `v` is the mean of `|f|^2`. The factor `f_a.f_b` makes the detail vanish with the deformation and grow with it. `L`, `l` and
//! `lambda` are those with the smallest leave-one-out error on the examples. The novelty of a state is the share of the
//! variance that examples leave unexplained, `1 - k.w / k(a, a)`.

use nalgebra::{DMatrix, Vector3};

use super::fade::{Fade, Trust};
use super::situation::Situation;
use super::stencil::{N_FEATURES, Stencil};

/// Candidates for `L`, for `l` in units of the coarse cells, and for `lambda` in units of the mean of `k(a, a)`.
const FEATURE_SCALES: [f64; 3] = [1.0, 2.0, 4.0];
const CONTACT_CELLS: [f64; 3] = [1.0, 2.0, 4.0];
const NUGGETS: [f64; 3] = [1e-3, 1e-2, 1e-1];

/// Kernel arguments of a contact.
#[derive(Debug, Clone, Copy)]
struct Point {
    features: [f32; N_FEATURES],
    squared: f32,
    contact: Vector3<f32>,
    normal: Vector3<f32>,
}

#[derive(Debug, Clone, Copy)]
struct Kernel {
    mean_squared: f32,
    feature_scale: f32,
    contact_scale: f32,
}

/// Weights by kriging.
#[derive(Debug, Clone)]
pub(crate) struct Kriging {
    stencil: Stencil,
    points: Vec<Point>,
    kernel: Kernel,
    /// `(K + lambda I)^-1`, `[n][n]`
    inverse: Vec<f32>,
    fade: Fade,
}

/// Hyper-parameters chosen by leave-one-out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KrigingChoice {
    /// `L`
    pub feature_scale: f64,
    /// `l` \[m\]
    pub contact_scale_m: f64,
    /// `lambda` over the mean of `k(a, a)`
    pub nugget: f64,
    /// Root of the mean squared leave-one-out error, over that of the details.
    pub error: f64,
}

impl Kriging {
    /// `gram` holds inner products of the fields to predict, `[n][n]`.
    pub(crate) fn new(
        stencil: Stencil,
        situations: &[Situation<'_>],
        gram: &DMatrix<f64>,
        cell_size: f64,
    ) -> Option<(Self, KrigingChoice)> {
        let points: Vec<Point> = situations.iter().map(|s| Point::new(&stencil, s)).collect();
        let mean_squared = points.iter().map(|p| p.squared).sum::<f32>() / points.len() as f32;
        let mut best: Option<(Fitted, KrigingChoice)> = None;
        for feature_scale in FEATURE_SCALES {
            for cells in CONTACT_CELLS {
                let contact_scale_m = cells * cell_size;
                let (feature_scale_f, contact_scale) = (feature_scale as f32, contact_scale_m as f32);
                let kernel = Kernel { mean_squared, feature_scale: feature_scale_f, contact_scale };
                let matrix = kernel.matrix(&points);
                for nugget in NUGGETS {
                    let Some(fitted) = Fitted::new(kernel, &matrix, nugget) else { continue };
                    let error = (leave_one_out(&fitted.inverse, gram) / gram.trace()).sqrt();
                    let choice = KrigingChoice { feature_scale, contact_scale_m, nugget, error };
                    if best.as_ref().is_none_or(|(_, b)| error < b.error) {
                        best = Some((fitted, choice));
                    }
                }
            }
        }
        let (fitted, choice) = best?;
        let fade = Fade::after(&fitted.novelties());
        let inverse = fitted.inverse.transpose().iter().map(|v| *v as f32).collect();
        Some((Self { stencil, points, kernel: fitted.kernel, inverse, fade }, choice))
    }

    /// Writes `w`; `scratch` holds at least `n` numbers.
    pub(crate) fn weigh(&self, situation: &Situation<'_>, scratch: &mut [f32], weights: &mut [f32]) -> Trust {
        let n = self.points.len();
        let point = Point::new(&self.stencil, situation);
        let (k, own) = (&mut scratch[..n], self.kernel.between(&point, &point));
        if own <= f32::MIN_POSITIVE {
            weights.fill(0.0);
            return Trust::NONE;
        }
        k.iter_mut().zip(&self.points).for_each(|(k, p)| *k = self.kernel.between(&point, p));
        for (w, row) in weights.iter_mut().zip(self.inverse.chunks_exact(n)) {
            *w = dot(row, k);
        }
        self.fade.trust(1.0 - dot(&weights[..n], k) / own)
    }
}

/// One choice of hyper-parameters.
struct Fitted {
    kernel: Kernel,
    inverse: DMatrix<f64>,
    own: Vec<f64>,
    nugget: f64,
}

impl Fitted {
    fn new(kernel: Kernel, matrix: &DMatrix<f64>, nugget: f64) -> Option<Self> {
        let n = matrix.nrows();
        let nugget = nugget * matrix.trace() / n as f64;
        let inverse = (matrix + DMatrix::identity(n, n) * nugget).cholesky()?.inverse();
        Some(Self { kernel, inverse, own: matrix.diagonal().iter().copied().collect(), nugget })
    }

    /// Unexplained share of the variance of each example, given the others.
    fn novelties(&self) -> Vec<f64> {
        let share = |(i, own): (usize, &f64)| (1.0 / self.inverse[(i, i)] - self.nugget) / own;
        self.own.iter().enumerate().filter(|(_, own)| **own > 0.0).map(share).collect()
    }
}

impl Kernel {
    #[inline(always)]
    fn between(&self, a: &Point, b: &Point) -> f32 {
        let product = dot(&a.features, &b.features);
        let apart = (a.squared + b.squared - 2.0 * product).max(0.0);
        let shift = (a.contact - b.contact).norm_squared();
        let exponent =
            apart / (2.0 * self.feature_scale.powi(2) * self.mean_squared) + shift / (2.0 * self.contact_scale.powi(2));
        product / self.mean_squared * (-exponent).exp() * a.normal.dot(&b.normal).max(0.0)
    }

    fn matrix(&self, points: &[Point]) -> DMatrix<f64> {
        DMatrix::from_fn(points.len(), points.len(), |i, j| f64::from(self.between(&points[i], &points[j])))
    }
}

impl Point {
    fn new(stencil: &Stencil, situation: &Situation<'_>) -> Self {
        let features = stencil.measure(situation);
        Self {
            squared: dot(&features, &features),
            features,
            contact: situation.contact_point,
            normal: situation.frame.row(2).transpose(),
        }
    }
}

/// Sum of the squares of `r_i = [K^-1 d]_i / [K^-1]_ii`, the leave-one-out residual of each example \[RW06, 5.12\].
pub(crate) fn leave_one_out(inverse: &DMatrix<f64>, gram: &DMatrix<f64>) -> f64 {
    let solved = inverse * gram * inverse;
    (0..gram.nrows()).map(|i| solved[(i, i)] / inverse[(i, i)].powi(2)).sum()
}

/// Dot product in eight partial sums, for vector lanes.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    let (a_blocks, b_blocks) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = a_blocks.remainder().iter().zip(b_blocks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_blocks.zip(b_blocks) {
        for lane in 0..8 {
            sums[lane] = a[lane].mul_add(b[lane], sums[lane]);
        }
    }
    sums.iter().sum::<f32>() + rest
}
