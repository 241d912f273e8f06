//! Applying loads in steps: a step that fails is halved, and grows again after successes.

use std::ops::ControlFlow;

use nalgebra::Vector3;
use plica_accurate::contact::{ContactProgress, ContactState};
use plica_accurate::{Energy, Params, SolveError, Solver};

use super::arc;
use super::checked::SolveOptions;
use super::extrapolation::{Extrapolation, Place};
use super::failure::{Failure, StepError};
use super::news::News;
use super::problem::Problem;
use super::solution::{LoadStep, Solution, Stability};
use super::stable;
use super::tool_contact::LoadedBody;

/// Newton steps taken in full before a line search takes over.
const MAX_FULL_STEPS: u32 = 25;

/// Applies the loads of `problem` from rest on. `observer` is called before every Newton step and may cancel.
///
/// # Errors
/// [`Failure`].
pub fn follow(
    problem: &Problem,
    options: &SolveOptions,
    observer: &mut dyn FnMut(News) -> ControlFlow<()>,
) -> Result<Solution, Failure> {
    if let Some(arc) = options.arc_length {
        return arc::follow(problem, options, &arc, observer);
    }
    let mut path = Path::new(problem, options).map_err(StepError::from)?;
    let (n_unknowns, n_factor_values) = path.solver.size();
    let mut state = State::at_rest(problem);
    let largest_step = problem.tool_contact().map_or(1.0, |tools| tools.longest_step(problem.tools()));
    let largest_step = largest_step.min(1.0 / f64::from(options.steps));
    let least_step = largest_step * 0.5_f64.powi(options.max_halvings as i32);
    let (mut reached, mut step, mut n_failed, mut n_left) = (0.0, largest_step, 0, 0);
    let (mut steps, mut past) = (Vec::new(), Extrapolation::default());
    past.push(state.place(problem, 0.0));
    while reached < 1.0 {
        // A remainder of rounding does not get a step of its own.
        let target = if reached + 1.01 * step >= 1.0 { 1.0 } else { reached + step };
        let mut trial = state.clone();
        if problem.tool_contact().is_none() {
            let mut guesses = past.guesses(target);
            if let Some(guess) = guesses.find(|guess| is_admissible(problem, &guess.x)) {
                (trial.x, trial.stresses) = (guess.x, guess.stresses);
            }
        }
        match path.attempt([reached, target], &mut trial, observer) {
            Ok(info) => {
                steps.push(info);
                (state, reached) = (trial, target);
                past.push(state.place(problem, reached));
                step = (2.0 * step).min(largest_step);
                if options.follow_stable && problem.tool_contact().is_none() {
                    let left = path.leave(reached, &mut state, observer)?;
                    n_left += left.len() as u32;
                    if !left.is_empty() {
                        past = Extrapolation::default();
                        past.push(state.place(problem, reached));
                    }
                    steps.extend(left);
                }
            }
            Err(error) if error.is_final() => return Err(error.into()),
            Err(error) if step <= least_step => return Err(Failure::Stuck { reached, target, error }),
            Err(_) => {
                n_failed += 1;
                step *= 0.5;
                past = Extrapolation::default();
                past.push(state.place(problem, reached));
            }
        }
    }
    let stability = path.stability(&state);
    let (tool_loads, contact_forces) = match (problem.tool_contact(), &state.contact) {
        (Some(tools), Some(contact)) => tools.loads(problem.tools(), contact, &state.x),
        _ => Default::default(),
    };
    Ok(Solution {
        x: state.x,
        share: 1.0,
        stability,
        n_left,
        limit_loads: Vec::new(),
        tool_loads,
        contact_forces,
        steps,
        n_failed,
        n_unknowns,
        n_factor_values,
    })
}

/// Equilibrium with its contact.
#[derive(Debug, Clone)]
struct State {
    x: Vec<Vector3<f64>>,
    contact: Option<ContactState>,
    /// Stresses of the first tangent, where `x` is a guess.
    stresses: Vec<f64>,
}

