//! Coupled tools: a light rigid body on a saturating 6-DOF spring-damper, eliminated exactly from the contact rows.
//!
//! A twist is `(v, l omega)`, with the lever `l` making all six components velocities. A point at `arm` moves with
//! `P twist = v + omega x arm`. One implicit step of the free proxy: `B dV = r`, `B = m + h s c + h^2 s k`,
//! `r = h s (k e + c (v_device - V))`, `e` the pose error at the end of the step if nothing changed, `s <= 1` the secant of the
//! saturation.

use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3, Vector6};

use super::V3;
use super::rows::Rows;
use crate::description::{Coupling, SpringCoupling, ToolDescription};
use crate::tool::Target;

/// Time constant of the low-pass filter on the device velocity in the damper \[s\].
const DEVICE_VELOCITY_FILTER_S: f64 = 5e-3;

/// The simulated tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Proxy {
    pub(crate) pose: Isometry3<f64>,
    /// `(v, l omega)` \[m/s\].
    pub(crate) twist: Vector6<f64>,
    device_twist: Vector6<f64>,
    /// Force and torque/l of the coupling on the proxy \[N\].
    pub(crate) coupling_force: Vector6<f64>,
    pub(crate) saturated: bool,
    pub(crate) present: bool,
}

/// One tool in this step's solve.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ProxyMotion {
    pub(crate) lever: f32,
    /// Twist before contact: prescribed, or the present one.
    twist: Vector6<f64>,
    /// Change of the twist so far.
    delta: Vector6<f64>,
    /// `None` for a prescribed tool.
    spring: Option<SpringStep>,
    /// `(B + h^2 P^T D P)^-1` of this pass; zero for a prescribed tool.
    inverse: Matrix6<f32>,
    /// Right-hand side of this pass.
    residual: Vector6<f64>,
}

#[derive(Debug, Clone, Copy)]
struct SpringStep {
    matrix: Matrix6<f64>,
    free_residual: Vector6<f64>,
    /// Pose error at the end of the step, per unit of twist change it shrinks by `h`.
    error: Vector6<f64>,
    velocity_error: Vector6<f64>,
    /// Saturated stiffness and damping per component.
    stiffness: Vector6<f64>,
    damping: Vector6<f64>,
}

impl Proxy {
    pub(crate) fn absent() -> Self {
        Self {
            pose: Isometry3::identity(),
            twist: Vector6::zeros(),
            device_twist: Vector6::zeros(),
            coupling_force: Vector6::zeros(),
            saturated: false,
            present: false,
        }
    }

    /// Places the proxy at rest at the device pose.
    pub(crate) fn place(&mut self, pose: &Isometry3<f64>) {
        *self = Self { pose: *pose, present: true, ..Self::absent() };
    }

    /// Prepares a step of `h` seconds that ends with the device at `target`.
    pub(crate) fn begin(&mut self, tool: &ToolDescription, target: &Target, h: f64) -> ProxyMotion {
        match &tool.coupling {
            Coupling::Rigid => {
                let lever = 1.0;
                let twist = pose_error(&target.pose, &self.pose, lever) / h;
                ProxyMotion::prescribed(lever as f32, twist)
            }
            Coupling::Spring(spring) => self.begin_spring(spring, target, h),
        }
    }

    fn begin_spring(&mut self, spring: &SpringCoupling, target: &Target, h: f64) -> ProxyMotion {
        let lever = spring.lever_m;
        let moved = pose_error(&target.pose, &target.before, lever) / h;
        self.device_twist += (moved - self.device_twist) * (h / (h + DEVICE_VELOCITY_FILTER_S));
        let error = pose_error(&target.pose, &self.pose, lever) - self.twist * h;
        let velocity_error = self.device_twist - self.twist;
        let k = spring.stiffness_n_per_m;
        let c = spring.damping_n_s_per_m.unwrap_or(2.0 * (k * spring.mass_kg).sqrt());
        let force = error * k + velocity_error * c;
        let share = saturation(spring, &force);
        self.saturated = share.min() < 1.0;
        let (stiffness, damping) = (share * k, share * c);
        let diagonal = Vector6::repeat(spring.mass_kg) + damping * h + stiffness * (h * h);
        ProxyMotion {
            lever: lever as f32,
            twist: self.twist,
            delta: Vector6::zeros(),
            spring: Some(SpringStep {
                matrix: Matrix6::from_diagonal(&diagonal),
                free_residual: force.component_mul(&share) * h,
                error,
                velocity_error,
                stiffness,
                damping,
            }),
            inverse: Matrix6::zeros(),
            residual: Vector6::zeros(),
        }
    }

