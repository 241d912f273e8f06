//! A rigid tool moved along a path of poses against a solid: equilibrium with unilateral frictional contact.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Vector3};

use super::increment::{Failure, Fit, Increment, Work};
use super::obstacle::Obstacle;
use super::report::resultant;
use super::state::ContactState;
use super::surface::ContactSurface;
use crate::constraints::Constraints;
use crate::energy::Energy;
use crate::newton::{Progress, SolveError, Solver};

/// A solid and what it is pressed with.
#[derive(Clone, Copy)]
pub struct Press<'a> {
    /// The solid and its loads.
    pub energies: &'a [&'a dyn Energy],
    /// Supports.
    pub constraints: &'a Constraints,
    /// Where contact is looked for.
    pub surface: &'a ContactSurface,
    /// The tool's shape.
    pub obstacle: &'a Obstacle,
    /// Coulomb friction coefficient, `mu`.
    pub friction: f64,
    /// How it is solved.
    pub params: ContactParams,
}

/// How contact is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactParams {
    /// The solid's Young's modulus, or one of that size \[Pa\]: the scale of penalties.
    pub young_modulus_pa: f64,
    /// Longest motion of the tool in one increment \[m\].
    pub max_increment_m: f64,
    /// Penalty of a contact point over `young_modulus_pa / size of its face`.
    pub penalty_ratio: f64,
    /// Largest error of complementarity and of sticking, as a share of the size of the point's face.
    pub gap_tolerance: f64,
    /// Largest force left at a free coordinate, as a share of the largest nodal force of any single energy.
    pub newton_tolerance: f64,
    /// The same before the multipliers are updated for the first time.
    pub first_newton_tolerance: f64,
    /// Updates of the multipliers after which an increment is given up.
    pub max_outer_iterations: u32,
    /// Newton steps between two updates after which an increment is given up.
    pub max_newton_iterations: u32,
    /// How often a failed increment is halved before the press is given up.
    pub max_halvings: u32,
}

impl ContactParams {
    /// The defaults, for a solid of `young_modulus_pa` and increments of at most `max_increment_m`.
    pub fn new(young_modulus_pa: f64, max_increment_m: f64) -> Self {
        Self {
            young_modulus_pa,
            max_increment_m,
            penalty_ratio: 20.0,
            gap_tolerance: 1e-3,
            newton_tolerance: 1e-6,
            first_newton_tolerance: 1e-2,
            max_outer_iterations: 30,
            max_newton_iterations: 30,
            max_halvings: 5,
        }
    }
}

/// How a press went.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ContactInfo {
    /// Force on the tool \[N\].
    pub force_n: Vector3<f64>,
    /// Torque on the tool about its origin \[N m\].
    pub torque_nm: Vector3<f64>,
    /// Reference area of the points in contact \[m^2\].
    pub area_m2: f64,
    /// Points in contact.
    pub n_touching: usize,
    /// Deepest contact point inside the tool \[m\].
    pub max_penetration_m: f64,
    /// Largest `|min(g, p / k)|`: penetration, or pressure across a gap \[m\].
    pub complementarity_m: f64,
    /// Largest slip of a point that sticks, or excess of a traction over its bound over the penalty \[m\].
    pub friction_error_m: f64,
    /// Force left at a free coordinate, as a share of the largest nodal force.
    pub residual: f64,
    /// Increments solved.
    pub increments: u32,
    /// Increments that failed and were halved.
    pub failed_increments: u32,
    /// Solves between updates of multipliers.
    pub outer_iterations: u32,
    /// Newton steps.
    pub newton_iterations: u32,
    /// Newton steps whose matrix was not positive definite.
    pub indefinite_steps: u32,
    /// Smallest `det F` of the result, where an energy has one.
    pub smallest_jacobian: Option<f64>,
}

/// What the callback is told before every Newton step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactProgress {
    /// Share of the path that the present increment ends at.
    pub share: f64,
    /// Increments solved.
    pub increments: u32,
    /// The solve under way.
    pub newton: Progress,
}

/// Why a press has no result. Positions and state are those of the last increment that was solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// The callback asked to stop.
    #[error("cancelled at {:.0} % of the path", 100.0 * share)]
    Cancelled {
        /// Share of the path that was reached.
        share: f64,
    },
    /// A solve failed, even in small increments.
    #[error("at {:.0} % of the path, in an increment halved {halvings} times: {source}", 100.0 * share)]
    Solve {
        /// Share of the path that was reached.
        share: f64,
        /// Halvings.
        halvings: u32,
        /// What failed.
        source: SolveError,
    },
    /// Pressures and friction do not come to rest, even in small increments.
    #[error(
        "at {:.0} % of the path, in an increment halved {halvings} times: complementarity is off by {complementarity_m:.1e} \
         m, friction by {friction_m:.1e} m, after {max_outer_iterations} updates",
        100.0 * share
    )]
    Unsettled {
        /// Share of the path that was reached.
        share: f64,
        /// Halvings.
        halvings: u32,
        /// Error of complementarity \[m\].
        complementarity_m: f64,
        /// Error of friction \[m\].
        friction_m: f64,
        /// Updates of the multipliers.
        max_outer_iterations: u32,
    },
}

