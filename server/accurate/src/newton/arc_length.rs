//! Equilibria along their path, with the share of the loads as an unknown: past limit points, where the share turns.

use std::ops::ControlFlow;

use nalgebra::Vector3;

use super::report::{Info, Params, Progress, SolveError};
use super::{Problem, Residual, Solver, clear_given, dot, gmres};
use crate::constraints::Constraints;
use crate::energy::{Energy, Projection};
use crate::newton::sufficient_decrease::Total;

/// Motion of a node in the corrections of a step, as a share of the step, beyond which it has left the path.
const FARTHEST: f64 = 3.0;

/// Body under a share of its loads, which are proportional to it.
#[derive(Clone, Copy)]
pub struct Loading<'a> {
    /// Energies without loads.
    pub body: &'a [&'a dyn Energy],
    /// A share of the loads.
    pub loads_at: &'a dyn Fn(f64) -> Vec<Box<dyn Energy>>,
    /// Supports, which stay.
    pub constraints: &'a Constraints,
}

/// Place on a path of equilibria.
#[derive(Debug, Clone, PartialEq)]
pub struct ArcState {
    /// Positions of the nodes, `[n_nodes]` \[m\].
    pub x: Vec<Vector3<f64>>,
    /// Share of the loads.
    pub share: f64,
    /// Motion of the nodes in the last step \[m\]; empty before the first.
    pub last: Vec<Vector3<f64>>,
}

/// Equation of a step beside equilibrium.
#[derive(Clone, Copy)]
enum Condition<'a> {
    /// Corrections are orthogonal to the predicted motion.
    Normal(&'a [Vector3<f64>]),
    /// The share stays.
    FixedShare,
}

