//! The path of a tool, pose by pose: equilibrium with unilateral frictional contact.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Vector3};

use super::increment::{Failure, Fit, Increment};
use super::press::Press;
use super::report::report;
use super::result::{ContactError, ContactInfo, ContactProgress};
use super::state::ContactState;
use super::step_size::Increments;
use crate::newton::{Progress, Solver};

impl Press<'_> {
    /// Moves the tool from its pose in `state` through the poses of `path`, in equilibrium; friction
    /// depends on the path. `x: [n_nodes]` \[m\] and `state` are updated; both start in equilibrium, for instance at
    /// rest without contact. `solver` was made for the same energies and constraints.
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
            run.follow_to(pose, &share_of_path, observer)?;
        }
        Ok(run.finish())
    }
}

/// State of a running press.
struct Run<'a> {
    press: &'a Press<'a>,
    solver: &'a mut Solver,
    state: &'a mut ContactState,
    x: &'a mut [Vector3<f64>],
    info: ContactInfo,
    fit: Fit,
}

impl Run<'_> {
    /// Moves the tool to `pose` in increments; each starts from an extrapolation of the one before.
    fn follow_to(
        &mut self,
        pose: &Isometry3<f64>,
        share_of_path: &dyn Fn(f64) -> f64,
        observer: &mut dyn FnMut(ContactProgress) -> ControlFlow<()>,
    ) -> Result<(), ContactError> {
        let start = *self.state.pose();
        let motion_m = self.press.motion_m(&start, pose, self.x);
        let mut increments = Increments::new(&start, pose, motion_m, self.press.params.max_increment_m);
        let mut before: Option<(Vec<Vector3<f64>>, f64)> = None;
        while !increments.is_over() {
            let here = self.x.to_vec();
            let guess =
                before.as_ref().and_then(|(last, step)| self.press.extrapolate(last, increments.step() / step, self.x));
            if let Some(guess) = guess {
                self.x.copy_from_slice(&guess);
            }
            let (share, n_solved) = (share_of_path(increments.next_share()), self.info.increments);
            let mut watch = |newton| observer(ContactProgress { share, increments: n_solved, newton });
            match self.solve(&increments, &mut watch) {
                Ok(()) => {
                    before = Some((here, increments.step()));
                    increments.advance();
                }
                Err(failure) => {
                    self.x.copy_from_slice(&here);
                    self.info.failed_increments += 1;
                    failure.give_up(share_of_path(increments.share()), increments.halvings(), &self.press.params)?;
                    before = None;
                    increments.halve();
                }
            }
        }
        Ok(())
    }

    fn solve(
        &mut self,
        increments: &Increments,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<(), Failure> {
        let is_on_the_way = increments.next_share() < 1.0;
        let mut increment = Increment::new(self.press, self.state, &increments.target(), is_on_the_way);
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
