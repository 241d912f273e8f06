//! Contact force on the tool, and errors of the contact law.

use nalgebra::{Point3, Vector3};

use super::press::Press;
use super::result::ContactInfo;
use super::state::ContactState;

/// Adds the sums over contact points: force on the tool `sum A (t - p n)`, its torque, area, and errors.
pub(super) fn report(press: &Press<'_>, state: &ContactState, x: &[Vector3<f64>], info: ContactInfo) -> ContactInfo {
    let origin = Point3::from(state.pose.translation.vector);
    let mut info = info;
    let (mut gaps, mut pressures, mut largest) = (0.0, 0.0, 0.0_f64);
    for (q, point) in press.surface.points().iter().enumerate() {
        let (pressure, traction) = (state.pressures_pa[q], state.tractions_pa[q]);
        let position = point.position(x);
        let gap = press.obstacle.gap(&state.pose, &position);
        info.max_penetration_m = info.max_penetration_m.max(-gap.distance_m);
        let force = (traction - gap.normal * pressure) * point.area_m2;
        info.force_n += force;
        info.torque_nm += (position - origin).cross(&force);
        if pressure > 0.0 {
            info.area_m2 += point.area_m2;
            info.n_touching += 1;
            gaps += point.area_m2 * pressure * gap.distance_m.abs();
            pressures += point.area_m2 * pressure;
            largest = largest.max(pressure);
        }
        info.friction_excess = info.friction_excess.max(traction.norm() - press.friction * pressure);
    }
    if largest > 0.0 {
        info.mean_gap_m = gaps / pressures;
        info.friction_excess /= largest;
    }
    info
}
