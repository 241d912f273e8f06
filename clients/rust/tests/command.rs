//! The `plica` command: a replay is byte by byte what was recorded, and errors say what to do.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod common;

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use plica_client::PoseSource;
use plica_client::recording::{Kind, Recorded, Recording, read};
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

fn recording(path: &Path) -> Recording {
    read(path, &Kind::POSES).unwrap()
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

    let (first, second) = (recording(&first).messages, recording(&second).messages);
    assert_eq!((first.len(), second.len()), (400, 400));
    for tool in ["/left/", "/right/"] {
        assert_eq!(bytes_by_tool(&first, tool), bytes_by_tool(&second, tool));
    }
}

/// Messages of a file that is being written.
fn so_far(path: &Path) -> usize {
    read(path, &Kind::POSES).map_or(0, |recording| recording.messages.len())
}

#[test]
fn a_killed_recorder_leaves_a_file_that_is_read_and_replayed() {
    let daemon = SmallDaemon::silent();
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("killed.mcap");
    let mut recorder = record(&daemon, &path, "1000000");
    let client = daemon.client();
    let (publisher, mut source) = (client.lossless_pose_publisher("left").unwrap(), PoseSource::new());
    for n in 0..100 {
        publisher.publish(&source.pose([f64::from(n) * 1e-3, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])).unwrap();
    }
    // All of it comes into the file although the recorder goes on.
    let deadline = Instant::now() + Duration::from_secs(20);
    while so_far(&path) < 100 && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(50));
    }
    recorder.kill().unwrap();
    recorder.wait().unwrap();
    let left = recording(&path);
    assert_eq!((left.messages.len(), left.has_end), (100, false));

    let replay = plica(&["replay", path.to_str().unwrap(), "--fast", "--connect", &daemon.endpoint]).output().unwrap();
    assert_eq!(last_line(&replay)["poses"], 100);
    let notes = String::from_utf8_lossy(&replay.stderr);
    assert!(notes.contains("killed.mcap: the file has no end") && notes.contains("100 messages over 0."), "{notes}");
}

