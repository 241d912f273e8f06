//! Newton's method with a line search on a sum of energies.

mod acceptance;
mod report;

use std::ops::ControlFlow;

use nalgebra::Vector3;

use crate::constraints::Constraints;
use crate::energy::{Energy, Projection};
use crate::factor::{Factor, FactorError};
use crate::hessian::Hessian;
use acceptance::{Judgement, Start, Total};
pub use report::{Info, Params, Progress, SolveError};

/// Share of the slope that may be left after a step that is judged by its slope \[HZ05\].
const SLOPE_LEFT: f64 = 0.9;
/// First shift of a matrix that stays indefinite, as a share of its mean diagonal; every further one is ten times larger.
const FIRST_SHIFT: f64 = 1e-6;
/// Forces below this share of stiffness times position are rounding.
const FORCE_ROUNDING: f64 = 32.0 * f64::EPSILON;
const MAX_SHIFTS: u32 = 10;
const MAX_HALVINGS: u32 = 30;

/// Minimises sums of energies that share one sparsity and one set of given coordinates.
pub struct Solver {
    hessian: Hessian,
    factor: Factor,
    gradient: Vec<Vector3<f64>>,
    single: Vec<Vector3<f64>>,
    right_hand_side: Vec<Vector3<f64>>,
    direction: Vec<Vector3<f64>>,
    motion: Vec<Vector3<f64>>,
    trial: Vec<Vector3<f64>>,
    /// Mean diagonal of the matrix that was factorised last \[N/m\].
    stiffness: f64,
}

#[derive(Debug, Clone, Copy)]
struct Residual {
    /// Largest force at a free node over the largest nodal force of a single energy. Where forces are mere rounding, as
    /// after a rigid motion, they count as within the tolerance.
    relative: f64,
    /// Norm of the force at free coordinates \[N\].
    norm: f64,
}

impl Solver {
    /// Analyses the sparsity of `energies` with the coordinates that `constraints` gives. Later calls of
    /// [`Solver::minimise`] may use other energies on the same stencils and other targets of the same coordinates.
    ///
    /// # Errors
    /// [`FactorError`]: no memory.
    pub fn new(constraints: &Constraints, energies: &[&dyn Energy]) -> Result<Self, FactorError> {
        let hessian = Hessian::new(constraints, energies);
        let factor = Factor::new(&hessian, energies.iter().find_map(|e| e.rest_positions()))?;
        let zeros = || vec![Vector3::zeros(); constraints.n_nodes()];
        Ok(Self {
            hessian,
            factor,
            gradient: zeros(),
            single: zeros(),
            right_hand_side: zeros(),
            direction: zeros(),
            motion: zeros(),
            trial: zeros(),
            stiffness: 0.0,
        })
    }

    /// Free unknowns, and values of the Cholesky factor: what a solve costs.
    pub fn size(&self) -> (usize, usize) {
        (self.hessian.n_unknowns(), self.factor.n_values())
    }

