//! Applying loads in steps: a step that fails is halved, and grows again after successes.

use std::ops::ControlFlow;

use nalgebra::Vector3;
use plica_accurate::{Info, Params, SolveError, Solver};

use super::checked::SolveOptions;
use super::problem::{Problem, energies};
use super::solution::{LoadStep, Solution};

/// Progress of a solve, reported before every Newton step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct News {
    /// Share of the loads already carried.
    pub reached: f64,
    /// Share of the loads at the end of this load step.
    pub target: f64,
    /// Newton steps done in this load step.
    pub iteration: u32,
    /// Largest force left, as a share of the largest nodal force.
    pub residual: f64,
}

/// Why the loads cannot be applied completely.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The smallest load step failed.
    #[error("no equilibrium beyond {reached:.4} of the loads: {error}, on the way to {target:.4}")]
    Stuck {
        /// Share of the loads with an equilibrium.
        reached: f64,
        /// Share of the failed step.
        target: f64,
        /// Error of the last attempt.
        error: SolveError,
    },
    /// Ended by the observer, or out of memory.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

/// Applies the loads of `problem` from rest on. `observer` is called before every Newton step and may cancel.
///
/// # Errors
/// [`Failure`].
pub fn follow(
    problem: &Problem,
    options: &SolveOptions,
    observer: &mut dyn FnMut(News) -> ControlFlow<()>,
) -> Result<Solution, Failure> {
    let mut path = Path::new(problem, options)?;
    let (n_unknowns, n_factor_values) = path.solver.size();
    let mut x: Vec<_> = problem.mesh().nodes().iter().map(|node| node.coords).collect();
    let largest_step = 1.0 / f64::from(options.steps);
    let least_step = largest_step * 0.5_f64.powi(options.max_halvings as i32);
    let (mut reached, mut step, mut n_failed, mut steps) = (0.0, largest_step, 0, Vec::new());
    while reached < 1.0 {
        // A remainder of rounding does not get a step of its own.
        let target = if reached + 1.01 * step >= 1.0 { 1.0 } else { reached + step };
        let mut trial = x.clone();
        match path.attempt([reached, target], &mut trial, observer) {
            Ok(info) => {
                steps.push(LoadStep::new(target, info));
                (x, reached) = (trial, target);
                step = (2.0 * step).min(largest_step);
            }
            Err(error @ (SolveError::Cancelled { .. } | SolveError::Factor(_))) => return Err(error.into()),
            Err(error) if step <= least_step => return Err(Failure::Stuck { reached, target, error }),
            Err(_) => {
                n_failed += 1;
                step *= 0.5;
            }
        }
    }
    Ok(Solution { x, steps, n_failed, n_unknowns, n_factor_values })
}

/// Inputs of all load steps.
struct Path<'a> {
    problem: &'a Problem,
    params: Params,
    solver: Solver,
}

impl<'a> Path<'a> {
    fn new(problem: &'a Problem, options: &SolveOptions) -> Result<Self, SolveError> {
        let loads = problem.loads_at(1.0);
        let solver = Solver::new(&problem.constraints_at(1.0), &energies(problem.solid(), &loads))?;
        let params = Params { tolerance: options.tolerance, max_iterations: options.max_iterations };
        Ok(Self { problem, params, solver })
    }

    /// Moves `x` from the equilibrium under one share of the loads to that under another.
    fn attempt(
        &mut self,
        [reached, target]: [f64; 2],
        x: &mut [Vector3<f64>],
        observer: &mut dyn FnMut(News) -> ControlFlow<()>,
    ) -> Result<Info, SolveError> {
        let loads = self.problem.loads_at(target);
        let energies = energies(self.problem.solid(), &loads);
        let mut observe = |progress: plica_accurate::Progress| {
            observer(News { reached, target, iteration: progress.iteration, residual: progress.residual })
        };
        self.solver.minimise(&energies, &self.problem.constraints_at(target), &self.params, x, &mut observe)
    }
}
