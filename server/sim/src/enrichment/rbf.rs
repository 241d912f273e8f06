//! Correlation by the position of the tool with radial basis functions, as in PhyNNeSS \[DDSA11\]: `w = K^-1 k`,
//! `k_i = exp(-|p - p_i|^2 / (2 l^2))`. The position of the tool is the only input.

use nalgebra::{DMatrix, Vector3};

use super::fade::Trust;
use super::kriging::leave_one_out;
use super::situation::Situation;

/// Candidates for the term added to the diagonal, chosen by leave-one-out error.
const NUGGETS: [f64; 4] = [1e-4, 1e-3, 1e-2, 1e-1];

/// Weights by the position of the tool.
#[derive(Debug, Clone)]
pub(crate) struct Rbf {
    positions: Vec<Vector3<f32>>,
    width: f32,
    /// `K^-1`, `[n][n]`
    inverse: Vec<f32>,
}

impl Rbf {
    /// `width` is `l` \[m\]; `products` are inner products of the fields to predict, `[n][n]`.
    pub(crate) fn new(situations: &[Situation<'_>], products: &DMatrix<f64>, width: f64) -> Option<Self> {
        let positions: Vec<_> = situations.iter().map(|s| s.tool_origin).collect();
        let n = positions.len();
        let kernel = |i: usize, j: usize| f64::from(between(&positions[i], &positions[j], width as f32));
        let matrix = DMatrix::from_fn(n, n, kernel);
        let inverse = |nugget: &f64| Some((&matrix + DMatrix::identity(n, n) * *nugget).cholesky()?.inverse());
        let error = |inverse: &DMatrix<f64>| leave_one_out(inverse, products);
        let best = NUGGETS.iter().filter_map(inverse).min_by(|a, b| error(a).total_cmp(&error(b)))?;
        let inverse = best.transpose().iter().map(|v| *v as f32).collect();
        Some(Self { positions, width: width as f32, inverse })
    }

    /// Writes `w`, with full trust; `scratch` holds at least `n` numbers.
    pub(crate) fn weigh(&self, situation: &Situation<'_>, scratch: &mut [f32], weights: &mut [f32]) -> Trust {
        let n = self.positions.len();
        let k = &mut scratch[..n];
        k.iter_mut().zip(&self.positions).for_each(|(k, p)| *k = between(&situation.tool_origin, p, self.width));
        for (w, row) in weights.iter_mut().zip(self.inverse.chunks_exact(n)) {
            *w = row.iter().zip(&*k).map(|(a, b)| a * b).sum();
        }
        Trust::FULL
    }
}

fn between(a: &Vector3<f32>, b: &Vector3<f32>, width: f32) -> f32 {
    (-(a - b).norm_squared() / (2.0 * width * width)).exp()
}
