//! Leaving an unstable equilibrium along its softest mode.

use nalgebra::Vector3;
use plica_accurate::{Constraints, Energy, Solver};

/// Most modes left one after another under the same loads.
pub(super) const MAX_DEPARTURES: u32 = 5;
/// First length of the perturbation, as a share of the mesh's extent, and the factor between two.
const FIRST_LENGTH: f64 = 2e-2;
const SHORTER: f64 = 0.25;
const MAX_LENGTHS: u32 = 8;

/// Positions beside the equilibrium `x` from which it is left; `None` if it is stable, or no way down is found. Energy without
/// the loads that have none is lower there than at `x`.
pub(super) fn departure(
    solver: &mut Solver,
    energies: &[&dyn Energy],
    constraints: &Constraints,
    x: &[Vector3<f64>],
) -> Option<Vec<Vector3<f64>>> {
    if solver.n_negative(energies, constraints, x)? == 0 {
        return None;
    }
    let mode = solver.softest_mode(energies, constraints, x).filter(|mode| mode.curvature < 0.0)?;
    let value = |x: &[Vector3<f64>]| energies.iter().map(|e| e.value(x)).sum::<f64>();
    let has_potential = energies.iter().all(|e| e.has_potential());
    let (here, mut length) = (value(x), FIRST_LENGTH * extent(x));
    for _ in 0..MAX_LENGTHS {
        let moved: Vec<_> = x.iter().zip(&mode.shape).map(|(x, v)| x + v * length).collect();
        let there = value(&moved);
        if there < here || (!has_potential && there.is_finite()) {
            return Some(moved);
        }
        length *= SHORTER;
    }
    None
}

/// Diagonal of the box around the nodes \[m\].
fn extent(x: &[Vector3<f64>]) -> f64 {
    let none = [Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)];
    let [low, high] = x.iter().fold(none, |[low, high], x| [low.inf(x), high.sup(x)]);
    (high - low).norm()
}
