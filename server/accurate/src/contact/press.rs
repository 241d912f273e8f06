//! A rigid tool moved along a path of poses against a solid: equilibrium with unilateral frictional contact.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Point3, Vector3};

use super::increment::{Failure, Fit, Increment};
use super::leg::Leg;
use super::obstacle::Obstacle;
use super::outcome::{ContactError, ContactInfo, ContactProgress};
use super::params::ContactParams;
use super::report::report;
use super::state::ContactState;
use super::surface::ContactSurface;
use crate::constraints::Constraints;
use crate::energy::Energy;
use crate::newton::{Progress, Solver};

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

impl Press<'_> {
    /// Moves the tool from where it is in `state` through the poses of `path` and solves for equilibrium on the way; friction
    /// depends on the path. `x: [n_nodes]` \[m\] and `state` are carried along; both start as an equilibrium, for instance
    /// at rest and untouched. `solver` was made for the same energies and constraints.
    ///
    /// # Errors
    /// See [`ContactError`].
    ///
    /// # Panics
    /// If `max_increment_m` is not positive, or a length is not that of the solver or the surface.
    pub fn follow(
        &self,
        path: &[Isometry3<f64>],
        solver: &mut Solver,
        state: &mut ContactState,
        x: &mut [Vector3<f64>],
        observer: &mut dyn FnMut(ContactProgress) -> ControlFlow<()>,
    ) -> Result<ContactInfo, ContactError> {
        assert!(self.params.max_increment_m > 0.0, "increments must have a length");
        let mut run = Run { press: self, solver, state, x, info: ContactInfo::default(), fit: Fit::default() };
        for (n, pose) in path.iter().enumerate() {
            let share_of_path = |share: f64| (n as f64 + share) / path.len() as f64;
            run.follow_leg(pose, &share_of_path, observer)?;
        }
        Ok(run.finish())
    }

    /// Farthest that a motion of the tool carries its origin or a point that it may be touching \[m\].
    fn motion_m(&self, from: &Isometry3<f64>, to: &Isometry3<f64>, x: &[Vector3<f64>]) -> f64 {
        let is_near = |p: &Point3<f64>| {
            [from, to].iter().any(|pose| self.obstacle.distance(pose, p) < self.params.max_increment_m)
        };
        let carry = to * from.inverse();
        let points = self.surface.points().iter().map(|point| point.position(x)).filter(is_near);
        let origin = (to.translation.vector - from.translation.vector).norm();
        points.map(|p| (carry * p - p).norm()).fold(origin, f64::max)
    }

    /// `x + ratio (x - last)`, if the energies allow it.
    fn extrapolate(&self, last: &[Vector3<f64>], ratio: f64, x: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
        let trial: Vec<_> = x.iter().zip(last).map(|(x, last)| x + (x - last) * ratio).collect();
        let is_fine = |energy: &&dyn Energy| {
            energy.smallest_jacobian(&trial).is_none_or(|j| j > 0.0) && energy.value(&trial).is_finite()
        };
        self.energies.iter().all(is_fine).then_some(trial)
    }
}

/// A press under way.
struct Run<'a> {
    press: &'a Press<'a>,
    solver: &'a mut Solver,
    state: &'a mut ContactState,
    x: &'a mut [Vector3<f64>],
    info: ContactInfo,
    fit: Fit,
}

impl Run<'_> {
    /// Increment by increment; each begins with the motion of the one before, continued.
    fn follow_leg(
        &mut self,
        pose: &Isometry3<f64>,
        share_of_path: &dyn Fn(f64) -> f64,
        observer: &mut dyn FnMut(ContactProgress) -> ControlFlow<()>,
    ) -> Result<(), ContactError> {
        let start = *self.state.pose();
        let motion_m = self.press.motion_m(&start, pose, self.x);
        let mut leg = Leg::new(&start, pose, motion_m, self.press.params.max_increment_m);
        let mut before: Option<(Vec<Vector3<f64>>, f64)> = None;
        while !leg.is_over() {
            let here = self.x.to_vec();
            let guess =
                before.as_ref().and_then(|(last, step)| self.press.extrapolate(last, leg.step() / step, self.x));
            if let Some(guess) = guess {
                self.x.copy_from_slice(&guess);
            }
            let (share, increments) = (share_of_path(leg.next_share()), self.info.increments);
            let mut watch = |newton| observer(ContactProgress { share, increments, newton });
            match self.solve(&leg, &mut watch) {
                Ok(()) => {
                    before = Some((here, leg.step()));
                    leg.advance();
                }
                Err(failure) => {
                    self.x.copy_from_slice(&here);
                    self.info.failed_increments += 1;
                    failure.give_up(share_of_path(leg.share()), leg.halvings(), &self.press.params)?;
                    before = None;
                    leg.halve();
                }
            }
        }
        Ok(())
    }

    fn solve(&mut self, leg: &Leg, observer: &mut dyn FnMut(Progress) -> ControlFlow<()>) -> Result<(), Failure> {
        let is_on_the_way = leg.next_share() < 1.0;
        let mut increment = Increment::new(self.press, self.state, &leg.target(), is_on_the_way);
        self.fit = increment.solve(self.solver, self.x, &mut self.info, observer)?;
        increment.commit(self.x, self.state);
        self.info.increments += 1;
        Ok(())
    }

    fn finish(self) -> ContactInfo {
        let info = ContactInfo {
            pressure_change: self.fit.pressure_change.max(self.fit.traction_change),
            residual: self.fit.residual,
            smallest_jacobian: self.fit.smallest_jacobian,
            ..self.info
        };
        report(self.press, self.state, self.x, info)
    }
}
