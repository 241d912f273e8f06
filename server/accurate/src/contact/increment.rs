//! One increment of the tool's motion: multipliers and friction bounds in turn with positions.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Vector3};

use super::friction::{Friction, FrictionRow};
use super::normal::NormalContact;
use super::params::ContactParams;
use super::press::Press;
use super::result::{ContactError, ContactInfo};
use super::state::ContactState;
use crate::energy::Energy;
use crate::newton::{Info, Params, Progress, SolveError, Solver};

/// Residual of a solve between two updates, as a share of the first: about one Newton step.
const LEFT_TO_NEXT: f64 = 0.3;
/// Factors on the tolerances of pressures and forces in increments that end between two waypoints.
const ON_THE_WAY: [f64; 2] = [3.0, 100.0];

/// State of a running increment.
pub(super) struct Increment<'a> {
    press: &'a Press<'a>,
    pose: Isometry3<f64>,
    pressure_tolerance: f64,
    newton_tolerance: f64,
    /// `[n_points]`, like all arrays below.
    penalties: Vec<f64>,
    friction_penalties: Vec<f64>,
    pressures: Vec<f64>,
    tractions: Vec<Vector3<f64>>,
    /// Multipliers of the pressure.
    multipliers: Vec<f64>,
    rows: Vec<FrictionRow>,
}

/// Convergence of pressures and positions.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Fit {
    /// Change of the pressures' continuous part in the last solve, as a share of the largest pressure.
    pub(super) pressure_change: f64,
    /// The same of tractions.
    pub(super) traction_change: f64,
    /// Largest force left at a free coordinate, as a share of the largest nodal force.
    pub(super) residual: f64,
    pub(super) smallest_jacobian: Option<f64>,
}

/// Failure of an increment.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Failure {
    Solve(SolveError),
    /// Pressures not settled after the last update.
    Unsettled(Fit),
}

impl Failure {
    /// The error, unless the increment may be halved once more.
    pub(super) fn give_up(self, share: f64, halvings: u32, params: &ContactParams) -> Result<(), ContactError> {
        let may_help = halvings < params.max_halvings;
        match self {
            Self::Solve(SolveError::Cancelled { .. }) => Err(ContactError::Cancelled { share }),
            Self::Solve(source @ SolveError::Factor(_)) => Err(ContactError::Solve { share, halvings, source }),
            _ if may_help => Ok(()),
            Self::Solve(source) => Err(ContactError::Solve { share, halvings, source }),
            Self::Unsettled(fit) => Err(ContactError::Unsettled {
                share,
                halvings,
                pressure_change: fit.pressure_change,
                traction_change: fit.traction_change,
                max_updates: params.max_updates,
            }),
        }
    }
}

impl<'a> Increment<'a> {
    /// From the tool pose in `state` to `pose`, a waypoint or a point between two.
    pub(super) fn new(press: &'a Press<'a>, state: &ContactState, pose: &Isometry3<f64>, is_on_the_way: bool) -> Self {
        let ContactParams { young_modulus_pa, penalty_ratio, friction_penalty_ratio, .. } = press.params;
        let [looser_pressures, looser_forces] = if is_on_the_way { ON_THE_WAY } else { [1.0; 2] };
        let penalties = |ratio: f64| {
            let sizes = press.surface.points().iter().map(|point| point.size_m);
            sizes.map(|size| ratio * young_modulus_pa / size).collect()
        };
        let turned = pose.rotation * state.pose.rotation.inverse();
        let row = |anchor| FrictionRow { anchor, normal: Vector3::z(), multiplier_pa: Vector3::zeros(), bound_pa: 0.0 };
        Self {
            press,
            pose: *pose,
            pressure_tolerance: looser_pressures * press.params.pressure_tolerance,
            newton_tolerance: looser_forces * press.params.newton_tolerance,
            penalties: penalties(penalty_ratio),
            friction_penalties: penalties(friction_penalty_ratio),
            pressures: state.pressures_pa.clone(),
            tractions: state.tractions_pa.iter().map(|traction| turned * traction).collect(),
            multipliers: vec![0.0; state.pressures_pa.len()],
            rows: state.anchors_at(pose, press.obstacle).into_iter().map(row).collect(),
        }
    }