/// Moves the tool from where it is in `state` through the poses of `path` and solves for equilibrium on the way; friction
/// depends on the path. `x: [n_nodes]` \[m\] and `state` are carried along; both start as an equilibrium, for instance at
/// rest and untouched. `solver` was made for the same energies and constraints.
///
/// # Errors
/// See [`ContactError`].
pub fn press(
    press: &Press<'_>,
    path: &[Isometry3<f64>],
    solver: &mut Solver,
    state: &mut ContactState,
    x: &mut [Vector3<f64>],
    observer: &mut dyn FnMut(ContactProgress) -> ControlFlow<()>,
) -> Result<ContactInfo, ContactError> {
    let mut run =
        Run { press, n_legs: path.len(), info: ContactInfo::default(), work: Work::default(), fit: Fit::default() };
    for (leg, pose) in path.iter().enumerate() {
        run.follow(leg, pose, solver, state, x, observer)?;
    }
    Ok(run.finish(state, x))
}

/// A press under way.
struct Run<'a> {
    press: &'a Press<'a>,
    n_legs: usize,
    info: ContactInfo,
    work: Work,
    fit: Fit,
}

impl Run<'_> {
    /// One leg of the path, in increments.
    fn follow(
        &mut self,
        leg: usize,
        pose: &Isometry3<f64>,
        solver: &mut Solver,
        state: &mut ContactState,
        x: &mut [Vector3<f64>],
        observer: &mut dyn FnMut(ContactProgress) -> ControlFlow<()>,
    ) -> Result<(), ContactError> {
        let start = *state.pose();
        let n_increments = (self.motion(&start, pose, x) / self.press.params.max_increment_m).ceil().max(1.0);
        let (mut done, mut halvings) = (0.0, 0);
        let mut before: Option<(Vec<Vector3<f64>>, f64)> = None;
        while done < n_increments {
            let step = 0.5_f64.powi(halvings as i32);
            let increments = self.info.increments;
            let share_of_path = |done: f64| (leg as f64 + done / n_increments) / self.n_legs as f64;
            let share = share_of_path(done + step);
            let target = between(&start, pose, (done + step) / n_increments);
            let here = x.to_vec();
            if let Some((last, last_step)) = &before {
                self.extrapolate(last, step / last_step, x);
            }
            let mut increment = Increment::new(self.press, state, &target);
            let mut watch = |newton| observer(ContactProgress { share, increments, newton });
            match increment.solve(solver, x, &mut self.work, &mut watch) {
                Ok(fit) => {
                    increment.commit(x, state);
                    self.fit = fit;
                    self.info.increments += 1;
                    done += step;
                    before = Some((here, step));
                    // Back to whole increments, from where one begins.
                    while halvings > 0 && (done * 0.5_f64.powi(1 - halvings as i32)).fract() == 0.0 {
                        halvings -= 1;
                    }
                }
                Err(failure) => {
                    x.copy_from_slice(&here);
                    before = None;
                    self.info.failed_increments += 1;
                    let last = failure.fatal(share_of_path(done), halvings, &self.press.params);
                    if let Some(error) = last {
                        return Err(error);
                    }
                    halvings += 1;
                }
            }
        }
        Ok(())
    }

    /// Farthest that the motion carries a contact point \[m\].
    fn motion(&self, from: &Isometry3<f64>, to: &Isometry3<f64>, x: &[Vector3<f64>]) -> f64 {
        let carry = to * from.inverse();
        let points = self.press.surface.points().iter().map(|point| point.position(x));
        points.map(|p| (carry * p - p).norm()).fold(0.0, f64::max)
    }

    /// `x += ratio (x - last)`, if the energies allow it.
    fn extrapolate(&self, last: &[Vector3<f64>], ratio: f64, x: &mut [Vector3<f64>]) {
        let trial: Vec<_> = x.iter().zip(last).map(|(x, last)| x + (x - last) * ratio).collect();
        let is_upright = |energy: &&dyn Energy| energy.smallest_jacobian(&trial).is_none_or(|j| j > 0.0);
        let energies = self.press.energies;
        if energies.iter().all(|energy| is_upright(energy) && energy.value(&trial).is_finite()) {
            x.copy_from_slice(&trial);
        }
    }

    fn finish(self, state: &ContactState, x: &[Vector3<f64>]) -> ContactInfo {
        let resultant = resultant(self.press, state, x);
        ContactInfo {
            force_n: resultant.force_n,
            torque_nm: resultant.torque_nm,
            area_m2: resultant.area_m2,
            n_touching: resultant.n_touching,
            max_penetration_m: self.fit.penetration_m,
            complementarity_m: self.fit.complementarity_m,
            friction_error_m: self.fit.friction_m,
            residual: self.fit.residual,
            smallest_jacobian: self.fit.smallest_jacobian,
            outer_iterations: self.work.outer_iterations,
            newton_iterations: self.work.newton_iterations,
            indefinite_steps: self.work.indefinite_steps,
            ..self.info
        }
    }
}

impl Failure {
    /// The error to give up with, if halving the increment cannot help or was done often enough.
    fn fatal(self, share: f64, halvings: u32, params: &ContactParams) -> Option<ContactError> {
        let is_last = halvings == params.max_halvings;
        match self {
            Self::Solve(SolveError::Cancelled { .. }) => Some(ContactError::Cancelled { share }),
            Self::Solve(source @ SolveError::Factor(_)) => Some(ContactError::Solve { share, halvings, source }),
            Self::Solve(source) => is_last.then_some(ContactError::Solve { share, halvings, source }),
            Self::Unsettled(fit) => is_last.then_some(ContactError::Unsettled {
                share,
                halvings,
                complementarity_m: fit.complementarity_m,
                friction_m: fit.friction_m,
                max_outer_iterations: params.max_outer_iterations,
            }),
        }
    }
}

/// Straight from one origin to the other, turning evenly.
fn between(from: &Isometry3<f64>, to: &Isometry3<f64>, share: f64) -> Isometry3<f64> {
    if share >= 1.0 { *to } else { from.try_lerp_slerp(to, share, 1e-12).unwrap_or(*to) }
}