    /// Takes the step. A prescribed tool ends at the device pose.
    pub(crate) fn finish(&mut self, tool: &ToolDescription, target: &Target, motion: &ProxyMotion, h: f64) {
        self.twist = motion.twist + motion.delta;
        match (&tool.coupling, &motion.spring) {
            (Coupling::Spring(spring), Some(step)) => {
                let turn = Vector3::new(self.twist[3], self.twist[4], self.twist[5]) * (h / spring.lever_m);
                self.pose.translation.vector += self.twist.fixed_rows::<3>(0) * h;
                self.pose.rotation = UnitQuaternion::from_scaled_axis(turn) * self.pose.rotation;
                self.pose.rotation.renormalize();
                let force = (step.error - motion.delta * h).component_mul(&step.stiffness)
                    + (step.velocity_error - motion.delta).component_mul(&step.damping);
                self.coupling_force = force.component_mul(&saturation(spring, &force));
            }
            _ => self.pose = target.pose,
        }
    }
}

impl ProxyMotion {
    /// A tool or plane with prescribed motion.
    pub(crate) fn prescribed(lever: f32, twist: Vector6<f64>) -> Self {
        Self {
            lever,
            twist,
            delta: Vector6::zeros(),
            spring: None,
            inverse: Matrix6::zeros(),
            residual: Vector6::zeros(),
        }
    }

    /// Velocity of the point at `arm` with the present twist.
    #[inline(always)]
    pub(crate) fn point_velocity(&self, arm: &V3) -> V3 {
        at_arm(&(self.twist + self.delta).cast(), self.lever, arm)
    }

    /// Twist that the proxy would have after this step without contact.
    pub(crate) fn free_twist(&self) -> Vector6<f32> {
        let step = |s: &SpringStep| s.free_residual.component_div(&s.matrix.diagonal());
        (self.twist + self.spring.as_ref().map_or(Vector6::zeros(), step)).cast()
    }

    /// Prepares a pass: the right-hand side at the present twist and contact forces, and the inverse with the contacts' stiffness.
    pub(crate) fn factor(&mut self, body: u32, rows: &Rows, h: f32) {
        let Some(step) = &self.spring else { return };
        let mut residual = step.free_residual - step.matrix * self.delta;
        let mut matrix = step.matrix;
        for row in rows.rows.iter().filter(|r| r.active && r.contact.body == body) {
            let p = jacobian(&row.arm, self.lever);
            residual -= (p.transpose() * row.force * h).cast::<f64>();
            matrix += (p.transpose() * row.stiffness_matrix() * p * (h * h)).cast::<f64>();
        }
        self.residual = residual;
        self.inverse = matrix.try_inverse().unwrap_or_else(Matrix6::zeros).cast();
    }

    /// `(B + h^2 P^T D P)^-1 q`
    #[inline(always)]
    pub(crate) fn solve(&self, q: &Vector6<f32>) -> Vector6<f32> {
        self.inverse * q
    }

    /// Right-hand side of this pass.
    pub(crate) fn residual(&self) -> Vector6<f32> {
        self.residual.cast()
    }

    /// Adds a change of the twist.
    pub(crate) fn advance(&mut self, change: &Vector6<f32>) {
        self.delta += change.cast::<f64>();
    }
}

/// `P twist`
#[inline(always)]
pub(crate) fn at_arm(twist: &Vector6<f32>, lever: f32, arm: &V3) -> V3 {
    let turn = V3::new(twist[3], twist[4], twist[5]) / lever;
    V3::new(twist[0], twist[1], twist[2]) + turn.cross(arm)
}

/// `P^T f`
#[inline(always)]
pub(crate) fn transposed_at_arm(f: &V3, lever: f32, arm: &V3) -> Vector6<f32> {
    let torque = arm.cross(f) / lever;
    Vector6::new(f.x, f.y, f.z, torque.x, torque.y, torque.z)
}

/// `P`, `[3, 6]`
fn jacobian(arm: &V3, lever: f32) -> nalgebra::Matrix3x6<f32> {
    let a = arm / lever;
    nalgebra::Matrix3x6::new(
        1.0, 0.0, 0.0, 0.0, a.z, -a.y, //
        0.0, 1.0, 0.0, -a.z, 0.0, a.x, //
        0.0, 0.0, 1.0, a.y, -a.x, 0.0,
    )
}

/// From `from` to `to`: translation and lever times rotation vector, world axes \[m\].
fn pose_error(to: &Isometry3<f64>, from: &Isometry3<f64>, lever: f64) -> Vector6<f64> {
    let shift = to.translation.vector - from.translation.vector;
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis() * lever;
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// Share of the force (first three) and torque (last three) that the limits let through.
fn saturation(spring: &SpringCoupling, force: &Vector6<f64>) -> Vector6<f64> {
    let share = |limit: f64, size: f64| if size > limit { limit / size } else { 1.0 };
    let push = share(spring.max_force_n, force.fixed_rows::<3>(0).norm());
    let turn = share(spring.max_torque_n_m / spring.lever_m, force.fixed_rows::<3>(3).norm());
    Vector6::new(push, push, push, turn, turn, turn)
}
