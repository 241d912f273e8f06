//! The paper's correlation \[SSH12, 5.2\]: weights by the similarity of coarse displacement vectors.
//!
//! Departures, with reasons in MATH.md: the kernel acts on the distance `x_i = 1 - r_i` (as printed, on `r_i`, an exact match would
//! have no weight); it is shifted to reach zero, `G' = (G - e^-4) / (1 - e^-4)`; a null example of weight `g_0` fades detail out before
//! the last example leaves the kernel; `|u| / |u[i]|` is bounded.

use crate::lanes::Node;

use super::fade::Trust;
use super::situation::Situation;

/// Options of the paper's method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ssh12Options {
    /// Number of nearest examples whose mean distance is `sigma`.
    pub n_mixed: usize,
    /// Weight of the null example; 0 reproduces the paper.
    pub null_weight: f64,
    /// Whether the kernel acts on `r_i`, as Eq. 10 is printed; for comparison.
    pub literal: bool,
}

impl Default for Ssh12Options {
    fn default() -> Self {
        Self { n_mixed: 4, null_weight: 0.05, literal: false }
    }
}

/// Largest `|u| / |u[i]|`.
const LARGEST_RATIO: f32 = 1.25;
/// Number of weights that are kept.
const KEPT: usize = 10;
/// Least `sigma`.
const LEAST_WIDTH: f64 = 0.02;
/// `e^-4`: the kernel at the end of its support, `x = 2 sigma`.
const AT_END: f32 = 0.018_315_64;

/// Tables of the paper's correlation.
#[derive(Debug, Clone)]
pub(crate) struct Ssh12 {
    options: Ssh12Options,
    /// `n_i`, `[n][n_free]`
    directions: Vec<Node>,
    /// `|u[i]|` \[m\]
    lengths: Vec<f32>,
    sigma: f32,
}

impl Ssh12 {
    pub(crate) fn new(situations: &[Situation<'_>], options: Ssh12Options) -> Self {
        let lengths: Vec<f32> = situations.iter().map(|s| length(s.displacements)).collect();
        let unit = |(s, l): (&Situation<'_>, &f32)| -> Vec<Node> {
            s.displacements.iter().map(|u| u.map(|c| c / l.max(f32::MIN_POSITIVE))).collect()
        };
        let directions: Vec<Vec<Node>> = situations.iter().zip(&lengths).map(unit).collect();
        let sigma = width(&directions, options.n_mixed) as f32;
        Self { options, directions: directions.concat(), lengths, sigma }
    }

    /// Writes `w`, which fade through the null example; the confidence is the share that it leaves.
    pub(crate) fn weigh(&self, situation: &Situation<'_>, weights: &mut [f32]) -> Trust {
        let (u, n_free) = (situation.displacements, situation.displacements.len());
        let own = length(u);
        if own <= f32::MIN_POSITIVE {
            weights.fill(0.0);
            return Trust::NONE;
        }
        for (w, direction) in weights.iter_mut().zip(self.directions.chunks_exact(n_free)) {
            let r = product(direction, u) / own;
            *w = self.kernel(if self.options.literal { r } else { 1.0 - r });
        }
        keep_largest(weights, KEPT);
        let sum: f32 = weights.iter().sum();
        let all = sum + self.options.null_weight as f32;
        if all <= 0.0 {
            weights.fill(0.0);
            return Trust::NONE;
        }
        for (w, length) in weights.iter_mut().zip(&self.lengths) {
            *w *= (own / length).min(LARGEST_RATIO) / all;
        }
        Trust { share: 1.0, confidence: sum / all }
    }

    fn kernel(&self, x: f32) -> f32 {
        let g = (-(x / self.sigma).powi(2)).exp();
        if x.abs() >= 2.0 * self.sigma { 0.0 } else { (g - AT_END) / (1.0 - AT_END) }
    }
}

/// Mean distance to the `n` nearest examples.
fn width(directions: &[Vec<Node>], n: usize) -> f64 {
    let mean = |i: usize| {
        let distance = |j: usize| f64::from(1.0 - product(&directions[i], &directions[j]));
        let mut distances: Vec<f64> = (0..directions.len()).filter(|j| *j != i).map(distance).collect();
        distances.sort_by(f64::total_cmp);
        distances.truncate(n);
        (!distances.is_empty()).then(|| distances.iter().sum::<f64>() / distances.len() as f64)
    };
    let means: Vec<f64> = (0..directions.len()).filter_map(mean).collect();
    (means.iter().sum::<f64>() / means.len().max(1) as f64).max(LEAST_WIDTH)
}

/// Zeroes all but the `n` largest, without allocating.
fn keep_largest(weights: &mut [f32], n: usize) {
    let mut least_kept = f32::INFINITY;
    for _ in 0..n {
        let below = weights.iter().copied().filter(|w| *w < least_kept).fold(0.0, f32::max);
        least_kept = below;
    }
    weights.iter_mut().filter(|w| **w < least_kept).for_each(|w| *w = 0.0);
}

fn length(u: &[Node]) -> f32 {
    product(u, u).sqrt()
}

#[inline(always)]
pub(crate) fn product(a: &[Node], b: &[Node]) -> f32 {
    let mut sums = [0.0_f32; 4];
    for (a, b) in a.iter().zip(b) {
        for k in 0..4 {
            sums[k] = a[k].mul_add(b[k], sums[k]);
        }
    }
    sums.iter().sum()
}
