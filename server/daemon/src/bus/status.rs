//! Publishes the status two times a second, and answers questions for it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use plica_protocol::status::{Drops, ObjectStatus, REPLY_DROPPED, Status, ToolStatus};
use plica_protocol::{ENCODING_JSON, VERSION};
use plica_sim::Stage;
use triple_buffer::Output;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{Query, Queryable};

use super::error::BusError;
use super::guard::guarded;
use super::replies::{Content, Replies};
use super::scene_info::ToolInfo;
use super::shared::{Shared, spawn};
use super::skin::Published;
use crate::realtime::{Grants, Reading, Statistics};
use crate::wire;

const PERIOD: Duration = Duration::from_millis(500);
const LOOK_AT_STOP: Duration = Duration::from_millis(100);
/// Questions that may wait.
const QUEUE: usize = 16;
/// Version of Zenoh that this build is pinned to.
const ZENOH: &str = "1.10.2";

/// Where the numbers come from.
pub(super) struct Sources {
    pub(super) readings: Output<Reading>,
    pub(super) statistics: Arc<Statistics>,
    pub(super) grants: Grants,
    pub(super) published: Arc<Published>,
}

pub(super) fn start(
    shared: &Arc<Shared>,
    sources: Sources,
    replies: Replies,
) -> Result<(Queryable<()>, JoinHandle<()>), BusError> {
    let (questions_in, questions) = sync_channel(QUEUE);
    let counters = Arc::clone(&shared.counters);
    let callback = guarded(&shared.counters, move |query: Query| {
        if questions_in.try_send(query).is_err() {
            counters.count(REPLY_DROPPED);
        }
    });
    let queryable = shared.session.declare_queryable(shared.keys.status()).callback(callback);
    let queryable = queryable.wait().map_err(|e| shared.error(e))?;
    let publisher = shared
        .session
        .declare_publisher(shared.keys.status())
        .congestion_control(CongestionControl::Drop)
        .priority(Priority::DataHigh)
        .encoding(Encoding::from(ENCODING_JSON))
        .wait()
        .map_err(|e| shared.error(e))?;
    let worker = Worker { shared: Arc::clone(shared), sources, replies, questions, publisher };
    Ok((queryable, spawn("plica-status", move || worker.run())?))
}

struct Worker {
    shared: Arc<Shared>,
    sources: Sources,
    replies: Replies,
    questions: Receiver<Query>,
    publisher: Publisher<'static>,
}

impl Worker {
    fn run(mut self) {
        let mut due = Instant::now();
        while !self.shared.stopping() {
            if Instant::now() >= due {
                due = Instant::now() + PERIOD;
                let json = self.json();
                // Dropped where nobody reads; an error means that the session is closing.
                let _ = self.publisher.put(json).wait();
            }
            let patience = due.saturating_duration_since(Instant::now()).min(LOOK_AT_STOP);
            if let Ok(query) = self.questions.recv_timeout(patience) {
                let content = Content::json(self.shared.keys.status(), self.json());
                self.replies.send(query, Ok(content));
            }
        }
    }

    fn json(&mut self) -> String {
        serde_json::to_string(&self.status()).unwrap_or_else(|e| format!("{{\"error\": \"{e}\"}}"))
    }

    fn status(&mut self) -> Status {
        self.sources.readings.update();
        let Sources { readings, statistics, grants, published } = &self.sources;
        let (shared, reading) = (&self.shared, readings.output_buffer());
        let stage =
            |(i, s): (usize, &Stage)| (s.name().to_owned(), wire::distribution(&statistics.stages[i].summary()));
        Status {
            versions: versions(),
            session: session_name(shared.keys.root()),
            scene: shared.scene.name.clone(),
            uptime_s: shared.started.elapsed().as_secs_f64(),
            tick: reading.tick,
            sim_time_s: reading.sim_time_s,
            paused: reading.paused,
            realtime: wire::realtime(grants),
            tick_us: wire::distribution(&statistics.tick.summary()),
            stages: Stage::ALL.iter().enumerate().map(stage).collect(),
            lateness_us: wire::distribution(&statistics.lateness.summary()),
            overruns: statistics.overruns.load(Relaxed),
            skipped_ticks: statistics.skipped.load(Relaxed),
            objects: BTreeMap::from([(shared.scene.object.clone(), object(shared, reading, published))]),
            tools: tools(shared, reading),
            rejected: shared.counters.copy(),
            drops: Drops { wrenches: statistics.wrench_drops.load(Relaxed), frames: published.dropped.load(Relaxed) },
            jobs: shared.jobs.status(),
            jobs_unavailable: shared.jobs.why_unavailable().map(str::to_owned),
        }
    }
}

fn versions() -> BTreeMap<String, String> {
    let versions =
        [("plicad", env!("CARGO_PKG_VERSION").to_owned()), ("protocol", VERSION.to_string()), ("zenoh", ZENOH.into())];
    versions.into_iter().map(|(name, version)| (name.to_owned(), version)).collect()
}

fn session_name(root: &str) -> String {
    root.rsplit('/').next().unwrap_or(root).to_owned()
}

fn object(shared: &Shared, reading: &Reading, published: &Published) -> ObjectStatus {
    let skin = &shared.model.description().skin;
    ObjectStatus {
        n_vertices: skin.n_vertices() as u32,
        n_triangles: skin.n_triangles() as u32,
        frames_published: published.frames.load(Relaxed),
        ..wire::object_status(reading)
    }
}

fn tools(shared: &Shared, reading: &Reading) -> BTreeMap<String, ToolStatus> {
    let tool = |(i, (info, tool)): (usize, (&ToolInfo, _))| {
        let (poses_accepted, poses_rejected) = shared.intake.counts(i);
        // Rounded to a microsecond: 0.2 s is 200 ms.
        let stale_after_ms = (1e6 * info.stale_after_s).round() / 1e3;
        let of_bus = ToolStatus {
            stale_after_ms,
            sampling: info.sampling.to_owned(),
            poses_accepted,
            poses_rejected,
            force_step_n: reading.force_steps_n[i],
            ..wire::tool_status(tool)
        };
        (info.name.clone(), of_bus)
    };
    shared.scene.tools.iter().zip(&reading.tools).enumerate().map(tool).collect()
}
