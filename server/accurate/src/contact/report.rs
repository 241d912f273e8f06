//! What contact does to the tool.

use nalgebra::{Point3, Vector3};

use super::press::Press;
use super::state::ContactState;

/// Sums over the contact points.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Resultant {
    pub(super) force_n: Vector3<f64>,
    pub(super) torque_nm: Vector3<f64>,
    pub(super) area_m2: f64,
    pub(super) n_touching: usize,
}

/// Force on the tool, `sum A (t - p n)`, and its torque about the tool's origin.
pub(super) fn resultant(press: &Press<'_>, state: &ContactState, x: &[Vector3<f64>]) -> Resultant {
    let origin = Point3::from(state.pose.translation.vector);
    let mut sum = Resultant::default();
    for (q, point) in press.surface.points().iter().enumerate().filter(|(q, _)| state.pressures_pa[*q] > 0.0) {
        let position = point.position(x);
        let normal = press.obstacle.gap(&state.pose, &position).normal;
        let force = (state.tractions_pa[q] - normal * state.pressures_pa[q]) * point.area_m2;
        sum.force_n += force;
        sum.torque_nm += (position - origin).cross(&force);
        sum.area_m2 += point.area_m2;
        sum.n_touching += 1;
    }
    sum
}
