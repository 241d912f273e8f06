//! Backtracking line search along the Newton direction.

use nalgebra::Vector3;

use super::report::Info;
use super::sufficient_decrease::{Decision, Start, Total};
use super::{Problem, Residual, Solver, dot};

/// Largest slope after a step, as a share of the first, where energy differences are rounding \[HZ05\].
const SLOPE_LEFT: f64 = 0.9;
const MAX_HALVINGS: u32 = 30;

impl Solver {
    /// Takes the longest step at which the energy is finite.
    pub(super) fn follow_given(&mut self, problem: &Problem<'_>, x: &mut [Vector3<f64>], info: &mut Info) -> bool {
        let mut length = 1.0;
        for _ in 0..=MAX_HALVINGS {
            self.try_step(x, length);
            if length == 1.0 {
                problem.constraints.place(&mut self.trial);
            }
            if Total::of(problem.energies, &self.trial).value.is_finite() {
                x.copy_from_slice(&self.trial);
                return true;
            }
            info.halvings += 1;
            length *= 0.5;
        }
        false
    }

    /// Backtracks to a sufficient decrease of the energy or, where its differences are rounding, of the slope.
    pub(super) fn search_line(
        &mut self,
        problem: &Problem<'_>,
        residual: Residual,
        x: &mut [Vector3<f64>],
        info: &mut Info,
    ) -> bool {
        let start = Start {
            total: Total::of(problem.energies, x),
            slope: dot(&self.gradient, &self.direction),
            frozen_work: self.frozen_work(problem, x),
            norm: residual.norm,
            has_potential: problem.has_potential(),
        };
        let mut length = 1.0;
        for _ in 0..=MAX_HALVINGS {
            self.try_step(x, length);
            let accepted = match start.decide(&Total::of(problem.energies, &self.trial), length) {
                Decision::Accept => true,
                Decision::Reject => false,
                Decision::Undecided => self.is_better_by_forces(problem, &start),
            };
            if accepted {
                x.copy_from_slice(&self.trial);
                return true;
            }
            info.halvings += 1;
            length *= 0.5;
        }
        false
    }

    /// Work against loads without a potential along the whole step, their forces held constant \[J\].
    fn frozen_work(&mut self, problem: &Problem<'_>, x: &[Vector3<f64>]) -> f64 {
        self.single.fill(Vector3::zeros());
        problem.energies.iter().filter(|e| !e.has_potential()).for_each(|e| e.add_gradient(x, &mut self.single));
        dot(&self.single, &self.direction)
    }

    /// Acceptance of `trial` by its forces; keeps the gradient.
    fn is_better_by_forces(&mut self, problem: &Problem<'_>, start: &Start) -> bool {
        let gradient = self.gradient.clone();
        let trial = std::mem::take(&mut self.trial);
        let found = self.find_residual(problem, &trial);
        let slope_left = dot(&self.gradient, &self.direction);
        self.trial = trial;
        self.gradient = gradient;
        if start.has_potential { slope_left.abs() <= SLOPE_LEFT * start.slope.abs() } else { found.norm < start.norm }
    }

    pub(super) fn try_step(&mut self, x: &[Vector3<f64>], length: f64) {
        for ((trial, x), p) in self.trial.iter_mut().zip(x).zip(&self.direction) {
            *trial = x + p * length;
        }
    }
}
