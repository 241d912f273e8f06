//! Frictional contact of a solid with a rigid tool, as a problem.

use nalgebra::{Isometry3, Point3, Vector3};

use super::obstacle::Obstacle;
use super::params::ContactParams;
use super::surface::ContactSurface;
use crate::constraints::Constraints;
use crate::energy::Energy;

/// A solid and a tool pressed into it.
#[derive(Clone, Copy)]
pub struct Press<'a> {
    /// The solid and its loads.
    pub energies: &'a [&'a dyn Energy],
    /// Supports.
    pub constraints: &'a Constraints,
    /// Contact points of the solid.
    pub surface: &'a ContactSurface,
    /// The tool's shape.
    pub obstacle: &'a Obstacle,
    /// Coulomb friction coefficient, `mu`.
    pub friction: f64,
    /// Solver parameters.
    pub params: ContactParams,
}

impl Press<'_> {
    /// Longest path of the tool's origin or of a possible contact point in a motion of the tool \[m\].
    pub(super) fn motion_m(&self, from: &Isometry3<f64>, to: &Isometry3<f64>, x: &[Vector3<f64>]) -> f64 {
        let is_near = |p: &Point3<f64>| {
            [from, to].iter().any(|pose| self.obstacle.distance(pose, p) < self.params.max_increment_m)
        };
        let carry = to * from.inverse();
        let points = self.surface.points().iter().map(|point| point.position(x)).filter(is_near);
        let origin = (to.translation.vector - from.translation.vector).norm();
        points.map(|p| (carry * p - p).norm()).fold(origin, f64::max)
    }

    /// `x + ratio (x - last)`, if the energies allow it.
    pub(super) fn extrapolate(
        &self,
        last: &[Vector3<f64>],
        ratio: f64,
        x: &[Vector3<f64>],
    ) -> Option<Vec<Vector3<f64>>> {
        let trial: Vec<_> = x.iter().zip(last).map(|(x, last)| x + (x - last) * ratio).collect();
        let is_fine = |energy: &&dyn Energy| {
            energy.smallest_jacobian(&trial).is_none_or(|j| j > 0.0) && energy.value(&trial).is_finite()
        };
        self.energies.iter().all(is_fine).then_some(trial)
    }
}
