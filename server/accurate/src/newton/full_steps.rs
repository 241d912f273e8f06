//! Newton steps in full, with stresses as unknowns of their own in the tangent.

use nalgebra::Vector3;

use super::report::Info;
use super::sufficient_decrease::Total;
use super::{Problem, Solver, clear_given};
use crate::energy::Projection;

/// Last steps that are taken only where the residual is small.
const SPARE: u32 = 10;
const NEARLY: f64 = 0.05;
/// Halvings of a full step that is not admissible.
const MAX_HALVINGS: u32 = 6;

/// Stresses carried along by full steps.
///
/// Newton's method for displacements takes the stresses of its tangent from the last iterate. Where a body resists some
/// deformations far more than others (a change of volume near incompressibility, stretch of a thin strip) these are
/// wildly wrong after a step, by a stiff response to its second-order terms; tangents are indefinite, and a line search
/// creeps. With stresses as unknowns beside the displacements, eliminated at each integration point, the equation of
/// a step is the same but for its stress stiffness, which has stresses linear in the steps: `S' = S + dS/dE : sym(F^T dF)`
/// \[MLG17\]. The residual, and so the solution, is that of the displacements.
pub(super) struct FullSteps {
    start: Vec<Vector3<f64>>,
    left: u32,
    taken: u32,
    /// `S'` of each energy; empty before the first step.
    stresses: Vec<Vec<f64>>,
    /// Whether the last tangent was not positive definite.
    is_indefinite: bool,
}

impl FullSteps {
    pub(super) fn new(max_steps: u32, x: &[Vector3<f64>], stresses: Vec<Vec<f64>>) -> Self {
        Self { start: x.to_vec(), left: max_steps, taken: 0, stresses, is_indefinite: false }
    }

    /// Whether the equilibrium that was found may not be a minimum, which the line search would find.
    pub(super) fn lead_to_a_saddle(&self, problem: &Problem<'_>) -> bool {
        self.is_indefinite && problem.has_potential()
    }

    pub(super) fn are_on(&self) -> bool {
        self.left > 0
    }

    /// Whether full steps are used up, or led where nothing is finite.
    pub(super) fn are_lost(&self, residual: f64) -> bool {
        self.left > 0
            && self.taken > 0
            && (!residual.is_finite() || (self.left <= SPARE && residual > NEARLY) || self.left == 1)
    }

    /// Ends full steps; the positions to start from anew.
    pub(super) fn give_up(&mut self, info: &mut Info) -> &[Vector3<f64>] {
        self.left = 0;
        info.lost_steps = self.taken;
        &self.start
    }
}

impl Solver {
    /// A full step with carried stresses; `false`, and nothing done, where there is none.
    pub(super) fn step_in_full(
        &mut self,
        problem: &Problem<'_>,
        moves: bool,
        steps: &mut FullSteps,
        x: &mut [Vector3<f64>],
        info: &mut Info,
    ) -> bool {
        steps.left -= 1;
        steps.taken += 1;
        steps.is_indefinite = !self.factorise_carried(problem, moves, &steps.stresses, x);
        if steps.is_indefinite {
            info.indefinite_steps += 1;
            if problem.has_potential() || self.factor.factorise_indefinite(&self.hessian).is_err() {
                steps.stresses.clear();
                return false;
            }
        }
        for ((b, g), lift) in self.right_hand_side.iter_mut().zip(&self.gradient).zip(self.hessian.lift()) {
            *b = lift - g;
        }
        clear_given(&mut self.right_hand_side, problem.constraints);
        self.factor.solve(&self.hessian, &self.right_hand_side, &mut self.direction);
        if !problem.has_potential() {
            self.follow_loads(problem, Projection::Exact, x);
        }
        self.direction.iter_mut().zip(&self.motion).for_each(|(direction, motion)| *direction += motion);
        let mut length = 1.0;
        for _ in 0..=MAX_HALVINGS {
            self.try_step(x, length);
            if length == 1.0 && moves {
                problem.constraints.place(&mut self.trial);
            }
            if Total::of(problem.energies, &self.trial).value.is_finite() {
                let taken: Vec<_> = self.trial.iter().zip(x.iter()).map(|(trial, x)| trial - x).collect();
                steps.stresses = problem.energies.iter().map(|e| e.carried_stresses(x, &taken)).collect();
                x.copy_from_slice(&self.trial);
                return true;
            }
            info.halvings += 1;
            length *= 0.5;
        }
        steps.stresses.clear();
        false
    }

    fn factorise_carried(
        &mut self,
        problem: &Problem<'_>,
        moves: bool,
        stresses: &[Vec<f64>],
        x: &[Vector3<f64>],
    ) -> bool {
        self.hessian.clear(moves.then_some(&self.motion));
        for (i, energy) in problem.energies.iter().enumerate() {
            energy.add_carried_hessian(x, stresses.get(i).map_or(&[], |carried| carried), &mut self.hessian);
        }
        self.stiffness = self.hessian.mean_diagonal();
        self.hessian.finish(self.stiffness);
        self.factor.factorise(&self.hessian).is_ok()
    }
}
