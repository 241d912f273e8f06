//! Figures over many states.

use serde::{Deserialize, Serialize};

/// Median, 95th percentile and largest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quantiles {
    /// Median.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub worst: f64,
}

impl Quantiles {
    /// Quantiles of `values`; `None` without values.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let at = |share| quantile(&sorted, share);
        Some(Self { median: at(0.5)?, p95: at(0.95)?, worst: at(1.0)? })
    }
}

/// Linear interpolation between the two order statistics next to `share`.
pub(super) fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let place = share * sorted.len().checked_sub(1)? as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(below + place.fract() * (above - below))
}

/// Spearman's rank correlation: Pearson's of the ranks, equal values sharing theirs. `None` where one side is all equal, or
/// for fewer than two pairs.
pub fn rank_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let (a, b): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
    let (a, b) = (ranks(&a), ranks(&b));
    let mean = 0.5 * (pairs.len() as f64 - 1.0);
    let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - mean) * (y - mean)).sum::<f64>();
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    (scale > 0.0).then(|| product(&a, &b) / scale)
}

/// Ranks from 0; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|i, j| values[*i].total_cmp(&values[*j]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for equal in order.chunk_by(|i, j| values[*i] == values[*j]) {
        let mean = first as f64 + 0.5 * (equal.len() as f64 - 1.0);
        equal.iter().for_each(|i| ranks[*i] = mean);
        first += equal.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn quantiles_lie_between_neighbours() {
        let of = Quantiles::of([4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!((of.median, of.worst), (2.5, 4.0));
        assert!((of.p95 - 3.85).abs() < 1e-12);
        assert_eq!(Quantiles::of([7.0]), Some(Quantiles { median: 7.0, p95: 7.0, worst: 7.0 }));
        assert_eq!(Quantiles::of([]), None);
    }

    #[test]
    fn rank_correlation_sees_order_and_nothing_else() {
        let rising: Vec<(f64, f64)> = (0..9).map(|i| (f64::from(i), f64::from(i).exp())).collect();
        assert!((rank_correlation(&rising).unwrap() - 1.0).abs() < 1e-12);
        let falling: Vec<(f64, f64)> = rising.iter().map(|(a, b)| (*a, -b)).collect();
        assert!((rank_correlation(&falling).unwrap() + 1.0).abs() < 1e-12);
        // 1 - 6 sum d^2 / (n (n^2 - 1)), without ties.
        let mixed = [(1.0, 2.0), (2.0, 1.0), (3.0, 4.0), (4.0, 3.0), (5.0, 5.0)];
        assert!((rank_correlation(&mixed).unwrap() - 0.8).abs() < 1e-12);
        // Ranks 0.5, 0.5, 2 against 0, 1, 2: by hand 1.5 / sqrt(1.5 * 2).
        let tied = [(1.0, 1.0), (1.0, 2.0), (2.0, 3.0)];
        assert!((rank_correlation(&tied).unwrap() - 1.5 / 3.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(rank_correlation(&[(1.0, 1.0), (1.0, 2.0)]), None);
        assert_eq!(rank_correlation(&[]), None);
    }
}
