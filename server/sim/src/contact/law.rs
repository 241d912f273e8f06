//! The contact law of a row, and how its state changes between passes and ticks.
//!
//! Augmented Lagrangian, `u` the displacement of the skin against the tool in this step, `T = I - n n^T`:
//! `f_n = lambda_n - k (g + n . u)`, sticking `f_t = lambda_t - k (s + T u)`, sliding `f_t = -k_s T u` with the secant
//! `k_s = mu f_n / |T u|`. Inside the linear solve `f_n` is not cut at zero; a row that pulls is switched off and the
//! solve goes on without it.

use super::rows::{Row, tangent};
use super::{M3, Rows, V3};

/// A sticking contact begins to slide this far beyond the cone.
const STICK_MARGIN: f32 = 1.02;
/// Change of the secant stiffness that is worth another pass.
const SECANT_CHANGE: f32 = 0.05;

impl Row {
    /// Tangential stiffness of the present state [N/m].
    #[inline(always)]
    fn tangential_stiffness(&self) -> f32 {
        match (self.friction > 0.0, self.contact.slides) {
            (false, _) => 0.0,
            (true, false) => self.stiffness,
            (true, true) => self.contact.slide_stiffness,
        }
    }

    /// `D = -df/du = k n n^T + k_t T` [N/m].
    #[inline(always)]
    pub(crate) fn stiffness_matrix(&self) -> M3 {
        let n = self.contact.normal;
        let t = self.tangential_stiffness();
        M3::identity() * t + n * n.transpose() * (self.stiffness - t)
    }

    /// `f_n` at the present `u` [N].
    #[inline(always)]
    pub(crate) fn normal_force(&self) -> f32 {
        self.contact.normal_force - self.stiffness * (self.gap + self.contact.normal.dot(&self.u))
    }

    /// Force on the skin at the present `u` under the present law [N]; zero if the row is off.
    #[inline(always)]
    fn law(&self) -> V3 {
        if !self.active {
            return V3::zeros();
        }
        let c = &self.contact;
        let tu = tangent(&c.normal, &self.u);
        let tangential = match (self.friction > 0.0, c.slides) {
            (false, _) => V3::zeros(),
            (true, false) => c.tangential_force - (c.slip + tu) * self.stiffness,
            (true, true) => -tu * c.slide_stiffness,
        };
        c.normal * self.normal_force() + tangential
    }
}

/// Computes the force of every row at its present `u`.
pub(crate) fn stack_forces(rows: &mut Rows) {
    for row in &mut rows.rows {
        row.force = row.law();
    }
}

/// Adapts the states of the rows to the forces of the last pass. Returns whether another pass is needed.
///
/// `may_activate`: later passes only switch rows off, so that they end.
pub(crate) fn evaluate(rows: &mut Rows, may_activate: bool) -> bool {
    let mut changed = false;
    for row in &mut rows.rows {
        let normal_force = row.normal_force();
        if row.active != (normal_force > 0.0) {
            if row.active || may_activate {
                row.active = !row.active;
                changed = true;
            }
            continue;
        }
        if row.active && may_activate && row.friction > 0.0 {
            changed |= switch_friction(row, normal_force);
        }
    }
    changed
}

/// Stick to slide where the cone is left, slide to stick where the secant is as stiff as sticking.
fn switch_friction(row: &mut Row, normal_force: f32) -> bool {
    let tu = tangent(&row.contact.normal, &row.u);
    let limit = row.friction * normal_force;
    let secant = limit / tu.norm().max(1e-12);
    let force = tangent(&row.contact.normal, &row.force);
    let c = &mut row.contact;
    if !c.slides {
        if force.norm() <= STICK_MARGIN * limit {
            return false;
        }
        c.slides = true;
        c.slide_stiffness = secant.min(row.stiffness);
        return true;
    }
    if secant >= row.stiffness {
        c.slides = false;
        c.tangential_force = force;
        c.slip = -tu;
        return true;
    }
    let has_moved = (secant - c.slide_stiffness).abs() > SECANT_CHANGE * c.slide_stiffness;
    if has_moved {
        c.slide_stiffness = secant;
    }
    has_moved
}

/// Carries the multipliers over to the next tick. `relaxation` in (0, 1]; `bias_decay` is the share of the bias that stays.
pub(crate) fn settle(row: &mut Row, relaxation: f32, bias_decay: f32) {
    let normal_force = if row.active { row.normal_force() } else { 0.0 };
    let tu = tangent(&row.contact.normal, &row.u);
    let force = tangent(&row.contact.normal, &row.force);
    let limit = row.friction * normal_force;
    let c = &mut row.contact;
    c.gap = row.gap + c.bias + c.normal.dot(&row.u);
    c.force = row.force;
    c.bias *= bias_decay;
    if normal_force <= 0.0 {
        (c.normal_force, c.tangential_force, c.slip) = (0.0, V3::zeros(), V3::zeros());
        return;
    }
    c.normal_force += relaxation * (normal_force - c.normal_force);
    c.tangential_force = force * (limit / force.norm().max(1e-30)).min(1.0);
    if c.slides {
        c.slip = V3::zeros();
        c.slide_stiffness = limit / tu.norm().max(1e-12);
    } else {
        c.slip += tu;
    }
}
