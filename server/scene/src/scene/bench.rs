//! `[bench]`: a scripted motion, checked.

use nalgebra::{Isometry3, Translation3, Vector3};
use plica_sim::ToolDescription;

use super::raw::RawBench;
use crate::checks::Check;
use crate::error::ConfigError;

/// Scripted tool motion of `plicad bench`.
#[derive(Debug, Clone)]
pub struct BenchConfig {
    keyframes: Vec<Keyframe>,
    full_press_s: Option<f64>,
}

/// Pose of a tool at one time.
#[derive(Debug, Clone, Copy)]
pub struct Keyframe {
    /// Index of the tool.
    pub tool: usize,
    /// Time \[s\].
    pub time_s: f64,
    /// Pose of the tool in the world.
    pub pose: Isometry3<f64>,
}

impl BenchConfig {
    /// A straight motion of one tool from a pose at rest to another one, where it stays.
    pub fn press(tool: usize, from: Isometry3<f64>, to: Isometry3<f64>, [reached_s, end_s]: [f64; 2]) -> Self {
        let key = |time_s, pose| Keyframe { tool, time_s, pose };
        Self { keyframes: vec![key(0.0, from), key(reached_s, to), key(end_s, to)], full_press_s: None }
    }

    /// Keyframes in order of time, of all tools.
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    /// Time at which the tool's force is reported as the force at full press \[s\].
    pub fn full_press_s(&self) -> Option<f64> {
        self.full_press_s
    }

    /// Time of the last keyframe \[s\].
    pub fn duration_s(&self) -> f64 {
        self.keyframes.last().map_or(0.0, |k| k.time_s)
    }

    /// Pose of `tool` at `time_s`: straight lines between keyframes, held before the first and after the last.
    pub fn pose(&self, tool: usize, time_s: f64) -> Option<Isometry3<f64>> {
        let mut before: Option<&Keyframe> = None;
        for key in self.keyframes.iter().filter(|k| k.tool == tool) {
            if key.time_s >= time_s {
                return Some(before.map_or(key.pose, |b| between(b, key, time_s)));
            }
            before = Some(key);
        }
        before.map(|k| k.pose)
    }
}

fn between(a: &Keyframe, b: &Keyframe, time_s: f64) -> Isometry3<f64> {
    let share = (time_s - a.time_s) / (b.time_s - a.time_s).max(1e-9);
    a.pose.try_lerp_slerp(&b.pose, share, 1e-9).unwrap_or(b.pose)
}

pub(super) fn check(c: &Check<'_>, raw: &RawBench, tools: &[ToolDescription]) -> Result<BenchConfig, ConfigError> {
    let mut keyframes: Vec<Keyframe> = Vec::new();
    for (i, key) in raw.motion.iter().enumerate() {
        let path = format!("bench.motion.{i}");
        let tool = tools.iter().position(|t| t.name == key.tool).ok_or_else(|| {
            let names: Vec<_> = tools.iter().map(|t| t.name.as_str()).collect();
            let problem = format!("there is no tool `{}`", key.tool);
            c.error(&format!("{path}.tool"), problem, format!("name one of: {}", names.join(", ")))
        })?;
        let time_s = key.time_s;
        if let Some(last) = keyframes.last().filter(|k| k.time_s > time_s) {
            let problem = format!("{time_s} comes after {}; the allowed range starts there", last.time_s);
            return Err(c.error(&format!("{path}.time_s"), problem, "order the keyframes by time"));
        }
        let position = Vector3::from(key.position_m);
        let rotation = c.rotation(&format!("{path}.orientation_xyzw"), key.orientation_xyzw)?;
        keyframes.push(Keyframe { tool, time_s, pose: Isometry3::from_parts(Translation3::from(position), rotation) });
    }
    if keyframes.is_empty() {
        return Err(c.error(
            "bench.motion",
            "has no keyframe; one or more are needed",
            "add keyframes or remove [bench]",
        ));
    }
    Ok(BenchConfig { keyframes, full_press_s: raw.full_press_s })
}