    /// Moves `x: [n_nodes]` \[m\] to a minimum of the sum of `energies` where `constraints` hold.
    ///
    /// Given coordinates travel to their targets with the first steps, the free ones following linearly. The exact Hessian
    /// is used where it is positive definite, else a projected one \[SGK19\]. `observer` is called before every step and may
    /// cancel.
    ///
    /// # Errors
    /// See [`SolveError`].
    ///
    /// # Panics
    /// If the lengths of `x` and `constraints` are not those of the analysis.
    pub fn minimise(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        params: &Params,
        x: &mut [Vector3<f64>],
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Info, SolveError> {
        assert_eq!((x.len(), constraints.n_nodes()), (self.gradient.len(), self.gradient.len()), "nodes");
        let mut info = Info::default();
        loop {
            let iterations = info.iterations;
            let moves = self.find_motion(constraints, x);
            let residual = self.find_residual(energies, constraints, params.tolerance, x);
            info.residuals.push(residual.relative);
            if !(residual.relative.is_finite() && (iterations > 0 || Total::of(energies, x).value.is_finite())) {
                return Err(SolveError::NotFinite { iterations });
            }
            if observer(Progress { iteration: iterations, residual: residual.relative }).is_break() {
                return Err(SolveError::Cancelled { iterations });
            }
            if !moves && residual.relative <= params.tolerance {
                break;
            }
            if iterations == params.max_iterations {
                let (residual, tolerance) = (residual.relative, params.tolerance);
                return Err(SolveError::NotConverged { iterations, residual, tolerance });
            }
            self.find_direction(energies, constraints, moves, x, &mut info)?;
            let went = if moves {
                self.follow_given(energies, constraints, x, &mut info)
            } else {
                self.search_line(energies, constraints, residual, x, &mut info)
            };
            if !went {
                return Err(SolveError::LineSearch { iterations, residual: residual.relative });
            }
            info.iterations += 1;
        }
        info.smallest_jacobian = smallest_jacobian(energies, x);
        Ok(info)
    }

    /// What given coordinates still have to move; whether any has.
    fn find_motion(&mut self, constraints: &Constraints, x: &[Vector3<f64>]) -> bool {
        let mut moves = false;
        for (node, motion) in self.motion.iter_mut().enumerate() {
            *motion = constraints.remaining(node, &x[node]);
            moves |= *motion != Vector3::zeros();
        }
        moves
    }

    fn find_residual(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        tolerance: f64,
        x: &[Vector3<f64>],
    ) -> Residual {
        let mut largest_force = 0.0_f64;
        self.gradient.fill(Vector3::zeros());
        for energy in energies {
            self.single.fill(Vector3::zeros());
            energy.add_gradient(x, &mut self.single);
            for (sum, force) in self.gradient.iter_mut().zip(&self.single) {
                *sum += force;
                largest_force = largest_force.max(force.norm());
            }
        }
        clear_given(&mut self.gradient, constraints);
        let largest = self.gradient.iter().map(Vector3::norm).fold(0.0, nan_max);
        let norm = self.gradient.iter().map(Vector3::norm_squared).sum::<f64>().sqrt();
        let rounding = FORCE_ROUNDING * self.stiffness * x.iter().map(Vector3::amax).fold(0.0, f64::max);
        let scale = largest_force.max(rounding / tolerance);
        Residual { relative: if largest == 0.0 { 0.0 } else { largest / scale }, norm }
    }

    /// `direction = -H^-1 (gradient + H_free,given motion)`.
    fn find_direction(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        moves: bool,
        x: &[Vector3<f64>],
        info: &mut Info,
    ) -> Result<(), SolveError> {
        if !self.factorise(energies, Projection::Exact, moves, x) {
            info.indefinite_steps += 1;
            if !self.factorise(energies, Projection::PositiveSemidefinite, moves, x) && !self.factorise_shifted() {
                return Err(SolveError::Singular { iterations: info.iterations });
            }
        }
        for ((b, g), lift) in self.right_hand_side.iter_mut().zip(&self.gradient).zip(self.hessian.lift()) {
            *b = lift - g;
        }
        clear_given(&mut self.right_hand_side, constraints);
        self.factor.solve(&self.hessian, &self.right_hand_side, &mut self.direction);
        for (direction, motion) in self.direction.iter_mut().zip(&self.motion) {
            *direction += motion;
        }
        Ok(())
    }

    fn factorise(&mut self, energies: &[&dyn Energy], projection: Projection, moves: bool, x: &[Vector3<f64>]) -> bool {
        self.hessian.clear(moves.then_some(&self.motion));
        for energy in energies {
            energy.add_hessian(x, projection, &mut self.hessian);
        }
        self.stiffness = self.hessian.mean_diagonal();
        self.hessian.finish(self.stiffness);
        self.factor.factorise(&self.hessian).is_ok()
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

    /// Takes the longest step that keeps the energy finite and turns no element over.
    fn follow_given(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        x: &mut [Vector3<f64>],
        info: &mut Info,
    ) -> bool {
        let was_upright = energies.iter().all(|e| e.is_upright(x));
        let mut length = 1.0;
        for _ in 0..=MAX_HALVINGS {
            self.try_step(x, length);
            if length == 1.0 {
                constraints.place(&mut self.trial);
            }
            let is_upright = !was_upright || energies.iter().all(|e| e.is_upright(&self.trial));
            if is_upright && Total::of(energies, &self.trial).value.is_finite() {
                x.copy_from_slice(&self.trial);
                return true;
            }
            info.halvings += 1;
            length *= 0.5;
        }
        false
    }

    /// Backtracks until the energy has fallen enough or, where its differences are rounding, the slope has.
    fn search_line(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        residual: Residual,
        x: &mut [Vector3<f64>],
        info: &mut Info,
    ) -> bool {
        let start = Start {
            total: Total::of(energies, x),
            slope: self.gradient.iter().zip(&self.direction).map(|(g, p)| g.dot(p)).sum(),
            norm: residual.norm,
            has_potential: energies.iter().all(|e| e.has_potential()),
        };
        let mut length = 1.0;
        for _ in 0..=MAX_HALVINGS {
            self.try_step(x, length);
            let accepted = match start.judge(&Total::of(energies, &self.trial), length) {
                Judgement::Accept => true,
                Judgement::Refuse => false,
                Judgement::AskForces => self.is_better_by_forces(energies, constraints, &start),
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

    /// Judges `trial` by its forces; leaves the gradient as it was.
    fn is_better_by_forces(&mut self, energies: &[&dyn Energy], constraints: &Constraints, start: &Start) -> bool {
        let gradient = self.gradient.clone();
        let trial = std::mem::take(&mut self.trial);
        let found = self.find_residual(energies, constraints, 1.0, &trial);
        let slope_left: f64 = self.gradient.iter().zip(&self.direction).map(|(g, p)| g.dot(p)).sum();
        self.trial = trial;
        self.gradient = gradient;
        if start.has_potential { slope_left.abs() <= SLOPE_LEFT * start.slope.abs() } else { found.norm < start.norm }
    }

    fn try_step(&mut self, x: &[Vector3<f64>], length: f64) {
        for ((trial, x), p) in self.trial.iter_mut().zip(x).zip(&self.direction) {
            *trial = x + p * length;
        }
    }
}

fn smallest_jacobian(energies: &[&dyn Energy], x: &[Vector3<f64>]) -> Option<f64> {
    energies.iter().filter_map(|e| e.smallest_jacobian(x)).reduce(f64::min)
}

fn clear_given(vectors: &mut [Vector3<f64>], constraints: &Constraints) {
    for (node, v) in vectors.iter_mut().enumerate() {
        for (k, _) in constraints.is_given(node).iter().enumerate().filter(|(_, given)| **given) {
            v[k] = 0.0;
        }
    }
}

/// Unlike `f64::max`, keeps NaN.
fn nan_max(a: f64, b: f64) -> f64 {
    if b.is_nan() || a.is_nan() { f64::NAN } else { a.max(b) }
}