impl State {
    fn at_rest(problem: &Problem) -> Self {
        let x: Vec<_> = problem.mesh().nodes().iter().map(|node| node.coords).collect();
        let contact = problem.tool_contact().map(|tools| tools.untouched(problem.tools(), &x));
        Self { x, contact, stresses: Vec::new() }
    }

    fn place(&self, problem: &Problem, share: f64) -> Place {
        let stresses = problem.solid().carried_stresses(&self.x, &vec![Vector3::zeros(); self.x.len()]);
        Place { share, x: self.x.clone(), stresses }
    }
}

/// Whether a Newton solve may start at `x`.
fn is_admissible(problem: &Problem, x: &[Vector3<f64>]) -> bool {
    let solid = problem.solid();
    solid.value(x).is_finite() && solid.smallest_jacobian(x).is_none_or(|j| problem.is_linear() || j > 0.0)
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
        let solver = Solver::new(&problem.constraints_at(1.0), &problem.energies(&loads))?;
        let params = Params {
            tolerance: options.tolerance,
            max_iterations: options.max_iterations,
            max_full_steps: MAX_FULL_STEPS,
        };
        Ok(Self { problem, params, solver })
    }

    /// Moves `state` from the equilibrium under one share of the loads to that under another.
    fn attempt(
        &mut self,
        [reached, target]: [f64; 2],
        state: &mut State,
        observer: &mut dyn FnMut(News) -> ControlFlow<()>,
    ) -> Result<LoadStep, StepError> {
        let mut observe = |progress: plica_accurate::Progress| {
            observer(News { reached, target, iteration: progress.iteration, residual: progress.residual })
        };
        let loads = self.problem.loads_at(target);
        let energies = self.problem.energies(&loads);
        let constraints = self.problem.constraints_at(target);
        if let (Some(tools), Some(contact)) = (self.problem.tool_contact(), &mut state.contact) {
            let watch = &mut |progress: ContactProgress| observe(progress.newton);
            let tools_of = self.problem.tools();
            let body = LoadedBody { share: target, energies: &energies, constraints: &constraints, tools: tools_of };
            let info = tools.follow(&body, &mut self.solver, contact, &mut state.x, watch)?;
            return Ok(LoadStep::of_contact(target, &info));
        }
        // The solid is the first of the energies.
        let stresses = vec![std::mem::take(&mut state.stresses)];
        let info =
            self.solver.minimise_from(&energies, &constraints, &self.params, &mut state.x, stresses, &mut observe)?;
        Ok(LoadStep::new(target, info))
    }

    /// Leaves unstable equilibria along their softest modes, until one is stable or no way down is found; a load step for
    /// each.
    fn leave(
        &mut self,
        share: f64,
        state: &mut State,
        observer: &mut dyn FnMut(News) -> ControlFlow<()>,
    ) -> Result<Vec<LoadStep>, StepError> {
        let loads = self.problem.loads_at(share);
        let (energies, constraints) = (self.problem.energies(&loads), self.problem.constraints_at(share));
        let mut left = Vec::new();
        for _ in 0..stable::MAX_DEPARTURES {
            let Some(start) = stable::departure(&mut self.solver, &energies, &constraints, &state.x) else { break };
            let mut trial = State { x: start, contact: None, stresses: Vec::new() };
            match self.attempt([share, share], &mut trial, observer) {
                Ok(step) => left.push(step),
                Err(error) if error.is_final() => return Err(error),
                Err(_) => break,
            }
            state.x = trial.x;
        }
        Ok(left)
    }

    fn stability(&mut self, state: &State) -> Stability {
        let (problem, constraints) = (self.problem, self.problem.constraints_at(1.0));
        let loads = problem.loads_at(1.0);
        let energies = problem.energies(&loads);
        let n_negative = match (problem.tool_contact(), &state.contact) {
            (Some(tools), Some(contact)) => {
                let tools_of = problem.tools();
                let body = LoadedBody { share: 1.0, energies: &energies, constraints: &constraints, tools: tools_of };
                tools.n_negative(&body, &mut self.solver, contact, &state.x)
            }
            _ => self.solver.n_negative(&energies, &constraints, &state.x),
        };
        Stability::new(n_negative)
    }
}
