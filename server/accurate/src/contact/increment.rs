//! One increment of the tool's motion: multipliers and friction bounds in turn with positions.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Vector3};

use super::friction::{Friction, FrictionRow};
use super::normal::NormalContact;
use super::press::{ContactParams, Press};
use super::state::ContactState;
use crate::energy::Energy;
use crate::newton::{Info, Params, Progress, SolveError, Solver};

/// Factor by which forces are found more exactly with every update of the multipliers.
const NEWTON_TIGHTENING: f64 = 0.1;

/// An increment under way.
pub(super) struct Increment<'a> {
    press: &'a Press<'a>,
    pose: Isometry3<f64>,
    penalties: Vec<f64>,
    pressures: Vec<f64>,
    rows: Vec<FrictionRow>,
}

/// Work done, failed increments included.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Work {
    pub(super) outer_iterations: u32,
    pub(super) newton_iterations: u32,
    pub(super) indefinite_steps: u32,
}

/// How well an increment's multipliers fit its positions.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Fit {
    /// Largest `|min(g, p / k)|` \[m\].
    pub(super) complementarity_m: f64,
    /// Largest slip that a traction below its bound still has, or excess over the bound as a displacement \[m\].
    pub(super) friction_m: f64,
    /// The larger one as a share of the face's size.
    pub(super) relative: f64,
    /// Deepest point inside the obstacle \[m\].
    pub(super) penetration_m: f64,
    pub(super) smallest_jacobian: Option<f64>,
    pub(super) residual: f64,
}

/// Why an increment has no result.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Failure {
    Solve(SolveError),
    /// The multipliers still moved after the last update.
    Unsettled(Fit),
}

impl<'a> Increment<'a> {
    /// Of the tool's motion to `pose`, from where it is in `state`.
    pub(super) fn new(press: &'a Press<'a>, state: &ContactState, pose: &Isometry3<f64>) -> Self {
        let ContactParams { young_modulus_pa, penalty_ratio, .. } = press.params;
        let turned = pose.rotation * state.pose.rotation.inverse();
        let anchors = state.anchors_at(pose, press.obstacle);
        let row = |(anchor, traction): (_, &Vector3<f64>)| FrictionRow {
            anchor,
            normal: Vector3::z(),
            multiplier_pa: turned * traction,
            bound_pa: 0.0,
        };
        let points = press.surface.points().iter();
        Self {
            press,
            pose: *pose,
            penalties: points.map(|point| penalty_ratio * young_modulus_pa / point.size_m).collect(),
            pressures: state.pressures_pa.clone(),
            rows: anchors.into_iter().zip(&state.tractions_pa).map(row).collect(),
        }
    }

    /// Moves `x` to equilibrium with contact at the pose.
    pub(super) fn solve(
        &mut self,
        solver: &mut Solver,
        x: &mut [Vector3<f64>],
        work: &mut Work,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Fit, Failure> {
        let params = self.press.params;
        let mut tolerance = params.first_newton_tolerance.max(params.newton_tolerance);
        let mut fit = Fit::default();
        for _ in 0..params.max_outer_iterations {
            self.turn_rows(x);
            let info = self.find_positions(solver, tolerance, x, work, observer).map_err(Failure::Solve)?;
            fit = self.update_multipliers(x);
            fit.smallest_jacobian = info.smallest_jacobian;
            fit.residual = info.residuals.last().copied().unwrap_or_default();
            if fit.relative <= params.gap_tolerance && fit.residual <= params.newton_tolerance {
                return Ok(fit);
            }
            tolerance = (NEWTON_TIGHTENING * tolerance).max(params.newton_tolerance);
        }
        Err(Failure::Unsettled(fit))
    }

    /// The tool is at the pose now.
    pub(super) fn commit(&self, x: &[Vector3<f64>], state: &mut ContactState) {
        state.pose = self.pose;
        state.pressures_pa.copy_from_slice(&self.pressures);
        for (q, row) in self.rows.iter().enumerate() {
            state.tractions_pa[q] = row.multiplier_pa;
            let holds = row.bound_pa > 0.0 && row.multiplier_pa.norm() < row.bound_pa;
            let anchor = if holds { row.anchor } else { self.press.surface.points()[q].position(x) };
            state.anchors[q] = self.pose.inverse_transform_point(&anchor);
        }
    }

    fn normal_contact(&self) -> NormalContact<'_> {
        NormalContact {
            surface: self.press.surface,
            obstacle: self.press.obstacle,
            pose: &self.pose,
            multipliers_pa: &self.pressures,
            penalties_pa_per_m: &self.penalties,
        }
    }

    fn find_positions(
        &self,
        solver: &mut Solver,
        tolerance: f64,
        x: &mut [Vector3<f64>],
        work: &mut Work,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Info, SolveError> {
        let normal = self.normal_contact();
        let friction = Friction { surface: self.press.surface, rows: &self.rows, penalties_pa_per_m: &self.penalties };
        let mut energies: Vec<&dyn Energy> = self.press.energies.to_vec();
        energies.push(&normal);
        energies.push(&friction);
        let params = Params { tolerance, max_iterations: self.press.params.max_newton_iterations };
        work.outer_iterations += 1;
        let mut last = 0;
        let mut watch = |progress: Progress| {
            last = progress.iteration;
            observer(progress)
        };
        let result = solver.minimise(&energies, self.press.constraints, &params, x, &mut watch);
        work.newton_iterations += last;
        work.indefinite_steps += result.as_ref().map_or(0, |info| info.indefinite_steps);
        result
    }

    /// Friction acts along the present tangent planes, under the present pressures.
    fn turn_rows(&mut self, x: &[Vector3<f64>]) {
        for (q, row) in self.rows.iter_mut().enumerate() {
            row.bound_pa = self.press.friction * self.pressures[q];
            if row.bound_pa > 0.0 {
                let position = self.press.surface.points()[q].position(x);
                row.normal = self.press.obstacle.gap(&self.pose, &position).normal;
                row.multiplier_pa -= row.normal * row.normal.dot(&row.multiplier_pa);
            }
        }
    }

    /// `l <- p` and, for friction, `l <- t`.
    fn update_multipliers(&mut self, x: &[Vector3<f64>]) -> Fit {
        let mut fit = Fit::default();
        for q in 0..self.pressures.len() {
            let (penalty, point) = (self.penalties[q], &self.press.surface.points()[q]);
            let (pressure, gap) = self.normal_contact().pressure(q, x);
            let row = &mut self.rows[q];
            let (traction, _) = row.traction(penalty, &point.position(x));
            let excess = (traction.norm() - self.press.friction * pressure).max(0.0);
            let complementarity = (pressure - self.pressures[q]).abs() / penalty;
            let friction = ((traction - row.multiplier_pa).norm() / penalty).max(excess / penalty);
            row.multiplier_pa = traction;
            self.pressures[q] = pressure;
            fit.complementarity_m = fit.complementarity_m.max(complementarity);
            fit.friction_m = fit.friction_m.max(friction);
            fit.relative = fit.relative.max(complementarity.max(friction) / point.size_m);
            fit.penetration_m = fit.penetration_m.max(-gap.distance_m);
        }
        fit
    }
}
