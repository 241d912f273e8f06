//! Start of a load step: positions extrapolated from those of the steps before.

use std::ops::{AddAssign, Mul};

use nalgebra::Vector3;

/// Equilibria that are kept: cubic extrapolation.
const MAX_PAST: usize = 4;

/// An equilibrium.
#[derive(Debug, Clone)]
pub(super) struct Place {
    /// Share of the loads.
    pub(super) share: f64,
    /// Positions of the nodes \[m\].
    pub(super) x: Vec<Vector3<f64>>,
    /// Stresses of the solid, as [`plica_accurate::Energy::carried_stresses`] has them.
    pub(super) stresses: Vec<f64>,
}

/// Equilibria up to the last, the newest first.
#[derive(Debug, Default)]
pub(super) struct Extrapolation {
    past: Vec<Place>,
}

impl Extrapolation {
    /// Adds an equilibrium.
    pub(super) fn push(&mut self, place: Place) {
        self.past.insert(0, place);
        self.past.truncate(MAX_PAST);
    }

    /// Places at `share` by polynomials through the last equilibria; the highest order first. None before the second one.
    pub(super) fn guesses(&self, share: f64) -> impl Iterator<Item = Place> {
        (2..=self.past.len()).rev().map(move |n| {
            let past = &self.past[..n];
            let weights: Vec<f64> = (0..n).map(|i| weight(past, i, share)).collect();
            Place {
                share,
                x: combine(&weights, past.iter().map(|place| &place.x[..])),
                stresses: combine(&weights, past.iter().map(|place| &place.stresses[..])),
            }
        })
    }
}

fn combine<'a, T>(weights: &[f64], values: impl Iterator<Item = &'a [T]>) -> Vec<T>
where
    T: Copy + AddAssign + Mul<f64, Output = T> + 'a,
{
    let mut parts = weights.iter().zip(values).map(|(w, v)| v.iter().map(move |v| *v * *w));
    let mut sum: Vec<T> = parts.next().into_iter().flatten().collect();
    parts.for_each(|part| sum.iter_mut().zip(part).for_each(|(sum, v)| *sum += v));
    sum
}

/// Lagrange's weight of one of the places.
fn weight(places: &[Place], i: usize, share: f64) -> f64 {
    let others = places.iter().enumerate().filter(|(j, _)| *j != i);
    others.map(|(_, other)| (share - other.share) / (places[i].share - other.share)).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_motion_is_extrapolated_exactly() {
        let at =
            |s: f64| Place { share: s, x: vec![Vector3::new(s * s * s - s, 2.0 * s * s, 1.0 + s)], stresses: vec![s] };
        let mut past = Extrapolation::default();
        past.push(at(0.0));
        assert_eq!(past.guesses(0.1).count(), 0);
        [0.1, 0.3, 0.4].into_iter().for_each(|share| past.push(at(share)));
        let guesses: Vec<_> = past.guesses(0.6).collect();
        assert_eq!(guesses.len(), 3);
        assert!((guesses[0].x[0] - at(0.6).x[0]).norm() < 1e-12, "{guesses:?}");
        assert!((guesses[2].x[0].z - 1.6).abs() < 1e-12 && (guesses[2].stresses[0] - 0.6).abs() < 1e-12);
    }
}
