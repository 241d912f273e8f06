//! Start of a load step: positions extrapolated from those of the steps before.

use nalgebra::Vector3;

/// Steps before the last that are kept: cubic extrapolation.
const MAX_PAST: usize = 3;

/// Equilibria before the last, the newest first.
#[derive(Debug, Default)]
pub(super) struct Extrapolation {
    past: Vec<(f64, Vec<Vector3<f64>>)>,
}

impl Extrapolation {
    /// Adds the equilibrium under a share of the loads.
    pub(super) fn push(&mut self, share: f64, x: Vec<Vector3<f64>>) {
        self.past.insert(0, (share, x));
        self.past.truncate(MAX_PAST);
    }

    /// Positions at `target` by polynomials through the last equilibrium, `x` at `reached`, and those before; the highest order
    /// first. None before the second step.
    pub(super) fn guess(&self, reached: f64, x: &[Vector3<f64>], target: f64) -> Vec<Vec<Vector3<f64>>> {
        let of_order = |order: usize| {
            let shares: Vec<f64> =
                std::iter::once(reached).chain(self.past.iter().map(|p| p.0)).take(order + 1).collect();
            let mut sum: Vec<_> = x.iter().map(|x| x * weight(&shares, 0, target)).collect();
            for (i, (_, past)) in self.past.iter().take(order).enumerate() {
                let weight = weight(&shares, i + 1, target);
                sum.iter_mut().zip(past).for_each(|(sum, x)| *sum += x * weight);
            }
            sum
        };
        (1..=self.past.len()).rev().map(of_order).collect()
    }
}

/// Lagrange's weight of the sample at `shares[i]`.
fn weight(shares: &[f64], i: usize, target: f64) -> f64 {
    let others = shares.iter().enumerate().filter(|(j, _)| *j != i);
    others.map(|(_, share)| (target - share) / (shares[i] - share)).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_motion_is_extrapolated_exactly() {
        let at = |s: f64| vec![Vector3::new(s * s * s - s, 2.0 * s * s, 1.0 + s)];
        let mut past = Extrapolation::default();
        assert!(past.guess(0.0, &at(0.0), 0.1).is_empty());
        for share in [0.0, 0.1, 0.3] {
            past.push(share, at(share));
        }
        let guesses = past.guess(0.4, &at(0.4), 0.6);
        assert_eq!(guesses.len(), 3);
        assert!((guesses[0][0] - at(0.6)[0]).norm() < 1e-12, "{guesses:?}");
        assert!((guesses[2][0].z - 1.6).abs() < 1e-12);
    }
}
