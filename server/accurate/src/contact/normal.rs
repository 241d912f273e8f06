//! Normal contact with an obstacle: an augmented Lagrangian of the pressure.

use nalgebra::{Isometry3, Vector3};
use plica_geometry::NodeIdx;

use super::obstacle::{Gap, Obstacle};
use super::surface::{ContactPoint, ContactSurface};
use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;

/// `W = sum_q A_q / (2 k_q) (max(0, l_q - k_q g_q)^2 - l_q^2)` over contact points with area `A`, multiplier `l`, penalty
/// `k` and gap `g` \[SL92\]. Its force is the pressure `p = max(0, l - k g)` along the gap's normal: it only pushes.
#[derive(Debug, Clone, Copy)]
pub struct NormalContact<'a> {
    /// Points.
    pub surface: &'a ContactSurface,
    /// Obstacle of the points.
    pub obstacle: &'a Obstacle,
    /// `world <- obstacle`.
    pub pose: &'a Isometry3<f64>,
    /// `l`, `[n_points]` \[Pa\].
    pub multipliers_pa: &'a [f64],
    /// `k`, `[n_points]` \[Pa/m\].
    pub penalties_pa_per_m: &'a [f64],
}

impl NormalContact<'_> {
    /// `p = max(0, l - k g)` of a point \[Pa\], and its gap.
    pub fn pressure(&self, point: usize, x: &[Vector3<f64>]) -> (f64, Gap) {
        let gap = self.obstacle.gap(self.pose, &self.surface.points()[point].position(x));
        ((self.multipliers_pa[point] - self.penalties_pa_per_m[point] * gap.distance_m).max(0.0), gap)
    }

    fn for_each_pushing(&self, x: &[Vector3<f64>], mut visit: impl FnMut(usize, &ContactPoint, f64, &Gap)) {
        for (q, point) in self.surface.points().iter().enumerate() {
            let (pressure, gap) = self.pressure(q, x);
            if pressure > 0.0 {
                visit(q, point, pressure, &gap);
            }
        }
    }
}

impl Energy for NormalContact<'_> {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.surface.visit_faces(visit);
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        let areas = self.surface.points().iter().map(|point| point.area_m2);
        let constants = areas.zip(self.multipliers_pa).zip(self.penalties_pa_per_m);
        let mut value: f64 = constants.map(|((area, l), k)| -0.5 * area * l * l / k).sum();
        self.for_each_pushing(x, |q, point, pressure, _| {
            value += 0.5 * point.area_m2 * pressure * pressure / self.penalties_pa_per_m[q];
        });
        value
    }

    /// `dW/dx_a = -A p N_a n`.
    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        self.for_each_pushing(x, |_, point, pressure, gap| {
            for (node, share) in point.nodes.iter().zip(point.shares) {
                gradient[node.index()] -= gap.normal * (point.area_m2 * pressure * share);
            }
        });
    }

    /// `d2W/dx_a dx_b = A N_a N_b (k n n^T - p d2g/dp2)`; of these the first is positive semi-definite and, since shapes
    /// are convex, the second is not.
    fn add_hessian(&self, x: &[Vector3<f64>], projection: Projection, hessian: &mut Hessian) {
        self.for_each_pushing(x, |q, point, pressure, gap| {
            let mut block = gap.normal * gap.normal.transpose() * self.penalties_pa_per_m[q];
            if projection == Projection::Exact {
                block -= gap.curvature * pressure;
            }
            block *= point.area_m2;
            hessian.add_stencil(&point.nodes, |a, b| block * (point.shares[a] * point.shares[b]));
        });
    }
}