    /// Moves `x` to equilibrium with contact at the pose; counts iterations in `work`.
    pub(super) fn solve(
        &mut self,
        solver: &mut Solver,
        x: &mut [Vector3<f64>],
        work: &mut ContactInfo,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Fit, Failure> {
        let (mut fit, mut is_settled) = (Fit::default(), false);
        for _ in 0..self.press.params.max_updates {
            self.update_multipliers(x);
            let tolerance = |residual: f64| if is_settled { 0.0 } else { LEFT_TO_NEXT * residual };
            let info = self.find_positions(solver, tolerance, x, work, observer).map_err(Failure::Solve)?;
            fit = self.find_pressures(x);
            fit.residual = info.residuals.last().copied().unwrap_or_default();
            fit.smallest_jacobian = info.smallest_jacobian;
            is_settled = fit.pressure_change.max(fit.traction_change) <= self.pressure_tolerance;
            if is_settled && fit.residual <= self.newton_tolerance {
                return Ok(fit);
            }
        }
        Err(Failure::Unsettled(fit))
    }

    /// Moves the state's tool to the pose. A sticking point keeps its anchor; a sliding point gets the anchor of its
    /// traction \[SH98, ch. 2\].
    pub(super) fn commit(&self, x: &[Vector3<f64>], state: &mut ContactState) {
        let multipliers = self.press.surface.continuous_part(&self.tractions);
        for (q, row) in self.rows.iter().enumerate() {
            let (traction, position) = (self.tractions[q], self.press.surface.points()[q].position(x));
            let anchor = if row.bound_pa <= 0.0 {
                position
            } else if traction.norm() < row.bound_pa {
                row.anchor
            } else {
                position - (traction - row.along(&multipliers[q])) / self.friction_penalties[q]
            };
            state.anchors[q] = self.pose.inverse_transform_point(&anchor);
        }
        state.pose = self.pose;
        state.pressures_pa.copy_from_slice(&self.pressures);
        state.tractions_pa.copy_from_slice(&self.tractions);
    }

    /// Sets multipliers to the continuous parts of pressures and tractions; friction acts along the present tangent
    /// planes, under the present pressures.
    fn update_multipliers(&mut self, x: &[Vector3<f64>]) {
        let Press { surface, obstacle, friction, .. } = *self.press;
        self.multipliers = surface.continuous_part(&self.pressures);
        let tractions = surface.continuous_part(&self.tractions);
        for (q, row) in self.rows.iter_mut().enumerate() {
            row.bound_pa = friction * self.pressures[q];
            if row.bound_pa > 0.0 {
                row.normal = obstacle.gap(&self.pose, &surface.points()[q].position(x)).normal;
                row.multiplier_pa = row.along(&tractions[q]);
            }
        }
    }

    /// Solves with given multipliers to `tolerance` of the first residual, or to the increment's own tolerance if that is
    /// larger.
    fn find_positions(
        &self,
        solver: &mut Solver,
        tolerance: impl Fn(f64) -> f64,
        x: &mut [Vector3<f64>],
        work: &mut ContactInfo,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Info, SolveError> {
        let Press { surface, constraints, params, .. } = *self.press;
        let normal = self.normal_contact();
        let friction = Friction { surface, rows: &self.rows, penalties_pa_per_m: &self.friction_penalties };
        let mut energies: Vec<&dyn Energy> = self.press.energies.to_vec();
        energies.extend([&normal as &dyn Energy, &friction]);
        // With tolerance 1 the floor of the residual is rounding alone.
        let first = solver.residual(&energies, constraints, 1.0, x);
        let tolerance = tolerance(first).max(self.newton_tolerance);
        let newton = Params { tolerance, max_iterations: params.max_newton_iterations, ..Params::default() };
        let mut steps = 0;
        let mut count = |progress: Progress| {
            steps = progress.iteration;
            observer(progress)
        };
        let result = solver.minimise(&energies, constraints, &newton, x, &mut count);
        work.outer_iterations += 1;
        work.newton_iterations += steps;
        work.indefinite_steps += result.as_ref().map_or(0, |info| info.indefinite_steps);
        result
    }

    fn normal_contact(&self) -> NormalContact<'_> {
        NormalContact {
            surface: self.press.surface,
            obstacle: self.press.obstacle,
            pose: &self.pose,
            multipliers_pa: &self.multipliers,
            penalties_pa_per_m: &self.penalties,
        }
    }

    /// Pressures and tractions at `x`.
    fn find_pressures(&mut self, x: &[Vector3<f64>]) -> Fit {
        let surface = self.press.surface;
        let normal = self.normal_contact();
        let pressures: Vec<f64> = (0..self.pressures.len()).map(|q| normal.pressure(q, x).0).collect();
        let traction = |(q, row): (usize, &FrictionRow)| {
            row.traction(self.friction_penalties[q], &surface.points()[q].position(x)).0
        };
        let tractions: Vec<_> = self.rows.iter().enumerate().map(traction).collect();
        let largest = pressures.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let changed: Vec<_> = pressures.iter().zip(&self.pressures).map(|(new, old)| new - old).collect();
        let turned: Vec<_> = tractions.iter().zip(&self.tractions).map(|(new, old)| new - old).collect();
        let fit = Fit {
            pressure_change: surface.continuous_part(&changed).iter().fold(0.0, |m: f64, c| m.max(c.abs())) / largest,
            traction_change: surface.continuous_part(&turned).iter().fold(0.0, |m: f64, c| m.max(c.norm())) / largest,
            ..Fit::default()
        };
        (self.pressures, self.tractions) = (pressures, tractions);
        fit
    }
}
