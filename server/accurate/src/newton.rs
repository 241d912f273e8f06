//! Newton's method with a line search on a sum of energies.

mod arc_length;
mod direction;
mod full_steps;
mod gmres;
mod line_search;
mod report;
mod stability;
mod sufficient_decrease;

use std::ops::ControlFlow;

use nalgebra::Vector3;

use crate::assembly::empty_hessian;
use crate::constraints::Constraints;
use crate::energy::Energy;
use crate::factor::{Factor, FactorError};
use crate::hessian::Hessian;
pub use arc_length::{ArcState, Loading};
use full_steps::FullSteps;
pub use report::{Info, Params, Progress, SolveError};
pub use stability::Mode;
use sufficient_decrease::Total;

/// Forces below this share of stiffness times position are rounding.
const FORCE_ROUNDING: f64 = 256.0 * f64::EPSILON;

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

/// Minimisation problem: energies, constraints and stopping criteria.
#[derive(Clone, Copy)]
struct Problem<'a> {
    energies: &'a [&'a dyn Energy],
    constraints: &'a Constraints,
    params: &'a Params,
}

impl Problem<'_> {
    fn has_potential(&self) -> bool {
        self.energies.iter().all(|e| e.has_potential())
    }
}

/// Forces out of balance, `g = sum_e g_e` at free coordinates, with the gradients `g_e` of single energies.
#[derive(Debug, Clone, Copy)]
struct Residual {
    /// `max_n |g_n| / max(max_e,n |g_e,n|, F / tolerance)`, 0 for `g = 0`. Forces below the rounding
    /// `F = 256 eps k max_n |x_n|`, with the mean diagonal `k` of the last Hessian, are so within the tolerance, as after a
    /// rigid motion.
    relative: f64,
    /// `|g|` \[N\].
    norm: f64,
}

impl Solver {
    /// Analyses the sparsity of `energies` with the coordinates that `constraints` gives. Later calls of
    /// [`Solver::minimise`] may use other energies on the same stencils and other targets of the same coordinates.
    ///
    /// # Errors
    /// [`FactorError`]: no memory.
    pub fn new(constraints: &Constraints, energies: &[&dyn Energy]) -> Result<Self, FactorError> {
        let hessian = empty_hessian(constraints, energies);
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

    /// Number of free unknowns, and of values in the Cholesky factor.
    pub fn size(&self) -> (usize, usize) {
        (self.hessian.n_unknowns(), self.factor.n_values())
    }

    /// Moves `x: [n_nodes]` \[m\] to a minimum of the sum of `energies` where `constraints` hold.
    ///
    /// Given coordinates travel to their targets with the first steps, as far as the energy stays finite, the free ones
    /// following linearly. The exact Hessian is used where it is positive definite, else a projected one \[SGK19\]. `observer`
    /// is called before every step and may cancel.
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
        self.minimise_from(energies, constraints, params, x, Vec::new(), observer)
    }

