//! What a tool makes of a slow tracker's poses: steps, or a delay.

use std::fmt;

use plica_sim::{Coupling, Sampling, ToolDescription};
use serde::Serialize;

/// Rate of a usual tracker \[Hz\].
const TRACKER_HZ: f64 = 60.0;
/// Speed of a hand at work \[m/s\].
const HAND_M_PER_S: f64 = 0.1;

/// Steps of a tool that follows a 60 Hz tracker in a hand that moves at 0.1 m/s.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SamplingCost {
    tool: String,
    sampling: &'static str,
    /// How far in the past the tool is; null: the newest pose.
    delay_ms: Option<f64>,
    /// Step of the device from pose to pose; 0 between poses that are interpolated \[m\].
    step_m: f64,
    /// Most that the coupling's force changes in such a step, `min(k d, F_max)`; null for a rigid coupling, where the object's
    /// own stiffness answers \[N\].
    force_step_n: Option<f64>,
    /// Ticks in which the step is taken at the tool's largest speed.
    step_s: f64,
}

/// What a tool's sampling and coupling make of such a tracker.
pub fn sampling_cost(tool: &ToolDescription) -> SamplingCost {
    let (sampling, delay_ms, step_m) = match tool.sampling {
        Sampling::Latest => ("latest", None, HAND_M_PER_S / TRACKER_HZ),
        Sampling::Interpolate { delay_s } if delay_s * TRACKER_HZ < 1.0 => {
            ("interpolate", Some(1e3 * delay_s), HAND_M_PER_S * (1.0 / TRACKER_HZ - delay_s))
        }
        Sampling::Interpolate { delay_s } => ("interpolate", Some(1e3 * delay_s), 0.0),
    };
    let force_step_n = match tool.coupling {
        Coupling::Spring(spring) => Some((spring.stiffness_n_per_m * step_m).min(spring.max_force_n)),
        Coupling::Rigid => None,
    };
    SamplingCost {
        tool: tool.name.clone(),
        sampling,
        delay_ms,
        step_m,
        force_step_n,
        step_s: step_m / tool.max_tool_speed_m_per_s,
    }
}

impl fmt::Display for SamplingCost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { tool, sampling, step_m, step_s, .. } = self;
        let delay = self.delay_ms.map_or(String::new(), |ms| format!(", {ms:.0} ms late"));
        if *step_m == 0.0 {
            return write!(f, "`{tool}` moves smoothly between poses{delay} (sampling = \"{sampling}\")");
        }
        let force = match self.force_step_n {
            Some(force_n) => format!("the force by up to {force_n:.2} N"),
            None => "the force by the object's stiffness times that (rigid coupling)".to_owned(),
        };
        write!(
            f,
            "`{tool}` steps with each pose{delay} (sampling = \"{sampling}\"): a {TRACKER_HZ:.0} Hz tracker in a hand at \
             {HAND_M_PER_S} m/s moves it by {:.2} mm within {:.1} ms, and {force}; sampling = \"interpolate\" with delay_ms of \
             at least one interval of the tracker ({:.0} ms) has no steps",
            1e3 * step_m,
            1e3 * step_s,
            (1e3 / TRACKER_HZ).ceil()
        )
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

    use super::*;

    #[test]
    fn steps_of_the_newest_pose_are_said_with_the_remedy_and_are_none_when_interpolated() {
        let config = plica_scene::Config::built_in().unwrap();
        let mut tool = config.tools()[0].clone();
        let said = sampling_cost(&tool).to_string();
        for part in ["`probe` steps", "by 1.67 mm", "up to 1.67 N", "sampling = \"interpolate\"", "17 ms"] {
            assert!(said.contains(part), "`{part}` in: {said}");
        }
        tool.sampling = Sampling::Interpolate { delay_s: 0.02 };
        let cost = sampling_cost(&tool);
        assert_eq!((cost.step_m, cost.force_step_n), (0.0, Some(0.0)));
        assert!(cost.to_string().contains("smoothly between poses, 20 ms late"), "{cost}");
        tool.sampling = Sampling::Interpolate { delay_s: 0.01 };
        assert!(sampling_cost(&tool).to_string().contains("by 0.67 mm"), "a delay below one interval still steps");
    }
}
