//! A press of the accurate model with contact of its own, pose by pose.

use nalgebra::{Isometry3, Vector3};
use plica_accurate::contact::{
    ContactError, ContactInfo, ContactParams, ContactProgress, ContactState, Obstacle, Press,
};
use plica_accurate::{Energy, TurnGuard};

use super::{Accurate, AccurateFailure, AccurateResult, GUARD_FLOOR, GUARD_STIFFNESSES, energies};
use crate::coarse::SolveObserver;
use crate::solve_info::SolveInfo;
use crate::tool_path::ToolPath;
use crate::worth::Unguarded;

/// Factors on the tolerances of pressures and forces at poses that a recorded path passes.
const PASSED: [f64; 2] = [3.0, 100.0];

/// A tool on its path.
#[derive(Debug, Clone, Copy)]
pub struct Touch<'a> {
    /// Shape of the tool.
    pub obstacle: &'a Obstacle,
    /// Coulomb, against the skin.
    pub friction: f64,
    /// From clear of the object to the pose at which the result is wanted.
    pub path: &'a ToolPath,
    /// Whether the path only passes its poses but the last; at those an equilibrium is found as loosely as on the way.
    pub passes: bool,
}

/// A press on its way.
struct Pressing<'a> {
    model: &'a mut Accurate,
    touch: Touch<'a>,
    x: Vec<Vector3<f64>>,
    state: ContactState,
    /// Number of guards that were not enough.
    n_guards: usize,
    work: SolveInfo,
    unguarded: Option<Box<Unguarded>>,
}

impl Accurate {
    /// From rest, with the model's own unilateral frictional contact. Where elements turn over or no equilibrium is found, the
    /// press goes on from there with a guard against it, as soft a one as suffices.
    ///
    /// # Errors
    /// See [`AccurateFailure`].
    pub fn pressed(
        &mut self,
        touch: Touch<'_>,
        observer: SolveObserver<'_>,
    ) -> Result<AccurateResult, AccurateFailure> {
        let mut x = self.rest.clone();
        if self.weight.is_some() {
            self.minimise(&[], None, &mut x, observer)?;
        }
        let poses = touch.path.poses();
        let state = ContactState::untouched(&self.surface, &poses[0], &x);
        let work = SolveInfo::default();
        let mut pressing = Pressing { model: self, touch, x, state, n_guards: 0, work, unguarded: None };
        let mut info = ContactInfo::default();
        for (n, pose) in poses.iter().enumerate().skip(1) {
            info = pressing.go_to(pose, touch.passes && n + 1 < poses.len(), observer)?;
        }
        let Pressing { model, x, work, unguarded, .. } = pressing;
        Ok(AccurateResult { offsets: model.offsets(&x), tool_force: info.force_n, solve: work, unguarded })
    }
}

impl Pressing<'_> {
    /// Moves the tool; with guards, each stiffer than the one before, until no element is turned over.
    fn go_to(
        &mut self,
        pose: &Isometry3<f64>,
        passes: bool,
        observer: SolveObserver<'_>,
    ) -> Result<ContactInfo, AccurateFailure> {
        let mut turned_over = false;
        loop {
            let found = self.follow(pose, passes, observer);
            let may_guard = self.n_guards < GUARD_STIFFNESSES.len();
            match found {
                Err(ContactError::Cancelled { .. }) => return Err(AccurateFailure::Interrupted),
                Err(error) if !may_guard => {
                    let last = Box::new(self.model.unguarded(&self.x, self.work));
                    return Err(AccurateFailure::Failed(error.to_string(), last));
                }
                Ok(info) if !self.work.is_turned_over() || !may_guard => {
                    let accepted = turned_over.then(|| self.model.offsets(&self.x));
                    self.unguarded.iter_mut().filter(|_| turned_over).for_each(|u| u.accepted.clone_from(&accepted));
                    return Ok(info);
                }
                found => turned_over |= self.unguarded.is_none() && found.is_ok(),
            }
            if self.unguarded.is_none() {
                self.unguarded = Some(Box::new(self.model.unguarded(&self.x, self.work)));
            }
            self.n_guards += 1;
        }
    }

    fn follow(
        &mut self,
        pose: &Isometry3<f64>,
        passes: bool,
        observer: SolveObserver<'_>,
    ) -> Result<ContactInfo, ContactError> {
        let Accurate { solid, weight, constraints, surface, contact, solver, .. } = &mut *self.model;
        let stiffness = self.n_guards.checked_sub(1).map(|n| GUARD_STIFFNESSES[n]);
        let guard = stiffness.map(|stiffness_ratio| TurnGuard { solid, floor: GUARD_FLOOR, stiffness_ratio });
        let mut energies = energies(solid, weight, &[]);
        energies.extend(guard.iter().map(|g| g as &dyn Energy));
        let [looser_pressures, looser_forces] = if passes { PASSED } else { [1.0; 2] };
        let setting = Press {
            energies: &energies,
            constraints,
            surface,
            obstacle: self.touch.obstacle,
            friction: self.touch.friction,
            params: ContactParams {
                pressure_tolerance: looser_pressures * contact.pressure_tolerance,
                newton_tolerance: looser_forces * contact.newton_tolerance,
                ..*contact
            },
        };
        let mut work = self.work;
        let mut watch = |progress: ContactProgress| {
            work.residual = progress.newton.residual;
            work.iterations += u32::from(progress.newton.iteration > 0);
            observer()
        };
        let found = setting.follow(&[*pose], solver, &mut self.state, &mut self.x, &mut watch);
        work.smallest_jacobian = energies.iter().filter_map(|e| e.smallest_jacobian(&self.x)).fold(1.0, f64::min);
        self.work = work;
        if let Ok(info) = &found {
            self.work.residual = info.residual;
            self.work.indefinite_steps += info.indefinite_steps;
        }
        found
    }
}