/// `PLICA_SECONDS=600 cargo test --release --workspace --test command -- --ignored --nocapture killed_after`
#[test]
#[ignore = "runs as long as PLICA_SECONDS says, by default ten minutes"]
fn a_recorder_killed_after_minutes_lacks_at_most_a_second() {
    let seconds = std::env::var("PLICA_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(600_u64);
    let daemon = SmallDaemon::silent();
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("killed.mcap");
    let seconds_text = (seconds + 60).to_string();
    let mut recorder =
        plica(&["record", path.to_str().unwrap(), "--seconds", &seconds_text, "--connect", &daemon.endpoint])
            .spawn()
            .unwrap();
    let client = daemon.client();
    let (publisher, mut source) = (client.lossless_pose_publisher("left").unwrap(), PoseSource::new());
    let (start, mut n_sent) = (Instant::now(), 0_u64);
    while start.elapsed() < Duration::from_secs(seconds) {
        publisher.publish(&source.pose([0.0; 3], [0.0, 0.0, 0.0, 1.0])).unwrap();
        n_sent += 1;
        std::thread::sleep((start + Duration::from_millis(4 * n_sent)).saturating_duration_since(Instant::now()));
    }
    let killed_ns = source.clock().now_ns();
    recorder.kill().unwrap();
    recorder.wait().unwrap();
    let left = recording(&path);
    let missing_s = killed_ns.saturating_sub(left.messages.last().unwrap().log_time_ns) as f64 * 1e-9;
    println!(
        "{n_sent} poses in {seconds} s, {} in the file; the last {missing_s:.2} s are missing",
        left.messages.len()
    );
    assert!(missing_s < 1.0);
}

#[test]
fn files_that_hold_no_poses_are_refused_before_anything_is_published() {
    let daemon = SmallDaemon::start();
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let refused = |content: &[u8]| {
        std::fs::write(&path, content).unwrap();
        let output = plica(&["replay", path.to_str().unwrap(), "--connect", &daemon.endpoint]).output().unwrap();
        assert!(!output.status.success());
        last_line(&output)["error"]["message"].as_str().unwrap().to_owned()
    };
    assert!(refused(b"").contains("the file is empty"));
    assert!(refused(b"time_s,tool,px").contains("not an MCAP file"));
    assert!(refused(mcap::MAGIC).contains("no poses; was a tracker publishing during the recording?"));
}

#[test]
fn rejected_poses_are_told_by_kind() {
    let daemon = SmallDaemon::start();
    daemon.conflicts.store(true, Relaxed);
    let run = |arguments: &[&str]| plica(arguments).args(["--connect", &daemon.endpoint]).output().unwrap();
    let short = ["--seconds", "0.2", "--rate-hz", "100"];
    let result = last_line(&run(&[["probe"].as_slice(), &short].concat()));
    let n_rejected = result["poses_rejected"]["probe"]["conflict"].as_u64().unwrap();
    assert!(n_rejected >= result["poses"].as_u64().unwrap(), "{result}");
    let error = last_line(&run(&[["latency"].as_slice(), &short].concat()))["error"]["message"].to_string();
    assert!(error.contains("conflict (another source moves this tool: stop it)"), "{error}");

    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let mut recorder = plica_client::recording::Recorder::create(&path).unwrap();
    let pose = PoseSource::new().pose([0.0; 3], [0.0, 0.0, 0.0, 1.0]).encode().to_vec();
    let key = "plica/v1/main/tool/probe/pose".to_owned();
    recorder.write(&Recorded { key, kind: Kind::Pose, log_time_ns: 5, bytes: pose }).unwrap();
    recorder.finish().unwrap();
    let replay = run(&["replay", path.to_str().unwrap()]);
    assert_eq!(last_line(&replay)["poses_rejected"]["probe"]["conflict"], 1);
    daemon.conflicts.store(false, Relaxed);
    assert_eq!(last_line(&run(&["replay", path.to_str().unwrap()]))["poses_rejected"], serde_json::json!({}));
}

#[test]
fn a_tool_is_lifted_where_its_motion_ends_in_the_object() {
    let daemon = SmallDaemon::start();
    let deepest_and_last = |arguments: &[&str]| {
        daemon.positions_m.lock().unwrap().clear();
        let output = plica(arguments).args(["--connect", &daemon.endpoint]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let heights_m: Vec<f64> = daemon.positions_m.lock().unwrap().iter().map(|p| p[2]).collect();
        (heights_m.iter().copied().fold(f64::INFINITY, f64::min), *heights_m.last().unwrap())
    };
    // One second is half of a press; the top of the plate is at 10 mm, the radius of the tip 7 mm.
    for arguments in [["probe", "--seconds", "1"], ["latency", "--seconds", "1"]] {
        let (deepest_m, last_m) = deepest_and_last(&arguments);
        assert!(deepest_m < 0.017 && last_m > 0.03, "{arguments:?}: {deepest_m} {last_m}");
    }
}

#[test]
fn the_text_of_a_library_is_shown_on_request_only() {
    let said = |arguments: &[&str]| {
        let output = plica(arguments).args(["--connect", "tcp/127.0.0.1:9"]).output().unwrap();
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let plain = said(&["status"]);
    assert!(!plain.contains(".rs") && plain.lines().count() == 1, "{plain}");
    assert!(said(&["status", "--verbose"]).contains("Unable to connect"));
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
    assert_eq!(std::fs::read(&skin).unwrap(), common::frame(7));
    std::fs::remove_file(&skin).unwrap();
    ask(&["export", "--skin", skin.to_str().unwrap()]);
    assert_eq!(std::fs::read(skin).unwrap(), common::frame(7));
    assert!(ask(&["export"])["error"]["message"].as_str().unwrap().contains("--mesh <MESH>|--skin <SKIN>"));

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
