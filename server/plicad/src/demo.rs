//! A daemon and a real client in one process: the tool presses, slides and lets go, and what came of it is kept. Then one
//! press that was never trained on is compared with the accurate model.

mod files;
mod held_out;
mod path;
mod summary;
mod witness;

use std::net::TcpListener;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use nalgebra::{Isometry3, Translation3};
use plica_client::{Client, ClientOptions, PoseSource};
use plica_daemon::bus::BusOptions;
use plica_daemon::server::Server;
use plica_geometry::DisplaySurface;
use plica_scene::Config;

pub use held_out::{Distance, Errors};
pub use path::{Path as DemoPath, from_poses, scripted};
use summary::{Files, Played, summarise};
pub use summary::{Percentiles, Summary, Trained};
use witness::{Seen, Witness};

/// Poses per second that the client publishes on a scripted path.
const POSE_HZ: f64 = 250.0;

/// Serves `config`, which names the examples of `trained`, on a free loopback port, plays `path` through a client, solves a
/// press that is not among them, and writes pictures and GLB into `out`.
pub fn run(config: &Config, path: &DemoPath, trained: Trained, out: &Path) -> anyhow::Result<Summary> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let endpoint = free_endpoint()?;
    let options = BusOptions { listen: Some(endpoint.clone()), ..BusOptions::default() };
    let server = Server::start(config, &options, false)?;
    let surface = DisplaySurface::new(&server.model().description().skin);
    let client = Client::connect(&ClientOptions { endpoint, ..ClientOptions::default() })?;
    let (seen, poses_published) = play(&client, config, path, &surface)?;
    let status = client.status()?;
    let grants = server.grants().clone();
    client.close();
    server.stop();
    let held_out = held_out::held_out(config, &trained.database)?;
    let files = Files {
        picture: files::write_comparison(config, &surface, &held_out, trained.examples, out)?,
        live_picture: files::write_live_picture(config, path, &surface, &seen, out)?,
        glb: files::write_mesh(&surface, &seen, out)?,
    };
    let played = Played { status: &status, grants: &grants, seen: &seen, poses_published, tool: path.tool };
    Ok(summarise(played, trained, held_out.errors, files))
}

fn free_endpoint() -> anyhow::Result<String> {
    let free = TcpListener::bind("127.0.0.1:0").context("no free port on loopback")?;
    Ok(format!("tcp/{}", free.local_addr()?))
}

/// Publishes the path in real time, while a witness keeps what arrives.
fn play(client: &Client, config: &Config, path: &DemoPath, surface: &DisplaySurface) -> anyhow::Result<(Seen, u64)> {
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

/// A pose as an isometry.
fn isometry(position_m: [f64; 3], xyzw: [f64; 4]) -> Isometry3<f64> {
    let [x, y, z, w] = xyzw;
    let rotation = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(position_m), rotation)
}
