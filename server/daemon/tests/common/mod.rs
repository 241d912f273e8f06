//! A small scene served on a free port.

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use plica_client::protocol::pose::Pose;
use plica_client::{Client, ClientOptions};
use plica_daemon::bus::BusOptions;
use plica_daemon::replay::Replay;
use plica_daemon::server::Server;
use plica_daemon::wire;
use plica_scene::Config;
use plica_scene::model;
use plica_scene::motion::TimedPose;
use zenoh::Wait;

/// How many ticks count as a while.
pub(crate) const TICKS_FOR_A_WHILE: u64 = 2000;

const SCENE: &str = r#"
[objects.block]
mesh = { generator = "block", size_m = [0.04, 0.04, 0.02] }
material = { young_modulus_pa = 3e4, poisson_ratio = 0.4, density_kg_per_m3 = 1000.0 }
supports = { fixed = { faces = ["z_min"] } }
coarse = { divisions = [4, 4, 2] }
skin = { spacing_m = 0.002 }
[tools.ball]
shape = { ball = { radius_m = 0.006 } }
coupling = "rigid"
friction = 0.5
stale_after_ms = 60000.0
[runtime]
realtime_priority = 0
lock_memory = false
"#;

pub(crate) struct TestServer {
    server: Server,
    endpoint: String,
}

impl TestServer {
    pub(crate) fn start(lock_step: bool) -> Self {
        Self::start_with(&config(), lock_step)
    }

    /// A scene whose tool is stale after a tenth of a second.
    pub(crate) fn start_with_impatient_tool() -> Self {
        let scene = SCENE.replace("stale_after_ms = 60000.0", "stale_after_ms = 100.0");
        Self::start_with(&Config::parse(Path::new("block.toml"), &scene).unwrap(), false)
    }

    fn start_with(config: &Config, lock_step: bool) -> Self {
        let endpoint = free_endpoint();
        let options = BusOptions { listen: Some(endpoint.clone()), ..BusOptions::default() };
        Self { server: Server::start(config, &options, lock_step).unwrap(), endpoint }
    }

    pub(crate) fn client(&self) -> Client {
        Client::connect(&ClientOptions { endpoint: self.endpoint.clone(), ..ClientOptions::default() }).unwrap()
    }

    pub(crate) fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// A session that may do what no well-behaved client does.
    pub(crate) fn raw_session(&self) -> zenoh::Session {
        raw_session(&self.endpoint)
    }

    pub(crate) fn stop(self) {
        self.server.stop();
    }
}

fn raw_session(endpoint: &str) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    let endpoints = format!("[\"{endpoint}\"]");
    let settings =
        [("mode", "\"client\""), ("connect/endpoints", endpoints.as_str()), ("scouting/multicast/enabled", "false")];
    settings.iter().for_each(|(key, value)| config.insert_json5(key, value).unwrap());
    zenoh::open(config).wait().unwrap()
}

/// What a subscriber can do wrong. Each runs in a process of its own: Zenoh's threads are shared within one.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Misbehaviour {
    Sleeps,
    Stopped,
    Panics,
}

/// A misbehaving process; ended when dropped.
pub(crate) struct Culprit(Child);

impl Drop for Culprit {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const MISBEHAVIOUR: &str = "PLICA_TEST_MISBEHAVIOUR";
const ENDPOINT: &str = "PLICA_TEST_ENDPOINT";

impl Misbehaviour {
    /// Starts this test program again as such a subscriber, and waits until it has subscribed.
    pub(crate) fn start(self, endpoint: &str) -> Culprit {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["misbehaving_subscriber", "--exact", "--nocapture"])
            .env(MISBEHAVIOUR, format!("{self:?}"))
            .env(ENDPOINT, endpoint)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        assert!(lines.any(|line| line.unwrap().contains("subscribed")), "it ended early");
        if let Self::Stopped = self {
            let id = child.id().to_string();
            assert!(Command::new("kill").args(["-STOP", &id]).status().unwrap().success());
        }
        Culprit(child)
    }
}

pub(crate) fn misbehave_if_asked() {
    let Ok(kind) = std::env::var(MISBEHAVIOUR) else { return };
    let session = raw_session(&std::env::var(ENDPOINT).unwrap());
    let callback = move |_| match kind.as_str() {
        "Sleeps" => std::thread::sleep(Duration::from_millis(50)),
        "Panics" => panic!("on purpose"),
        _ => {}
    };
    let _subscriber = session.declare_subscriber("plica/v1/main/**").callback(callback).wait().unwrap();
    println!("subscribed");
    std::thread::sleep(Duration::from_secs(60));
}

fn free_endpoint() -> String {
    format!("tcp/{}", TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap())
}

fn config() -> Config {
    Config::parse(Path::new("block.toml"), SCENE).unwrap()
}

/// The ball above the middle of the block, its centre at `z` (it touches at 0.026).
pub(crate) fn pose(source_id: u32, sequence: u64, z: f64) -> Pose {
    Pose { sequence, source_id, source_time_ns: 1_000_000 * sequence, position_m: [0.02, 0.02, z], ..Pose::default() }
}

/// A path that presses 4 mm and slides, one pose per tick.
pub(crate) fn pose_on_path(tick: u64) -> Pose {
    let t = tick as f64;
    let position_m = [0.02 + 5e-5 * t, 0.02, 0.027 - 1e-4 * t.min(50.0)];
    Pose { position_m, ..pose(1, tick + 1, 0.0) }
}

/// Positions after each tick of the path, as `simulate` computes them.
pub(crate) fn replay_bytes(n_ticks: u64) -> Vec<Vec<u8>> {
    let model = Arc::new(model::build(&config()).unwrap());
    let timed =
        |tick: u64| TimedPose { time_s: 1e-3 * tick as f64, tool: 0, sample: wire::pose_sample(&pose_on_path(tick)) };
    let mut replay = Replay::new(model, (0..n_ticks).map(timed).collect());
    let mut frames = Vec::new();
    for _ in 0..n_ticks {
        replay.want_frame();
        replay.tick(&mut plica_sim::NoProbe);
        frames.push(replay.frame().positions.iter().flatten().flat_map(|x| x.to_le_bytes()).collect());
    }
    frames
}

/// Polls for at most ten seconds.
pub(crate) fn wait_for(what: &str, mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < Duration::from_secs(10), "{what}: nothing in ten seconds");
        std::thread::sleep(Duration::from_millis(10));
    }
}
