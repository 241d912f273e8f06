//! Where the demo's tool goes.

use plica_daemon::wire;
use plica_scene::Config;
use plica_scene::motion::{TimedPose, tip_radius_m, top_height_m};

/// How deep the device goes below first touch \[m\]; the spring of the coupling takes part of it.
const DEPTH_M: f64 = 0.012;
/// How far it slides \[m\].
const SLIDE_M: f64 = 0.024;
/// Height above first touch where it starts and ends \[m\].
const CLEARANCE_M: f64 = 0.012;

/// A position and a quaternion `xyzw`.
type Place = ([f64; 3], [f64; 4]);

/// One tool's way in time.
#[derive(Debug, Clone)]
pub struct Path {
    /// Index of the tool.
    pub tool: usize,
    keys: Vec<(f64, Place)>,
    /// Whether the keys are samples of a tracker, to be sent as they are.
    recorded: bool,
}

/// Press, hold, slide, hold, let go, and wait for the object to recover.
pub fn scripted(config: &Config, seconds: f64) -> Path {
    let [x_m, y_m, _] = config.object().mesh().extents_m();
    let (x, y) = (0.42 * x_m, 0.5 * y_m);
    let touch = top_height_m(config, x) + config.tools().first().map_or(0.0, tip_radius_m);
    let upright = [0.0, 0.0, 0.0, 1.0];
    let depth = DEPTH_M.min(0.45 * top_height_m(config, x));
    let slide = SLIDE_M.min(0.25 * x_m);
    let at = |share: f64, dx: f64, z: f64| (share * seconds, ([x + dx, y, touch + z], upright));
    let keys = vec![
        at(0.0, 0.0, CLEARANCE_M),
        at(0.10, 0.0, 0.002),
        at(0.35, 0.0, -depth),
        at(0.45, 0.0, -depth),
        at(0.65, slide, -depth),
        at(0.72, slide, -depth),
        at(0.82, slide, CLEARANCE_M),
        at(1.0, slide, CLEARANCE_M),
    ];
    Path { tool: 0, keys, recorded: false }
}

/// Recorded poses of the tool that the first one is for.
pub fn from_poses(poses: &[TimedPose]) -> Path {
    let tool = poses.first().map_or(0, |p| p.tool);
    let key = |p: &TimedPose| (p.time_s, wire::position_and_xyzw(&p.sample.pose));
    Path { tool, keys: poses.iter().filter(|p| p.tool == tool).map(key).collect(), recorded: true }
}

impl Path {
    /// Time of the last pose \[s\].
    pub fn duration_s(&self) -> f64 {
        self.keys.last().map_or(0.0, |(t, _)| *t)
    }

    /// Poses in time: at `rate_hz` along a scripted path, as recorded otherwise.
    pub fn poses(&self, rate_hz: f64) -> Vec<(f64, Place)> {
        if self.recorded {
            return self.keys.clone();
        }
        let n = (self.duration_s() * rate_hz) as u64;
        (0..=n).map(|k| k as f64 / rate_hz).map(|t| (t, self.at(t))).collect()
    }

    fn at(&self, time_s: f64) -> Place {
        let after = self.keys.partition_point(|(t, _)| *t <= time_s);
        let last = self.keys.len() - 1;
        let ((t0, (p0, q0)), (t1, (p1, _))) = (self.keys[after.saturating_sub(1)], self.keys[after.min(last)]);
        let share = smooth(((time_s - t0) / (t1 - t0).max(1e-9)).clamp(0.0, 1.0));
        (std::array::from_fn(|i| p0[i] + share * (p1[i] - p0[i])), q0)
    }
}

/// Starts and stops gently.
fn smooth(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}
