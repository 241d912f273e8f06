//! `probe`: a scripted tool, or one that follows a recorded trajectory at its own times.

use std::time::{Duration, Instant};

use plica_client::pattern::Pattern;
use plica_client::trajectory::{self, TrackedPose};
use plica_client::{Client, PoseSource};
use serde_json::json;

use super::Stop;
use super::motion::{Plan, plan};
use crate::args::{Motion, Probe};
use crate::output::{Output, progress};

const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
const WRENCHES_WAITING: usize = 4096;

pub(crate) fn run(client: &Client, probe: &Probe, output: Output) -> anyhow::Result<()> {
    let plan = plan(client, &probe.motion)?;
    let poses = match &probe.poses {
        Some(file) => recorded(file, probe.fit, &plan)?,
        None => scripted(&probe.motion, &plan),
    };
    let stop = Stop::on_signals()?;
    let wrenches = client.subscribe_wrenches(&plan.tool, WRENCHES_WAITING)?;
    let bar = progress(Some(poses.len() as u64), "poses");
    let (mut published, mut peak_n, mut contacts) = (0_u64, 0.0_f64, 0_u64);
    let mut sources = Sources::default();
    let start = Instant::now();
    for pose in &poses {
        if !stop.sleep_until(start + Duration::from_secs_f64(pose.time_s.max(0.0))) {
            break;
        }
        let tool = pose.tool.as_deref().unwrap_or(&plan.tool);
        client.publish_pose(tool, &sources.of(tool).pose(pose.position_m, pose.orientation_xyzw))?;
        published += 1;
        bar.inc(1);
        while let Some(message) = wrenches.try_next() {
            peak_n = peak_n.max(norm(message.wrench.force_n));
            contacts += u64::from(message.wrench.flags.in_contact);
            bar.set_message(format!("{:.3} N", norm(message.wrench.force_n)));
        }
    }
    bar.finish_and_clear();
    let stats = wrenches.stats();
    let seconds = start.elapsed().as_secs_f64();
    let value = json!({
        "tool": plan.tool, "poses": published, "seconds": seconds, "peak_force_n": peak_n,
        "wrenches_received": stats.received, "wrenches_missed": stats.missed, "wrenches_in_contact": contacts,
    });
    let text = format!(
        "{published} poses to `{}` in {seconds:.1} s; {} wrenches back, {contacts} in contact, peak force {peak_n:.3} N",
        plan.tool, stats.received
    );
    output.result(&value, &text);
    Ok(())
}

/// Each tool has its own numbering.
#[derive(Default)]
struct Sources(std::collections::BTreeMap<String, PoseSource>);

impl Sources {
    fn of(&mut self, tool: &str) -> &mut PoseSource {
        self.0.entry(tool.to_owned()).or_default()
    }
}

fn recorded(file: &std::path::Path, fit: bool, plan: &Plan) -> anyhow::Result<Vec<TrackedPose>> {
    let mut poses = trajectory::read(file)?;
    if fit {
        trajectory::fit(&mut poses, plan.workspace)?;
    }
    Ok(poses)
}

fn scripted(motion: &Motion, plan: &Plan) -> Vec<TrackedPose> {
    let n_poses = (motion.seconds * motion.rate_hz).ceil() as u64;
    let pattern = Pattern::from(motion.pattern);
    (0..n_poses)
        .map(|n| n as f64 / motion.rate_hz)
        .map(|time_s| TrackedPose {
            time_s,
            tool: None,
            position_m: pattern.position_m(&plan.path, time_s),
            orientation_xyzw: UPRIGHT,
        })
        .collect()
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}
