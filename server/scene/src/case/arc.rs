//! Following the equilibria past limit points.

use std::ops::ControlFlow;

use nalgebra::Vector3;
use plica_accurate::{ArcState, Energy, Loading, Params, Progress, SolveError, Solver};

use super::checked::{ArcLength, SolveOptions};
use super::failure::{Failure, StepError};
use super::news::News;
use super::problem::Problem;
use super::solution::{LoadStep, Solution, Stability};

/// Newton steps of an arc step above which the next is not longer.
const FEW: u32 = 5;

/// Follows the equilibria of `problem` from rest on, in steps of a length, until they carry all loads or the steps are used up.
///
/// # Errors
/// [`Failure`].
pub(super) fn follow(
    problem: &Problem,
    options: &SolveOptions,
    arc: &ArcLength,
    observer: &mut dyn FnMut(News) -> ControlFlow<()>,
) -> Result<Solution, Failure> {
    let (constraints, loads) = (problem.constraints_at(0.0), problem.loads_at(1.0));
    let energies = problem.energies(&loads);
    let mut solver = Solver::new(&constraints, &energies).map_err(|e| StepError::from(SolveError::from(e)))?;
    let params = Params { tolerance: options.tolerance, max_iterations: options.max_iterations, ..Params::default() };
    let body: [&dyn Energy; 1] = [problem.solid()];
    let loading = Loading { body: &body, loads_at: &|share| problem.loads_at(share), constraints: &constraints };
    let rest: Vec<_> = problem.mesh().nodes().iter().map(|node| node.coords).collect();
    let mut state = ArcState { x: rest, share: 0.0, last: Vec::new() };
    let (mut steps, mut track, mut n_failed) = (Vec::new(), Track::default(), 0);
    let least = arc.step_m * 0.5_f64.powi(options.max_halvings as i32);
    let mut length = arc.step_m;
    track.push(&state);
    while state.share < 1.0 && (steps.len() as u32) < arc.max_steps {
        let (before, reached) = (state.clone(), state.share);
        let mut observe = |Progress { iteration, residual }: Progress| {
            observer(News { reached, target: reached, iteration, residual })
        };
        let mut result = solver.arc_step(&loading, &params, length, &mut state, &mut observe);
        if result.is_ok() && state.share >= 1.0 {
            land(&before, &mut state);
            result = solver.settle(&loading, &params, length, &mut state, &mut observe);
        }
        match result.map_err(StepError::from) {
            Ok(info) => {
                length = if info.iterations <= FEW { (2.0 * length).min(arc.step_m) } else { length };
                steps.push(LoadStep::new(state.share, info));
                track.push(&state);
            }
            Err(error) if error.is_final() => return Err(error.into()),
            Err(error) if length <= least => return Err(Failure::Stuck { reached, target: reached, error }),
            Err(_) => {
                (state, length) = (before, 0.5 * length);
                n_failed += 1;
            }
        }
    }
    let loads = problem.loads_at(state.share);
    let stability = Stability::new(solver.n_negative(&problem.energies(&loads), &constraints, &state.x));
    let (n_unknowns, n_factor_values) = solver.size();
    Ok(Solution {
        share: state.share,
        x: state.x,
        stability,
        n_left: 0,
        limit_loads: track.limit_loads(),
        tool_loads: Vec::new(),
        contact_forces: Vec::new(),
        steps,
        n_failed,
        n_unknowns,
        n_factor_values,
    })
}

/// Moves a state beyond the full loads back to them, on the straight line from the state before.
fn land(before: &ArcState, state: &mut ArcState) {
    let back = (1.0 - before.share) / (state.share - before.share);
    state.x.iter_mut().zip(&before.x).for_each(|(x, before)| *x = before + (*x - before) * back);
    state.share = 1.0;
}

/// Shares of the loads along the path.
#[derive(Debug, Default)]
struct Track {
    /// Distance along the path \[m\] and share.
    points: Vec<[f64; 2]>,
    last: Vec<Vector3<f64>>,
}

impl Track {
    fn push(&mut self, state: &ArcState) {
        let step: f64 = state.x.iter().zip(&self.last).map(|(x, last)| (x - last).norm_squared()).sum();
        let before = self.points.last().map_or(0.0, |point| point[0]);
        self.points.push([before + step.sqrt(), state.share]);
        self.last.clone_from(&state.x);
    }

    /// Extrema of the share, by a parabola through three points.
    fn limit_loads(&self) -> Vec<f64> {
        let turns = |w: &&[[f64; 2]]| (w[1][1] - w[0][1]) * (w[2][1] - w[1][1]) < 0.0;
        self.points.windows(3).filter(turns).map(|w| extremum(w[0], w[1], w[2])).collect()
    }
}

/// Extremum of the parabola through three points.
fn extremum(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let (left, right) = ((b[1] - a[1]) / (b[0] - a[0]), (c[1] - b[1]) / (c[0] - b[0]));
    let curvature = (right - left) / (c[0] - a[0]);
    // Slope at b of the parabola.
    let slope = left + curvature * (b[0] - a[0]);
    b[1] - slope * slope / (4.0 * curvature)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extremum_of_a_parabola_is_exact() {
        let parabola = |s: f64| [s, 3.0 - 2.0 * (s - 0.7) * (s - 0.7)];
        assert!((extremum(parabola(0.1), parabola(0.6), parabola(1.5)) - 3.0).abs() < 1e-12);
    }
}
