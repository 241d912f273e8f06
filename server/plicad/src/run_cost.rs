//! What a simulation costs before it runs: bytes on the disk, and time.

use std::path::Path;

use plica_sim::Model;
use plica_trajectory::MotionReport;

use crate::roofline::Roofline;
use crate::work::{TYPICAL, TYPICAL_RATIO, table_bytes, work};

/// A simulation that takes longer is asked about \[s\].
const LONG_S: f64 = 3600.0;
/// Ticks below which no time is estimated: an estimate takes a moment itself.
const FEW_TICKS: u64 = 200_000;
/// Bytes of a vertex in a frame.
const VERTEX_BYTES: f64 = 12.0;

/// What a simulation will take.
#[derive(Debug, Clone, Copy)]
pub struct RunCost {
    n_ticks: u64,
    timestep_s: f64,
    bytes: f64,
    seconds: f64,
}

impl RunCost {
    /// Of a run of `n_ticks` ticks that writes `n_frames` frames.
    pub fn of(model: &Model, n_ticks: u64, n_frames: u64) -> Self {
        let tick_s = if n_ticks < FEW_TICKS { 0.0 } else { typical_tick_s(model) };
        Self {
            n_ticks,
            timestep_s: model.timestep_s(),
            bytes: VERTEX_BYTES * n_frames as f64 * model.n_skin() as f64,
            seconds: tick_s * n_ticks as f64,
        }
    }

    /// A sentence if the run writes more than the disk of `out` has free, or takes longer than an hour.
    pub fn objection(&self, out: &Path, motion: &MotionReport) -> Option<String> {
        let reason = if self.bytes > free_bytes(out) {
            format!(
                "the result would take {:.3} GB, more than the disk has free; --every N writes fewer frames",
                1e-9 * self.bytes
            )
        } else if self.seconds > LONG_S {
            format!("it would take about {:.1} hours", self.seconds / LONG_S)
        } else {
            return None;
        };
        let gap =
            if motion.gaps > 0 { format!(", the longest gap {:.0} s", motion.longest_step_s) } else { String::new() };
        let (unit, seconds) = (motion.time_unit.name(), self.n_ticks as f64 * self.timestep_s);
        Some(format!(
            "{} ticks ({seconds:.0} s{gap}), times taken for {unit}: {reason}; are the times in {unit}? --time-unit says it",
            self.n_ticks
        ))
    }
}

/// A tick of a scene without a motion to try \[s\].
pub fn typical_tick_s(model: &Model) -> f64 {
    let (bytes, flops) = work(model, TYPICAL.0, TYPICAL.1);
    TYPICAL_RATIO * Roofline::measure(table_bytes(model)).limit_s(bytes, flops)
}

/// Room on the disk that a file would lie on; as good as endless where the system does not say.
fn free_bytes(file: &Path) -> f64 {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let disk = rustix::fs::statvfs(folder).ok();
    disk.map_or(f64::INFINITY, |disk| disk.f_bavail as f64 * disk.f_frsize as f64)
}
