//! What a demo has shown, in numbers.

use std::path::PathBuf;

use plica_daemon::realtime::Grants;
use plica_protocol::status::{Distribution, Status};
use serde::Serialize;

use super::held_out::Errors;
use super::witness::Seen;

/// What `demo --json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// What enriches the skin.
    pub trained: Trained,
    /// How far coarse and enriched skin are from the accurate one, for a press that was not trained on.
    pub held_out: Errors,
    /// Ticks while the demo ran.
    pub ticks: u64,
    /// Duration of a tick \[us\].
    pub tick_us: Percentiles,
    /// How late the simulation thread woke up \[us\].
    pub lateness_us: Percentiles,
    /// Ticks that ended after the next one was due.
    pub overruns: u64,
    /// Ticks given up.
    pub skipped_ticks: u64,
    /// Whether the thread had real-time priority.
    pub realtime: bool,
    /// Poses that the client published.
    pub poses_published: u64,
    /// Poses that the daemon used.
    pub poses_accepted: u64,
    /// Skin frames that the client received over the bus.
    pub frames_received: u64,
    /// Skin frames that it missed.
    pub frames_missed: u64,
    /// Skin frames with detail.
    pub frames_enriched: u64,
    /// Wrenches that it received.
    pub wrenches_received: u64,
    /// Median time from a pose leaving the client to the first wrench that answers it \[us\].
    pub motion_to_force_us: f64,
    /// Deepest penetration of skin and tool \[m\].
    pub max_penetration_m: f64,
    /// Largest force on the tool \[N\].
    pub peak_force_n: f64,
    /// Largest displacement of the skin \[m\].
    pub peak_displacement_m: f64,
    /// Coarse, enriched and accurate skin of the held-out press.
    pub picture: PathBuf,
    /// The skin at the deepest press of the demo, as it came over the bus.
    pub live_picture: PathBuf,
    /// The deformed skin.
    pub glb: PathBuf,
}

/// The examples that are served.
#[derive(Debug, Clone, Serialize)]
pub struct Trained {
    /// How many.
    pub examples: usize,
    /// How long training took \[s\]; 0: an earlier run has done it.
    pub seconds: f64,
    /// Where they are.
    pub database: PathBuf,
}

/// Median and tails.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
}

/// The numbers of what was served and received.
#[derive(Debug, Clone, Copy)]
pub(super) struct Played<'a> {
    pub(super) status: &'a Status,
    pub(super) grants: &'a Grants,
    pub(super) seen: &'a Seen,
    pub(super) poses_published: u64,
    /// Index of the tool.
    pub(super) tool: usize,
}

/// The files that were written.
#[derive(Debug)]
pub(super) struct Files {
    pub(super) picture: PathBuf,
    pub(super) live_picture: PathBuf,
    pub(super) glb: PathBuf,
}

pub(super) fn summarise(played: Played<'_>, trained: Trained, held_out: Errors, files: Files) -> Summary {
    let Played { status, grants, seen, poses_published, tool } = played;
    let object = status.objects.values().next().cloned().unwrap_or_default();
    let percentiles = |d: &Distribution| Percentiles { p50: d.p50, p99: d.p99, p999: d.p999 };
    Summary {
        trained,
        held_out,
        ticks: status.tick_us.count,
        tick_us: percentiles(&status.tick_us),
        lateness_us: percentiles(&status.lateness_us),
        overruns: status.overruns,
        skipped_ticks: status.skipped_ticks,
        realtime: grants.fifo,
        poses_published,
        poses_accepted: status.tools.values().nth(tool).map_or(0, |t| t.poses_accepted),
        frames_received: seen.frames,
        frames_missed: seen.frames_missed,
        frames_enriched: seen.frames_enriched,
        wrenches_received: seen.wrenches,
        motion_to_force_us: seen.motion_to_force_us(),
        max_penetration_m: object.max_penetration_m,
        peak_force_n: seen.peak_force_n,
        peak_displacement_m: seen.peak_displacement_m.into(),
        picture: files.picture,
        live_picture: files.live_picture,
        glb: files.glb,
    }
}
