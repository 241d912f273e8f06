//! Newton direction: factorise a positive definite Hessian, then correct for non-conservative loads.

use nalgebra::Vector3;

use super::report::{Info, SolveError};
use super::{Problem, Solver, clear_given, dot, gmres};
use crate::energy::Projection;

/// First shift of a matrix that stays indefinite, as a share of its mean diagonal; every further one is ten times larger.
const FIRST_SHIFT: f64 = 1e-6;
const MAX_SHIFTS: u32 = 10;

impl Solver {
    /// `direction = -H^-1 (gradient + H_free,given motion)`.
    pub(super) fn find_direction(
        &mut self,
        problem: &Problem<'_>,
        moves: bool,
        x: &[Vector3<f64>],
        info: &mut Info,
    ) -> Result<(), SolveError> {
        let loads = self.factorise_candidates(problem, moves, x, info)?;
        for ((b, g), lift) in self.right_hand_side.iter_mut().zip(&self.gradient).zip(self.hessian.lift()) {
            *b = lift - g;
        }
        clear_given(&mut self.right_hand_side, problem.constraints);
        self.factor.solve(&self.hessian, &self.right_hand_side, &mut self.direction);
        if !problem.has_potential() {
            self.follow_loads(problem, loads, x);
        }
        for (direction, motion) in self.direction.iter_mut().zip(&self.motion) {
            *direction += motion;
        }
        Ok(())
    }

    /// Factorises the first positive definite candidate: exact; exact but for follower loads; projected; shifted. Returns the
    /// projection of the follower loads in it.
    fn factorise_candidates(
        &mut self,
        problem: &Problem<'_>,
        moves: bool,
        x: &[Vector3<f64>],
        info: &mut Info,
    ) -> Result<Projection, SolveError> {
        use Projection::{Exact, PositiveSemidefinite};
        if self.factorise(problem, [Exact, Exact], moves, x) {
            return Ok(Exact);
        }
        info.indefinite_steps += 1;
        if !problem.has_potential() && self.factorise(problem, [Exact, PositiveSemidefinite], moves, x)
            || self.factorise(problem, [PositiveSemidefinite; 2], moves, x)
            || self.factorise_shifted()
        {
            return Ok(PositiveSemidefinite);
        }
        Err(SolveError::Singular { iterations: info.iterations })
    }

    /// Projections are for energies with a potential and without.
    pub(super) fn factorise(
        &mut self,
        problem: &Problem<'_>,
        projections: [Projection; 2],
        moves: bool,
        x: &[Vector3<f64>],
    ) -> bool {
        self.hessian.clear(moves.then_some(&self.motion));
        for energy in problem.energies {
            let projection = projections[usize::from(!energy.has_potential())];
            energy.add_hessian(x, projection, &mut self.hessian);
        }
        self.stiffness = self.hessian.mean_diagonal();
        self.hessian.finish(self.stiffness);
        self.factor.factorise(&self.hessian).is_ok()
    }

    /// Turns `H^-1 b` into `(H + R)^-1 b` with the remainder `R` of follower loads, unless that points uphill.
    pub(super) fn follow_loads(&mut self, problem: &Problem<'_>, loads: Projection, x: &[Vector3<f64>]) {
        let (hessian, factor, product) = (&self.hessian, &mut self.factor, &mut self.single);
        let mut direction = self.direction.clone();
        gmres::solve(&mut direction, |v, out| {
            product.fill(Vector3::zeros());
            problem.energies.iter().for_each(|e| e.add_remainder_product(x, v, loads, product));
            clear_given(product, problem.constraints);
            factor.solve(hessian, product, out);
        });
        if dot(&direction, &self.right_hand_side) > 0.0 {
            self.direction = direction;
        }
    }

    fn factorise_shifted(&mut self) -> bool {
        let mut shift = FIRST_SHIFT * self.stiffness;
        for _ in 0..MAX_SHIFTS {
            self.hessian.add_diagonal(shift);
            if self.factor.factorise(&self.hessian).is_ok() {
                return true;
            }
            shift *= 10.0;
        }
        false
    }
}