impl Solver {
    /// Moves `state` to the next equilibrium, `step_m` \[m\] away along the path as measured by the farthest node: the tangent
    /// of the path, then Newton's method in its normal plane \[Riks79\], \[Wem71\]. The matrix need not be positive definite. The
    /// first step raises the share, every further one goes on in the direction of the last.
    ///
    /// # Errors
    /// See [`SolveError`]; `state` is unchanged then.
    ///
    /// # Panics
    /// If lengths are not those of the analysis.
    pub fn arc_step(
        &mut self,
        loading: &Loading<'_>,
        params: &Params,
        step_m: f64,
        state: &mut ArcState,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Info, SolveError> {
        let along = self.path_tangent(loading, &state.x, state.share)?;
        let backward = !state.last.is_empty() && dot(&along, &state.last) < 0.0;
        let farthest = along.iter().map(Vector3::norm).fold(f64::MIN_POSITIVE, f64::max);
        let share_step = if backward { -step_m / farthest } else { step_m / farthest };
        let mut next = state.clone();
        next.share += share_step;
        next.last = along.iter().map(|v| v * share_step).collect();
        next.x.iter_mut().zip(&next.last).for_each(|(x, v)| *x += v);
        let normal = next.last.clone();
        let info = self.correct(loading, params, Condition::Normal(&normal), step_m, &mut next, observer)?;
        next.last = next.x.iter().zip(&state.x).map(|(x, before)| x - before).collect();
        *state = next;
        Ok(info)
    }

    /// Moves `state`, near the path, to the equilibrium under its own share.
    ///
    /// # Errors
    /// See [`SolveError`]; `state` is unchanged then.
    ///
    /// # Panics
    /// If lengths are not those of the analysis.
    pub fn settle(
        &mut self,
        loading: &Loading<'_>,
        params: &Params,
        reach_m: f64,
        state: &mut ArcState,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Info, SolveError> {
        let mut next = state.clone();
        let info = self.correct(loading, params, Condition::FixedShare, reach_m, &mut next, observer)?;
        *state = next;
        Ok(info)
    }

    /// Newton's method for equilibrium and the condition.
    fn correct(
        &mut self,
        loading: &Loading<'_>,
        params: &Params,
        condition: Condition<'_>,
        step_m: f64,
        state: &mut ArcState,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Info, SolveError> {
        let mut info = Info::default();
        let predicted = state.x.clone();
        loop {
            let iterations = info.iterations;
            let Residual { relative: residual, .. } = self
                .with_energies(loading, state.share, |solver, problem| {
                    let is_finite = Total::of(problem.energies, &state.x).value.is_finite();
                    let found = solver.find_residual(problem, &state.x);
                    is_finite.then_some(found).filter(|found| found.relative.is_finite())
                })
                .ok_or(SolveError::NotFinite { iterations })?;
            info.residuals.push(residual);
            if observer(Progress { iteration: iterations, residual }).is_break() {
                return Err(SolveError::Cancelled { iterations });
            }
            if residual <= params.tolerance {
                break;
            }
            let tolerance = params.tolerance;
            if iterations == params.max_iterations || farthest(&state.x, &predicted) > FARTHEST * step_m {
                return Err(SolveError::NotConverged { iterations, residual, tolerance });
            }
            let down: Vec<_> = self.gradient.iter().map(|g| -g).collect();
            let full = self.full_loads(loading, &state.x);
            let solved = self.with_energies(loading, state.share, |solver, problem| {
                solver
                    .factorise_tangent(problem, &state.x)
                    .then(|| [down, full].map(|b| solver.solve_tangent(problem, &state.x, b)))
            });
            let [relaxed, loaded] = solved.ok_or(SolveError::Singular { iterations })?;
            let share_step = match condition {
                Condition::Normal(normal) => -dot(normal, &relaxed) / dot(normal, &loaded),
                Condition::FixedShare => 0.0,
            };
            state.share += share_step;
            for (x, (a, b)) in state.x.iter_mut().zip(relaxed.iter().zip(&loaded)) {
                *x += a + b * share_step;
            }
            info.iterations += 1;
        }
        info.smallest_jacobian = loading.body.iter().filter_map(|e| e.smallest_jacobian(&state.x)).reduce(f64::min);
        Ok(info)
    }

    /// `dx / dshare` of the path.
    fn path_tangent(
        &mut self,
        loading: &Loading<'_>,
        x: &[Vector3<f64>],
        share: f64,
    ) -> Result<Vec<Vector3<f64>>, SolveError> {
        let full = self.full_loads(loading, x);
        let along = self.with_energies(loading, share, |solver, problem| {
            solver.factorise_tangent(problem, x).then(|| solver.solve_tangent(problem, x, full))
        });
        along.ok_or(SolveError::Singular { iterations: 0 })
    }

    fn with_energies<T>(
        &mut self,
        loading: &Loading<'_>,
        share: f64,
        act: impl FnOnce(&mut Self, &Problem<'_>) -> T,
    ) -> T {
        let loads = (loading.loads_at)(share);
        let energies: Vec<&dyn Energy> = loading.body.iter().copied().chain(loads.iter().map(Box::as_ref)).collect();
        let params = Params::default();
        act(self, &Problem { energies: &energies, constraints: loading.constraints, params: &params })
    }

    /// Forces of the full loads at free coordinates \[N\].
    fn full_loads(&mut self, loading: &Loading<'_>, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); x.len()];
        (loading.loads_at)(1.0).iter().for_each(|load| load.add_gradient(x, &mut forces));
        forces.iter_mut().for_each(|force| *force = -*force);
        clear_given(&mut forces, loading.constraints);
        forces
    }

    fn factorise_tangent(&mut self, problem: &Problem<'_>, x: &[Vector3<f64>]) -> bool {
        self.factorise(problem, [Projection::Exact; 2], false, x)
            || self.factor.factorise_indefinite(&self.hessian).is_ok()
    }

    /// `(H + R)^-1 b` on the factorised tangent `H`, with the remainder `R` of follower loads.
    fn solve_tangent(&mut self, problem: &Problem<'_>, x: &[Vector3<f64>], b: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
        let mut found = vec![Vector3::zeros(); b.len()];
        let (hessian, factor, product) = (&self.hessian, &mut self.factor, &mut self.single);
        factor.solve(hessian, &b, &mut found);
        if !problem.has_potential() {
            gmres::solve(&mut found, |v, out| {
                product.fill(Vector3::zeros());
                problem.energies.iter().for_each(|e| e.add_remainder_product(x, v, Projection::Exact, product));
                clear_given(product, problem.constraints);
                factor.solve(hessian, product, out);
            });
        }
        found
    }
}

fn farthest(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}
