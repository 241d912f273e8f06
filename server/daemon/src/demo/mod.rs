//! A daemon and a real client in one process: the tool presses, slides and lets go, and what came of it is kept.

mod path;
mod witness;

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use nalgebra::{Isometry3, Point3, Translation3};
use plica_client::{Client, ClientOptions, PoseSource};
use plica_geometry::export::write_glb;
use plica_protocol::status::Status;
use serde::Serialize;

use crate::bus::BusOptions;
use crate::config::Config;
use crate::picture::{Subject, draw};
use crate::realtime::Grants;
use crate::server::Server;
use crate::surface::{Surface, normals_into};

pub use path::{Path as DemoPath, from_file, scripted};
use witness::{Seen, Witness};

/// Poses per second that the client publishes on a scripted path.
const POSE_HZ: f64 = 250.0;

/// What `demo --json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
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
    /// Picture of the deformed skin.
    pub picture: PathBuf,
    /// The deformed skin.
    pub glb: PathBuf,
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

/// Serves `config` on a free loopback port, plays `path` through a client, writes picture and GLB into `out`.
pub fn run(config: &Config, path: &DemoPath, out: &Path) -> anyhow::Result<Summary> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let endpoint = free_endpoint()?;
    let options = BusOptions { listen: Some(endpoint.clone()), ..BusOptions::default() };
    let server = Server::start(config, &options, false)?;
    let surface = Surface::new(&server.model().description().skin);
    let client = Client::connect(&ClientOptions { endpoint, ..ClientOptions::default() })?;
    let (seen, published) = play(&client, config, path, &surface)?;
    let status = client.status()?;
    let grants = server.grants().clone();
    client.close();
    server.stop();
    let files = write_files(config, path, &surface, &seen, out)?;
    Ok(summarise(&status, &grants, &seen, published, path, files))
}

fn free_endpoint() -> anyhow::Result<String> {
    let free = TcpListener::bind("127.0.0.1:0").context("no free port on loopback")?;
    Ok(format!("tcp/{}", free.local_addr()?))
}

/// Publishes the path in real time, while a witness keeps what arrives.
fn play(client: &Client, config: &Config, path: &DemoPath, surface: &Surface) -> anyhow::Result<(Seen, u64)> {
    let tool = &config.tools()[path.tool].name;
    let witness = Witness::start(client, config.object().name(), tool, surface)?;
    let publisher = client.pose_publisher(tool)?;
    let mut source = PoseSource::new();
    let progress = bar(path.duration_s())?;
    let begin = Instant::now();
    let mut published = 0;
    for (time_s, pose) in path.poses(POSE_HZ) {
        let due = Duration::from_secs_f64(time_s);
        std::thread::sleep(due.saturating_sub(begin.elapsed()));
        publisher.publish(&source.pose(pose.0, pose.1))?;
        published += 1;
        progress.set_position((1e3 * time_s) as u64);
    }
    // The last answers are still under way.
    std::thread::sleep(Duration::from_millis(300));
    progress.finish_and_clear();
    Ok((witness.finish(source.clock())?, published))
}

fn bar(seconds: f64) -> anyhow::Result<ProgressBar> {
    let style = ProgressStyle::with_template("{bar:40} {percent} % of the demo, {eta} left")?;
    Ok(ProgressBar::new((1e3 * seconds) as u64).with_style(style))
}

fn write_files(
    config: &Config,
    path: &DemoPath,
    surface: &Surface,
    seen: &Seen,
    out: &Path,
) -> anyhow::Result<(PathBuf, PathBuf)> {
    let (picture, glb) = (out.join("demo.png"), out.join("demo.glb"));
    let positions = if seen.deepest.is_empty() { &surface.rest } else { &seen.deepest };
    let proxy = seen.proxy.unwrap_or_else(Isometry3::identity);
    let (time_s, force_n) = (seen.deepest_sim_time_s, seen.force_then_n);
    let subtitle = format!("t = {time_s:.2} s, force {force_n:.2} N");
    let title = format!("{}: deepest press", config.name());
    let shape = &config.tools()[path.tool].shape;
    let subject = Subject {
        title: &title,
        subtitle: &subtitle,
        surface,
        positions,
        tools: vec![(shape, proxy)],
        focus: Point3::from(proxy.translation.vector),
    };
    draw(&subject).save(&picture).with_context(|| format!("cannot write {}", picture.display()))?;
    let mut normals = vec![[0.0; 3]; positions.len()];
    normals_into(&surface.triangles, positions, &mut normals);
    let triangles: Vec<_> = surface.triangles.iter().map(|t| t.map(plica_geometry::VertexIdx)).collect();
    write_glb(&glb, positions, &normals, &triangles).with_context(|| format!("cannot write {}", glb.display()))?;
    Ok((picture, glb))
}

fn summarise(
    status: &Status,
    grants: &Grants,
    seen: &Seen,
    poses_published: u64,
    path: &DemoPath,
    (picture, glb): (PathBuf, PathBuf),
) -> Summary {
    let object = status.objects.values().next().cloned().unwrap_or_default();
    let accepted = status.tools.values().nth(path.tool).map_or(0, |t| t.poses_accepted);
    let percentiles = |d: &plica_protocol::status::Distribution| Percentiles { p50: d.p50, p99: d.p99, p999: d.p999 };
    Summary {
        ticks: status.tick_us.count,
        tick_us: percentiles(&status.tick_us),
        lateness_us: percentiles(&status.lateness_us),
        overruns: status.overruns,
        skipped_ticks: status.skipped_ticks,
        realtime: grants.fifo,
        poses_published,
        poses_accepted: accepted,
        frames_received: seen.frames,
        frames_missed: seen.frames_missed,
        wrenches_received: seen.wrenches,
        motion_to_force_us: seen.motion_to_force_us(),
        max_penetration_m: object.max_penetration_m,
        peak_force_n: seen.peak_force_n,
        peak_displacement_m: seen.peak_displacement_m.into(),
        picture,
        glb,
    }
}

/// A pose as an isometry.
fn isometry(position_m: [f64; 3], xyzw: [f64; 4]) -> Isometry3<f64> {
    let [x, y, z, w] = xyzw;
    let rotation = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(position_m), rotation)
}
