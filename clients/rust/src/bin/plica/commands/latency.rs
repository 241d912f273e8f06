//! `latency`: from the source time of a pose to the first wrench that echoes it, on this machine's clock.

use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use hdrhistogram::Histogram;
use plica_client::pattern::Pattern;
use plica_client::{Client, PoseSource, SourceClock, Subscription, WrenchMessage};
use serde_json::json;

use super::Stop;
use super::motion::plan;
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
    let mut echoes = Echoes::new(clock.now_ns())?;
    let bar = progress(Some(n_poses), "poses");
    let (start, mut published) = (Instant::now(), 0_u64);
    for n in 0..n_poses {
        let time_s = n as f64 / motion.rate_hz;
        if !stop.sleep_until(start + Duration::from_secs_f64(time_s)) {
            break;
        }
        publisher.publish(&source.pose(pattern.position_m(&plan.path, time_s), UPRIGHT))?;
        published += 1;
        echoes.collect(&wrenches, clock);
        bar.inc(1);
    }
    stop.sleep_until(Instant::now() + LAST_ECHO);
    echoes.collect(&wrenches, clock);
    bar.finish_and_clear();
    report(&echoes.histogram, &plan.tool, published, output)
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

fn report(histogram: &Histogram<u64>, tool: &str, published: u64, output: Output) -> anyhow::Result<()> {
    if histogram.is_empty() {
        bail!("no wrench of `{tool}` echoed a pose: `plica status` shows whether they are rejected");
    }
    let us = |ns: u64| ns as f64 / 1e3;
    let at = |quantile: f64| us(histogram.value_at_quantile(quantile));
    let (min, p50, p90, p99) = (us(histogram.min()), at(0.5), at(0.9), at(0.99));
    let (p999, max, echoed) = (at(0.999), us(histogram.max()), histogram.len());
    let value = json!({
        "tool": tool, "poses": published, "echoed": echoed,
        "motion_to_force_us": {"count": echoed, "min": min, "p50": p50, "p90": p90, "p99": p99, "p999": p999, "max": max},
    });
    let text =
        format!("motion to force: p50 {p50:.0}, p99 {p99:.0}, max {max:.0} us ({echoed} of {published} poses echoed)");
    output.result(&value, &text);
    Ok(())
}
