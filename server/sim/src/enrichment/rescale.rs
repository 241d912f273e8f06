//! Rescaling of the coarse indentation by the distance from the contact point: `d = -B(r) u_c`.
//!
//! A coarse mesh smears an indentation; rescaling undoes most of that before any example is blended. `B` is piecewise linear
//! between knots, constant beyond the chart, and the least-squares fit of the training examples' detail. Alone it is a
//! baseline; with examples it is a control variate, and they hold the remainder.

use nalgebra::{DMatrix, DVector};

use super::situation::Situation;

/// Knots as shares of the radius.
const KNOTS: [f64; 16] = [0.0, 0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.18, 0.21, 0.25, 0.31, 0.38, 0.5, 0.65, 0.8, 1.0];
/// Ridge that pulls coefficients without skin vertices to zero.
const RIDGE: f64 = 1e-6;

/// `B`
#[derive(Debug, Clone)]
pub(crate) struct Rescale {
    radius: f64,
    at_knots: [f64; KNOTS.len()],
    far: f64,
}

impl Rescale {
    /// Fits `B` to examples with details `[n][n_skin]` \[m\]; vertices are weighted by area.
    pub(crate) fn fit(situations: &[Situation<'_>], details: &[Vec<[f32; 3]>], areas: &[f64], radius: f64) -> Self {
        const N: usize = KNOTS.len() + 1;
        let mut matrix = DMatrix::<f64>::zeros(N, N);
        let mut vector = DVector::<f64>::zeros(N);
        for (situation, detail) in situations.iter().zip(details) {
            for (v, (d, area)) in detail.iter().zip(areas).enumerate() {
                let u = situation.offset(v).cast::<f64>();
                let d = nalgebra::Vector3::from(d.map(f64::from));
                let shares = shares(distance(situation, v), radius);
                for (i, a) in shares {
                    shares.iter().for_each(|(j, b)| matrix[(i, *j)] += a * b * area * u.norm_squared());
                    vector[i] -= a * area * u.dot(&d);
                }
            }
        }
        let ridge = RIDGE * matrix.trace() / N as f64;
        (0..N).for_each(|i| matrix[(i, i)] += ridge.max(f64::MIN_POSITIVE));
        let solved = matrix.cholesky().map_or_else(|| DVector::zeros(N), |c| c.solve(&vector));
        Self { radius, at_knots: std::array::from_fn(|i| solved[i]), far: solved[KNOTS.len()] }
    }

    /// `B = 0`
    pub(crate) fn none(radius: f64) -> Self {
        Self { radius, at_knots: [0.0; KNOTS.len()], far: 0.0 }
    }

    /// `B` at a distance \[m\].
    pub(crate) fn at(&self, distance: f64) -> f64 {
        let value = |i: usize| self.at_knots.get(i).copied().unwrap_or(self.far);
        shares(distance, self.radius).iter().map(|(i, share)| share * value(*i)).sum()
    }

    /// `B` beyond the chart.
    pub(crate) fn far(&self) -> f64 {
        self.far
    }
}

/// Distance of a vertex from the contact point \[m\].
pub(crate) fn distance(situation: &Situation<'_>, vertex: usize) -> f64 {
    let [x, y] = situation.coordinates(vertex).map(f64::from);
    x.hypot(y)
}

/// Coefficients around a distance, with their interpolation weights.
fn shares(distance: f64, radius: f64) -> [(usize, f64); 2] {
    let x = distance / radius;
    if x >= 1.0 {
        return [(KNOTS.len(), 1.0), (KNOTS.len(), 0.0)];
    }
    let upper = KNOTS.partition_point(|k| *k <= x).clamp(1, KNOTS.len() - 1);
    let share = (x - KNOTS[upper - 1]) / (KNOTS[upper] - KNOTS[upper - 1]);
    [(upper - 1, 1.0 - share), (upper, share)]
}
