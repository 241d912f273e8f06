//! Increments between two poses of a tool: step-size control by halving.

use nalgebra::Isometry3;

/// From one pose to the next: `n_increments` whole increments, `done` of them done.
#[derive(Debug, Clone, Copy)]
pub(super) struct Increments {
    from: Isometry3<f64>,
    to: Isometry3<f64>,
    n_increments: f64,
    done: f64,
    halvings: u32,
}

impl Increments {
    pub(super) fn new(from: &Isometry3<f64>, to: &Isometry3<f64>, motion_m: f64, max_increment_m: f64) -> Self {
        let n_increments = (motion_m / max_increment_m).ceil().max(1.0);
        Self { from: *from, to: *to, n_increments, done: 0.0, halvings: 0 }
    }

    pub(super) fn is_over(&self) -> bool {
        self.done >= self.n_increments
    }

    /// Length of the next increment, in whole ones.
    pub(super) fn step(&self) -> f64 {
        0.5_f64.powi(self.halvings as i32)
    }

    pub(super) fn halvings(&self) -> u32 {
        self.halvings
    }

    /// Share of the motion that is done.
    pub(super) fn share(&self) -> f64 {
        self.done / self.n_increments
    }

    /// Share of the motion at the end of the next increment.
    pub(super) fn next_share(&self) -> f64 {
        (self.done + self.step()) / self.n_increments
    }

    /// Pose at the end of the next increment: linear in the origin, spherical in the rotation.
    pub(super) fn target(&self) -> Isometry3<f64> {
        if self.next_share() >= 1.0 {
            return self.to;
        }
        self.from.try_lerp_slerp(&self.to, self.next_share(), 1e-12).unwrap_or(self.to)
    }

    /// Marks the next increment as done. Halved increments grow again where a longer one would begin.
    pub(super) fn advance(&mut self) {
        self.done += self.step();
        while self.halvings > 0 && (self.done / (2.0 * self.step())).fract() == 0.0 {
            self.halvings -= 1;
        }
    }

    /// Halves the next increment.
    pub(super) fn halve(&mut self) {
        self.halvings += 1;
    }
}
