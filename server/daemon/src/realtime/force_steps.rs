//! How much the force on each tool changes from tick to tick: the cost of poses that come slower than ticks.

use nalgebra::Vector3;

/// Largest changes within the window that runs and the one before it.
#[derive(Debug)]
pub(super) struct ForceSteps {
    /// Half of a second.
    window_ticks: u64,
    tick: u64,
    tools: Vec<Steps>,
}

#[derive(Debug, Clone, Default)]
struct Steps {
    force_n: Vector3<f64>,
    before_n: f64,
    now_n: f64,
}

impl ForceSteps {
    pub(super) fn new(n_tools: usize, timestep_s: f64) -> Self {
        Self { window_ticks: ((0.5 / timestep_s) as u64).max(1), tick: 0, tools: vec![Steps::default(); n_tools] }
    }

    /// After a tick; one that does not follow the last, after a reset or a restored snapshot, shows no change.
    pub(super) fn note(&mut self, tick: u64, forces_n: impl Iterator<Item = Vector3<f64>>) {
        let is_new_window = tick.is_multiple_of(self.window_ticks);
        let follows = tick == self.tick + 1;
        self.tick = tick;
        for (steps, force_n) in self.tools.iter_mut().zip(forces_n) {
            if is_new_window {
                (steps.before_n, steps.now_n) = (steps.now_n, 0.0);
            }
            if follows {
                steps.now_n = steps.now_n.max((force_n - steps.force_n).norm());
            }
            steps.force_n = force_n;
        }
    }

    /// Largest change of each tool in the last half to whole second \[N\].
    pub(super) fn write(&self, out: &mut [f64]) {
        for (out, steps) in out.iter_mut().zip(&self.tools) {
            *out = steps.before_n.max(steps.now_n);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(steps: &mut ForceSteps, tick: u64, force_n: f64) -> f64 {
        steps.note(tick, std::iter::once(Vector3::x() * force_n));
        let mut told = [0.0];
        steps.write(&mut told);
        told[0]
    }

    #[test]
    fn the_largest_step_is_told_for_a_second_and_then_forgotten() {
        let mut steps = ForceSteps::new(1, 1e-3);
        let mut told = Vec::new();
        for tick in 1..=2000 {
            told.push(note(&mut steps, tick, if tick < 100 { 0.0 } else { 2.0 }));
        }
        assert_eq!((told[98], told[99], told[600]), (0.0, 2.0, 2.0));
        assert_eq!(told[1100], 0.0);
        // A reset is no step of the force.
        assert_eq!((note(&mut steps, 1, 0.0), note(&mut steps, 2, 0.0)), (0.0, 0.0));
    }
}
