//! `probe`: a scripted tool, or one that follows a recorded trajectory at its own times.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use plica_client::pattern::Pattern;
use plica_client::{Client, PoseSource, Subscription, WrenchMessage};
use plica_trajectory::{self as trajectory, TrackedPose, Trajectory, fit_above, fitted_depth_m};
use serde_json::json;

use super::Stop;
use super::motion::{Plan, plan};
use super::rejected::Before;
use crate::args::{Motion, Probe};
use crate::output::{Output, progress};

/// A motion that takes longer is asked about \[s\].
const LONG_S: f64 = 3600.0;
const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
const WRENCHES_WAITING: usize = 4096;
/// Wait for wrenches after the last pose.
const LAST_ANSWER: Duration = Duration::from_millis(200);
/// Time without a wrench after which the probe queries the daemon.
const SILENCE: Duration = Duration::from_secs(1);

pub(crate) fn run(client: &Client, probe: &Probe, output: Output) -> anyhow::Result<()> {
    let plan = plan(client, &probe.motion)?;
    let (poses, report) = match &probe.poses {
        Some(file) => recorded(file, probe, &plan).map(|motion| (motion.poses, Some(motion.report)))?,
        None => (scripted(&probe.motion, &plan), None),
    };
    report.iter().for_each(|report| output.note(&report.to_string()));
    let stop = Stop::on_signals()?;
    let wrenches = client.subscribe_wrenches(&plan.tool, WRENCHES_WAITING)?;
    let bar = progress(Some(poses.len() as u64), "poses");
    let (mut published, mut answers) = (0_u64, Answers::default());
    let mut sources = Sources::default();
    let before = Before::new(client);
    let mut last: BTreeMap<&str, &TrackedPose> = BTreeMap::new();
    let start = Instant::now();
    let mut answered = Instant::now();
    for pose in &poses {
        if !stop.sleep_until(start + Duration::from_secs_f64(pose.time_s.max(0.0))) {
            break;
        }
        let tool = pose.tool.as_deref().unwrap_or(&plan.tool);
        client.publish_pose(tool, &sources.of(tool).pose(pose.position_m, pose.orientation_xyzw))?;
        published += 1;
        last.insert(tool, pose);
        bar.inc(1);
        let n_before = wrenches.stats().received;
        answers.collect(&wrenches);
        if wrenches.stats().received > n_before {
            answered = Instant::now();
        }
        if answered.elapsed() > SILENCE {
            // Silence alone does not tell a paused daemon from a stopped one.
            client.status()?;
            answered = Instant::now();
        }
        bar.set_message(answers.line());
    }
    let seconds = start.elapsed().as_secs_f64();
    for (tool, pose) in last {
        let source = sources.of(tool);
        plan.lift(pose.position_m, |at_m| client.publish_pose(tool, &source.pose(at_m, pose.orientation_xyzw)))?;
    }
    stop.sleep_until(Instant::now() + LAST_ANSWER);
    answers.collect(&wrenches);
    bar.finish_and_clear();
    let rejected = before.since(client);
    let (stats, Answers { peak_n, contacts, .. }) = (wrenches.stats(), answers);
    let value = json!({
        "tool": plan.tool, "poses": published, "seconds": seconds, "peak_force_n": peak_n,
        "wrenches_received": stats.received, "wrenches_missed": stats.missed, "wrenches_in_contact": contacts,
        "motion": report, "poses_rejected": rejected.json(),
    });
    let text = format!(
        "{published} poses to `{}` in {seconds:.1} s; {} wrenches back, {contacts} in contact, peak force {peak_n:.3} N",
        plan.tool, stats.received
    );
    output.result(&value, &rejected.below(text));
    Ok(())
}

/// Wrenches received.
#[derive(Default)]
struct Answers {
    newest_n: f64,
    peak_n: f64,
    contacts: u64,
    in_contact: bool,
}

impl Answers {
    fn collect(&mut self, wrenches: &Subscription<WrenchMessage>) {
        while let Some(WrenchMessage { wrench, .. }) = wrenches.try_next() {
            self.newest_n = norm(wrench.force_n);
            self.peak_n = self.peak_n.max(self.newest_n);
            self.in_contact = wrench.flags.in_contact;
            self.contacts += u64::from(self.in_contact);
        }
    }

    /// Line that a terminal shows, some times a second.
    fn line(&self) -> String {
        let state = if self.in_contact { "in contact" } else { "free" };
        format!("{state}, {:.3} N, peak {:.3} N", self.newest_n, self.peak_n)
    }
}

/// Each tool has its own numbering.
#[derive(Default)]
struct Sources(BTreeMap<String, PoseSource>);

impl Sources {
    fn of(&mut self, tool: &str) -> &mut PoseSource {
        self.0.entry(tool.to_owned()).or_default()
    }
}

fn recorded(file: &Path, probe: &Probe, plan: &Plan) -> anyhow::Result<Trajectory> {
    let mut motion = trajectory::read(file, probe.reading.options(), plica_client::protocol::pose::gate)?;
    let (seconds, unit) = (motion.report.duration_s, motion.report.time_unit.name());
    anyhow::ensure!(
        seconds <= LONG_S || probe.no_limits,
        "{}: the motion takes {:.1} hours, times taken for {unit}; --time-unit says another unit, --no-limits plays it",
        file.display(),
        seconds / LONG_S
    );
    if probe.fit {
        let depth_m = probe.motion.depth_m.unwrap_or_else(|| fitted_depth_m(&plan.terrain));
        fit_above(&mut motion.poses, &plan.terrain, probe.motion.tip_radius_m, depth_m)?;
    }
    Ok(motion)
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
