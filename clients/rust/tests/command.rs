//! The `plica` command: a replay is byte by byte what was recorded, and errors say what to do.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod common;

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use plica_client::PoseSource;
use plica_client::recording::{Recorded, read};
use serde_json::Value;
use tempfile::TempDir;

use common::SmallDaemon;

fn plica(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_plica"));
    command.args(arguments).arg("--json").stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn last_line(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    serde_json::from_str(text.lines().last().unwrap_or_else(|| panic!("no output; {errors}"))).unwrap()
}

fn poses(path: &Path) -> Vec<Recorded> {
    read(path).unwrap().map(Result::unwrap).collect()
}

/// Starts `plica record` for a number of poses, or a minute if they never come, and waits until it has subscribed.
fn record(daemon: &SmallDaemon, path: &Path, n_poses: &str) -> Child {
    let path = path.to_str().unwrap();
    let until = ["--max-poses", n_poses, "--seconds", "60", "--connect", &daemon.endpoint];
    let child = plica(&["record", path]).args(until).spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(10);
    let publisher = zenoh::Wait::wait(daemon.session.declare_publisher("plica/v1/main/tool/left/pose")).unwrap();
    let listens = || zenoh::Wait::wait(publisher.matching_status()).unwrap().matching();
    while !listens() && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(listens(), "the recorder never subscribed");
    child
}

fn bytes_by_tool(messages: &[Recorded], tool: &str) -> Vec<Vec<u8>> {
    messages.iter().filter(|m| m.key.contains(tool)).map(|m| m.bytes.clone()).collect()
}

#[test]
fn record_replay_record_gives_the_same_poses() {
    // A daemon that subscribes to poses itself would hide whether the recorder does.
    let daemon = SmallDaemon::silent();
    let folder = TempDir::new().unwrap();
    let (first, second) = (folder.path().join("1.mcap"), folder.path().join("2.mcap"));

    let recorder = record(&daemon, &first, "400");
    let client = daemon.client();
    let (mut left, mut right) = (PoseSource::new(), PoseSource::new());
    let to = |tool: &str| client.lossless_pose_publisher(tool).unwrap();
    let (to_left, to_right) = (to("left"), to("right"));
    for n in 0..200 {
        let at = f64::from(n) * 1e-3;
        to_left.publish(&left.pose([at, 0.1, 0.2], [0.0, 0.0, 0.0, 0.999])).unwrap();
        to_right.publish(&right.pose([at / 3.0, 0.0, 0.0], [0.0, 0.0, 0.6, 0.8])).unwrap();
        std::thread::sleep(Duration::from_millis(2));
    }
    let result = last_line(&recorder.wait_with_output().unwrap());
    assert_eq!((&result["poses"], &result["dropped"]), (&400.into(), &0.into()), "{result}");

    let recorder = record(&daemon, &second, "400");
    let path = first.to_str().unwrap();
    let replay = plica(&["replay", path, "--speed", "2", "--connect", &daemon.endpoint]).output().unwrap();
    assert_eq!(last_line(&replay)["poses"], 400, "{}", String::from_utf8_lossy(&replay.stderr));
    let result = last_line(&recorder.wait_with_output().unwrap());
    assert_eq!((&result["poses"], &result["dropped"]), (&400.into(), &0.into()), "{result}");

    let (first, second) = (poses(&first), poses(&second));
    assert_eq!((first.len(), second.len()), (400, 400));
    for tool in ["/left/", "/right/"] {
        assert_eq!(bytes_by_tool(&first, tool), bytes_by_tool(&second, tool));
    }
}

#[test]
fn a_missing_daemon_is_named_with_what_to_do() {
    let output = plica(&["status", "--connect", "tcp/127.0.0.1:9"]).output().unwrap();
    assert!(!output.status.success());
    let error = last_line(&output)["error"]["message"].as_str().unwrap().to_owned();
    assert!(error.starts_with("no plicad answered on tcp/127.0.0.1:9: start one with `plicad serve`"), "{error}");
}

#[test]
fn status_and_rpc_print_one_object() {
    let daemon = SmallDaemon::start();
    let ask = |arguments: &[&str]| last_line(&plica(arguments).args(["--connect", &daemon.endpoint]).output().unwrap());
    assert_eq!(ask(&["status"])["scene"], "small");
    assert_eq!(ask(&["rpc", "step", r#"{"ticks": 3}"#])["tick"], 3);
    let refused = &ask(&["rpc", "explode"])["error"];
    assert!(refused["message"].as_str().unwrap().starts_with("rpc_unknown: no method `explode`"), "{refused}");
    assert_eq!((&refused["code"], &refused["retryable"]), (&"rpc_unknown".into(), &false.into()));
    assert_eq!(refused["done"], "no");
    assert!(ask(&["rpc", "step", "{ticks}"])["error"]["message"].as_str().unwrap().contains("is not JSON"));
}

#[test]
fn probe_latency_and_export() {
    let daemon = SmallDaemon::start();
    let ask = |arguments: &[&str]| last_line(&plica(arguments).args(["--connect", &daemon.endpoint]).output().unwrap());
    let short = ["--seconds", "0.2", "--rate-hz", "100"];
    let result = ask(&[&["probe", "--pattern", "circle"], short.as_slice()].concat());
    assert_eq!((&result["tool"], &result["poses"]), (&"probe".into(), &20.into()), "{result}");
    // The small daemon sends the position back as force: the pattern stays around the middle of the plate.
    let peak = result["peak_force_n"].as_f64().unwrap();
    assert!((0.03..0.06).contains(&peak), "{result}");

    let result = ask(&[["latency"].as_slice(), short.as_slice()].concat());
    // Streams may drop; an echo that came is counted once.
    assert!((1..=20).contains(&result["echoed"].as_u64().unwrap()), "{result}");
    let p50_us = result["motion_to_force_us"]["p50"].as_f64().unwrap();
    assert!(p50_us > 1.0 && p50_us < 1e6, "{result}");

    let folder = TempDir::new().unwrap();
    let (mesh, skin) = (folder.path().join("a.glb"), folder.path().join("a.plsk"));
    ask(&["export", "--mesh", mesh.to_str().unwrap(), "--skin", skin.to_str().unwrap()]);
    assert_eq!(std::fs::read(mesh).unwrap(), common::mesh_bytes());
    assert_eq!(std::fs::read(skin).unwrap(), common::frame(7));

    assert!(
        ask(&["probe", "--tool", "knife"])["error"]["message"]
            .as_str()
            .unwrap()
            .contains("no tool `knife`; it has: probe")
    );
}

#[test]
fn probe_follows_a_trajectory() {
    let daemon = SmallDaemon::start();
    let ask = |arguments: &[&str]| last_line(&plica(arguments).args(["--connect", &daemon.endpoint]).output().unwrap());
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("hand.tum");
    std::fs::write(&path, "100.0 5 5 5 0 0 0 1\n100.1 6 6 6 0 0 0 1\n100.2 5 5 5 0 0 0 1\n").unwrap();
    let path = path.to_str().unwrap();
    let result = ask(&["probe", "--poses", path, "--fit"]);
    assert_eq!(result["poses"], 3, "{result}");
    assert!(result["seconds"].as_f64().unwrap() >= 0.2, "{result}");
    assert!(result["peak_force_n"].as_f64().unwrap() < 0.06, "{result}");
    assert!(ask(&["probe", "--poses", "none.csv"])["error"]["message"].as_str().unwrap().starts_with("none.csv: "));
}
