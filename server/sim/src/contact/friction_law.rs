//! The contact law of a row, and how its state changes between passes and ticks.
//!
//! Augmented Lagrangian, `u` the displacement of the skin against the tool in this step, `T = I - n n^T`:
//! `f_n = lambda_n - k_n (g + n . u)` and, with the trial force `t = lambda_t - k (s + T u)`, `f_t = beta t`,
//! `beta = min(1, mu f_n / |t|)`: radial return onto the cone \[SH98, ch. 2\], whose secant `beta` is fixed within a pass.
//! A row sticks while `beta = 1`. Inside the linear solve `f_n` is not cut at zero; a row that pulls is switched off and
//! the solve goes on without it.

use super::rows::{Row, Rows, tangent};
use super::{M3, V3};

/// A sticking contact begins to slide this far beyond the cone.
const STICK_MARGIN: f32 = 1.02;
/// Friction may be off the cone by this share, summed over rows, before another pass is worth it.
const CONE_TOLERANCE: f32 = 0.02;

impl Row {
    /// Tangential stiffness of the present state \[N/m\].
    #[inline(always)]
    fn tangential_stiffness(&self) -> f32 {
        if self.friction > 0.0 { self.contact.secant * self.stiffness } else { 0.0 }
    }

    /// `D = -df/du = k_n n n^T + beta k T` \[N/m\].
    #[inline(always)]
    pub(crate) fn stiffness_matrix(&self) -> M3 {
        let n = self.contact.normal;
        let t = self.tangential_stiffness();
        M3::identity() * t + n * n.transpose() * (self.normal_stiffness - t)
    }

    /// `f_n` at the present `u` \[N\].
    #[inline(always)]
    pub(crate) fn normal_force(&self) -> f32 {
        self.contact.normal_force - self.normal_stiffness * (self.gap + self.contact.normal.dot(&self.u))
    }

    /// `t = lambda_t - k (s + T u)` at the present `u` \[N\].
    #[inline(always)]
    fn trial_friction(&self) -> V3 {
        let c = &self.contact;
        c.tangential_force - (c.slip + tangent(&c.normal, &self.u)) * self.stiffness
    }

    /// Force on the skin at the present `u` under the present law \[N\]; zero if the row is off.
    #[inline(always)]
    fn law(&self) -> V3 {
        if !self.active {
            return V3::zeros();
        }
        let normal = self.contact.normal * self.normal_force();
        if self.friction > 0.0 { normal + self.trial_friction() * self.contact.secant } else { normal }
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
/// `may_activate`: later passes only switch rows off and lower their friction, so that they end.
pub(crate) fn evaluate(rows: &mut Rows, may_activate: bool) -> bool {
    let mut changed = false;
    let (mut off_cone, mut cone) = (0.0, 0.0);
    for row in &mut rows.rows {
        let normal_force = row.normal_force();
        if row.active != (normal_force > 0.0) {
            if row.active || may_activate {
                row.active = !row.active;
                changed = true;
            }
            continue;
        }
        if row.active && row.friction > 0.0 {
            let error = adapt_friction(row, normal_force, may_activate);
            (off_cone, cone) = (off_cone + error, cone + row.friction * normal_force);
        }
    }
    changed || off_cone > CONE_TOLERANCE * cone
}

/// A new secant of the radial return. Returns the difference between the last pass's force and the force under the new
/// state \[N\].
fn adapt_friction(row: &mut Row, normal_force: f32, may_rise: bool) -> f32 {
    let limit = row.friction * normal_force;
    let trial = row.trial_friction().norm();
    let sticks = row.contact.secant >= 1.0 && trial <= STICK_MARGIN * limit;
    let secant = if sticks { 1.0 } else { (limit / trial.max(1e-30)).min(1.0) };
    let before = row.contact.secant;
    if secant > before && !may_rise {
        return 0.0;
    }
    row.contact.secant = secant;
    trial * (before - secant).abs()
}

/// Before the first pass: the secant of a row that begins to slide, from the displacement that is expected.
pub(crate) fn predict_secant(row: &mut Row) {
    if row.contact.secant <= 0.0 {
        let limit = row.friction * row.normal_force().max(0.0);
        row.contact.secant = (limit / row.trial_friction().norm().max(1e-30)).min(1.0);
    }
}

/// Carries the multipliers over to the next tick. `relaxation` in (0, 1]; `bias_decay` is the share of the bias that stays.
///
/// A multiplier is bounded by the row's `max_force`: a tool forced through a fixed node, for instance, would otherwise
/// wind it up without bound and fling the object on release.
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
        (c.normal_force, c.tangential_force, c.slip, c.secant) = (0.0, V3::zeros(), V3::zeros(), 1.0);
        return;
    }
    let bound = row.max_force;
    c.normal_force = (c.normal_force + relaxation * (normal_force - c.normal_force)).min(bound);
    c.tangential_force = force * (limit / force.norm().max(1e-30)).min(1.0);
    c.slip = if c.slides() { V3::zeros() } else { c.slip + tu };
}
