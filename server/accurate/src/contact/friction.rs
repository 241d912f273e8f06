//! Friction along an obstacle: an augmented Lagrangian of the tangential traction.

use nalgebra::{Matrix3, Point3, Vector3};
use plica_geometry::NodeIdx;

use super::surface::{ContactPoint, ContactSurface};
use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;

/// Friction of one contact point, constant during a solve for positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionRow {
    /// `a`: position of the point without sliding \[m\].
    pub anchor: Point3<f64>,
    /// `n`: unit normal of the obstacle.
    pub normal: Vector3<f64>,
    /// `l`: multiplier, tangential \[Pa\].
    pub multiplier_pa: Vector3<f64>,
    /// `b`: largest traction \[Pa\]; 0 without contact.
    pub bound_pa: f64,
}

impl FrictionRow {
    /// Traction against sliding, `t = tau min(1, b / |tau|)` with `tau = l + k T (p - a)`, `T = I - n n^T`; and `tau` \[Pa\].
    pub fn traction(&self, penalty_pa_per_m: f64, position: &Point3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let trial = self.multiplier_pa + self.along(&(position - self.anchor)) * penalty_pa_per_m;
        (trial.cap_magnitude(self.bound_pa), trial)
    }

    /// `T v`.
    pub(super) fn along(&self, v: &Vector3<f64>) -> Vector3<f64> {
        v - self.normal * self.normal.dot(v)
    }
}

/// `W = sum_q A_q / k_q (phi(|tau_q|) - |l_q|^2 / 2)`, `phi(t) = t^2 / 2` up to the bound `b`, then `b t - b^2 / 2`.
///
/// That is the augmented Lagrangian of the dissipation `b |s|` of a slip `s` under a given bound \[SL92\]: convex, and with
/// the multipliers at their fixed point a point either keeps its anchor or slides under exactly `b`. Coulomb's law follows
/// when `b` follows the pressure.
#[derive(Debug, Clone, Copy)]
pub struct Friction<'a> {
    /// Points.
    pub surface: &'a ContactSurface,
    /// Friction of each, `[n_points]`.
    pub rows: &'a [FrictionRow],
    /// `k`, `[n_points]` \[Pa/m\].
    pub penalties_pa_per_m: &'a [f64],
}

impl Friction<'_> {
    fn for_each_held(&self, mut visit: impl FnMut(&ContactPoint, &FrictionRow, f64)) {
        for ((point, row), penalty) in self.surface.points().iter().zip(self.rows).zip(self.penalties_pa_per_m) {
            if row.bound_pa > 0.0 {
                visit(point, row, *penalty);
            }
        }
    }
}

impl Energy for Friction<'_> {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.surface.visit_faces(visit);
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        let mut value = 0.0;
        self.for_each_held(|point, row, penalty| {
            let (held, trial) = row.traction(penalty, &point.position(x));
            // phi = |held| (|trial| - |held| / 2) on both sides of the bound.
            let phi = held.norm() * (trial.norm() - 0.5 * held.norm());
            value += point.area_m2 / penalty * (phi - 0.5 * row.multiplier_pa.norm_squared());
        });
        value
    }

    /// `dW/dx_a = A N_a t`.
    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        self.for_each_held(|point, row, penalty| {
            let (held, _) = row.traction(penalty, &point.position(x));
            for (node, share) in point.nodes.iter().zip(point.shares) {
                gradient[node.index()] += held * (point.area_m2 * share);
            }
        });
    }

    /// `d2W/dx_a dx_b = A N_a N_b k D`; sticking `D = T`, sliding `D = b / |tau| (T - tau tau^T / |tau|^2)`: both positive
    /// semi-definite.
    fn add_hessian(&self, x: &[Vector3<f64>], _: Projection, hessian: &mut Hessian) {
        self.for_each_held(|point, row, penalty| {
            let (_, trial) = row.traction(penalty, &point.position(x));
            let mut derivative = Matrix3::identity() - row.normal * row.normal.transpose();
            if trial.norm() > row.bound_pa {
                let direction = trial.normalize();
                derivative = (derivative - direction * direction.transpose()) * (row.bound_pa / trial.norm());
            }
            let block = derivative * (penalty * point.area_m2);
            hessian.add_stencil(&point.nodes, |a, b| block * (point.shares[a] * point.shares[b]));
        });
    }
}