    /// [`Solver::minimise`] with the first tangent's stresses, as [`Energy::carried_stresses`] has them for each energy, where `x` is
    /// a guess whose own stresses are wrong; without effect unless `params` has full steps.
    ///
    /// # Errors
    /// See [`SolveError`].
    ///
    /// # Panics
    /// If the lengths of `x` and `constraints` are not those of the analysis.
    pub fn minimise_from(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        params: &Params,
        x: &mut [Vector3<f64>],
        stresses: Vec<Vec<f64>>,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Info, SolveError> {
        assert_eq!((x.len(), constraints.n_nodes()), (self.gradient.len(), self.gradient.len()), "nodes");
        let problem = Problem { energies, constraints, params };
        if !Total::of(energies, x).value.is_finite() {
            return Err(SolveError::NotFinite { iterations: 0 });
        }
        let mut info = Info::default();
        let mut full_steps = FullSteps::new(params.max_full_steps, x, stresses);
        loop {
            let moves = self.find_motion(constraints, x);
            let residual = self.find_residual(&problem, x);
            if full_steps.are_lost(residual.relative) {
                x.copy_from_slice(full_steps.give_up(&mut info));
                continue;
            }
            info.residuals.push(residual.relative);
            if is_done(&problem, &info, moves, observer)? {
                if full_steps.are_on() && full_steps.lead_to_a_saddle(&problem) {
                    x.copy_from_slice(full_steps.give_up(&mut info));
                    continue;
                }
                break;
            }
            if !(full_steps.are_on() && self.step_in_full(&problem, moves, &mut full_steps, x, &mut info)) {
                self.step(&problem, moves, residual, x, &mut info)?;
            }
            info.iterations += 1;
        }
        info.smallest_jacobian = energies.iter().filter_map(|e| e.smallest_jacobian(x)).reduce(f64::min);
        Ok(info)
    }

    /// Residual at `x` as in [`Info::residuals`], for a solve to `tolerance`.
    ///
    /// # Panics
    /// If the lengths of `x` and `constraints` are not those of the analysis.
    pub(crate) fn residual(
        &mut self,
        energies: &[&dyn Energy],
        constraints: &Constraints,
        tolerance: f64,
        x: &[Vector3<f64>],
    ) -> f64 {
        assert_eq!((x.len(), constraints.n_nodes()), (self.gradient.len(), self.gradient.len()), "nodes");
        let params = &Params { tolerance, ..Params::default() };
        self.find_residual(&Problem { energies, constraints, params }, x).relative
    }

    /// One Newton step. While given coordinates still move, the free ones follow linearly, regardless of the energy.
    fn step(
        &mut self,
        problem: &Problem<'_>,
        moves: bool,
        residual: Residual,
        x: &mut [Vector3<f64>],
        info: &mut Info,
    ) -> Result<(), SolveError> {
        self.find_direction(problem, moves, x, info)?;
        let went =
            if moves { self.follow_given(problem, x, info) } else { self.search_line(problem, residual, x, info) };
        let (iterations, residual) = (info.iterations, residual.relative);
        went.then_some(()).ok_or(SolveError::LineSearch { iterations, residual })
    }

    /// Finds the remaining motion of given coordinates; returns whether any is left.
    fn find_motion(&mut self, constraints: &Constraints, x: &[Vector3<f64>]) -> bool {
        let mut moves = false;
        for (node, motion) in self.motion.iter_mut().enumerate() {
            *motion = constraints.remaining(node, &x[node]);
            moves |= *motion != Vector3::zeros();
        }
        moves
    }

    fn find_residual(&mut self, problem: &Problem<'_>, x: &[Vector3<f64>]) -> Residual {
        let mut largest_force = 0.0_f64;
        self.gradient.fill(Vector3::zeros());
        for energy in problem.energies {
            self.single.fill(Vector3::zeros());
            energy.add_gradient(x, &mut self.single);
            for (sum, force) in self.gradient.iter_mut().zip(&self.single) {
                *sum += force;
                largest_force = largest_force.max(force.norm());
            }
        }
        clear_given(&mut self.gradient, problem.constraints);
        let largest = self.gradient.iter().map(Vector3::norm).fold(0.0, nan_max);
        let norm = self.gradient.iter().map(Vector3::norm_squared).sum::<f64>().sqrt();
        let rounding = FORCE_ROUNDING * self.stiffness * x.iter().map(Vector3::amax).fold(0.0, f64::max);
        let scale = largest_force.max(rounding / problem.params.tolerance);
        Residual { relative: if largest == 0.0 { 0.0 } else { largest / scale }, norm }
    }
}

/// Whether the solve has converged.
fn is_done(
    problem: &Problem<'_>,
    info: &Info,
    moves: bool,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<bool, SolveError> {
    let Params { tolerance, max_iterations, .. } = *problem.params;
    let (iterations, residual) = (info.iterations, info.residuals.last().copied().unwrap_or(f64::NAN));
    if !residual.is_finite() {
        return Err(SolveError::NotFinite { iterations });
    }
    if observer(Progress { iteration: iterations, residual }).is_break() {
        return Err(SolveError::Cancelled { iterations });
    }
    let is_done = !moves && residual <= tolerance;
    if !is_done && iterations == max_iterations + info.lost_steps {
        return Err(SolveError::NotConverged { iterations, residual, tolerance });
    }
    Ok(is_done)
}

fn dot(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

fn clear_given(vectors: &mut [Vector3<f64>], constraints: &Constraints) {
    vectors.iter_mut().enumerate().for_each(|(node, v)| constraints.clear_given(node, v));
}

/// Unlike `f64::max`, keeps NaN.
fn nan_max(a: f64, b: f64) -> f64 {
    if b.is_nan() || a.is_nan() { f64::NAN } else { a.max(b) }
}
