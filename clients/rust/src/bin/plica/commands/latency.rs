//! `latency`: from the source time of a pose to the first wrench that echoes it, on this machine's clock.

use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use hdrhistogram::Histogram;
use plica_client::pattern::Pattern;
use plica_client::{Client, PoseSource, SourceClock, Subscription, WrenchMessage};
use serde_json::json;

use super::Stop;
use super::motion::plan;
use super::rejected::{Before, Rejected};
use crate::args::Latency;
use crate::output::{Output, progress};

const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
const WRENCHES_WAITING: usize = 8192;
/// Wait for echoes after the last pose.
const LAST_ECHO: Duration = Duration::from_millis(200);
/// Largest recorded latency, one minute; longer ones count as this.
const MOST_NS: u64 = 60_000_000_000;

pub(crate) fn run(client: &Client, latency: &Latency, output: Output) -> anyhow::Result<()> {
    let motion = &latency.motion;
    let plan = plan(client, motion)?;
    let stop = Stop::on_signals()?;
    let wrenches = client.subscribe_wrenches(&plan.tool, WRENCHES_WAITING)?;
    let publisher = client.pose_publisher(&plan.tool)?;
    let pattern = Pattern::from(motion.pattern);
    let n_poses = (motion.seconds * motion.rate_hz).ceil() as u64;
    let mut source = PoseSource::new();
    let clock = source.clock();
    let before = Before::new(client);
    let mut last_m = None;
    let mut echoes = Echoes::new(clock.now_ns())?;
    let bar = progress(Some(n_poses), "poses");
    let (start, mut published) = (Instant::now(), 0_u64);
    for n in 0..n_poses {
        let time_s = n as f64 / motion.rate_hz;
        if !stop.sleep_until(start + Duration::from_secs_f64(time_s)) {
            break;
        }
        let at_m = pattern.position_m(&plan.path, time_s);
        publisher.publish(&source.pose(at_m, UPRIGHT))?;
        last_m = Some(at_m);
        published += 1;
        echoes.collect(&wrenches, clock);
        bar.inc(1);
    }
    stop.sleep_until(Instant::now() + LAST_ECHO);
    echoes.collect(&wrenches, clock);
    bar.finish_and_clear();
    if let Some(last_m) = last_m {
        plan.lift(last_m, |at_m| publisher.publish(&source.pose(at_m, UPRIGHT)))?;
    }
    report(&echoes.histogram, &plan.tool, published, &before.since(client), output)
}

/// First echo of each source time.
struct Echoes {
    histogram: Histogram<u64>,
    newest_ns: u64,
}

impl Echoes {
    fn new(start_ns: u64) -> anyhow::Result<Self> {
        let histogram = Histogram::new_with_bounds(1, MOST_NS, 3).context("histogram bounds")?;
        Ok(Self { histogram, newest_ns: start_ns })
    }

    /// Source times before `start_ns` belong to other publishers and are left out.
    fn collect(&mut self, wrenches: &Subscription<WrenchMessage>, clock: SourceClock) {
        while let Some(WrenchMessage { wrench, received }) = wrenches.try_next() {
            let (sent_ns, received_ns) = (wrench.pose_source_time_ns, clock.at_ns(received));
            if sent_ns > self.newest_ns && sent_ns <= received_ns {
                self.newest_ns = sent_ns;
                self.histogram.saturating_record((received_ns - sent_ns).max(1));
            }
        }
    }
}

fn report(
    histogram: &Histogram<u64>,
    tool: &str,
    published: u64,
    rejected: &Rejected,
    output: Output,
) -> anyhow::Result<()> {
    if histogram.is_empty() {
        let rejected = rejected.sentences().join("; ");
        if rejected.is_empty() {
            bail!("no wrench of `{tool}` echoed a pose, and none was rejected: is the daemon paused, or in lock-step?");
        }
        bail!("no wrench of `{tool}` echoed a pose: {rejected}");
    }
    let us = |ns: u64| ns as f64 / 1e3;
    let at = |quantile: f64| us(histogram.value_at_quantile(quantile));
    let (min, p50, p90, p99) = (us(histogram.min()), at(0.5), at(0.9), at(0.99));
    let (p999, max, echoed) = (at(0.999), us(histogram.max()), histogram.len());
    let value = json!({
        "tool": tool, "poses": published, "echoed": echoed,
        "poses_rejected": rejected.json(),
        "motion_to_force_us": {"count": echoed, "min": min, "p50": p50, "p90": p90, "p99": p99, "p999": p999, "max": max},
    });
    let text =
        format!("motion to force: p50 {p50:.0}, p99 {p99:.0}, max {max:.0} us ({echoed} of {published} poses echoed)");
    output.result(&value, &rejected.below(text));
    Ok(())
}
