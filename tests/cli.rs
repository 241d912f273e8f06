//! The programs from outside: what they print, what they write, how they refuse.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use plica_tests::{program, read, repository};
use serde_json::Value;
use tempfile::TempDir;

fn plicad(arguments: &[&str]) -> Output {
    Command::new(program("plicad")).args(arguments).current_dir(repository()).output().unwrap()
}

/// The one JSON object on the last line of standard output.
fn last_line(output: &Output) -> Value {
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{errors}");
    serde_json::from_str(text.lines().last().unwrap_or_default()).unwrap_or_else(|e| panic!("{e}: {text}{errors}"))
}

fn errors(output: &Output) -> String {
    assert!(!output.status.success(), "it was not refused");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Presses the wedge 4 mm, drags, and lifts: 0.4 s at 250 Hz.
fn write_poses(path: &Path) {
    let mut text = "time_s,tool,px,py,pz,qx,qy,qz,qw\n".to_owned();
    for i in 0..=100 {
        let share = f64::from(i) / 100.0;
        let (x, z) = (0.05 + 0.005 * share, 0.0355 - 0.005 * (std::f64::consts::PI * share).sin());
        writeln!(text, "{},probe,{x},0.03,{z},0,0,0,1", f64::from(i) * 0.004).unwrap();
    }
    fs::write(path, text).unwrap();
}

fn simulate(poses: &Path, out: &Path) -> Value {
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    last_line(&plicad(&["simulate", "wedge", "--poses", poses, "--out", out, "--every", "5", "--json"]))
}

/// Header of a safetensors file: names with type and shape.
fn tensors(file: &[u8]) -> Value {
    let n = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
    serde_json::from_slice(&file[8..8 + n]).unwrap()
}

#[test]
fn simulating_twice_gives_the_same_bytes() {
    let folder = TempDir::new().unwrap();
    let (poses, first, second) =
        (folder.path().join("poses.csv"), folder.path().join("1.safetensors"), folder.path().join("2.safetensors"));
    write_poses(&poses);
    let summary = simulate(&poses, &first);
    simulate(&poses, &second);
    let (first, second) = (fs::read(first).unwrap(), fs::read(second).unwrap());
    assert!(first == second, "two runs differ");

    let header = tensors(&first);
    let shape =
        |name: &str| header[name]["shape"].as_array().unwrap_or_else(|| panic!("no `{name}`: {header}")).clone();
    let n_frames = shape("time_s")[0].clone();
    assert_eq!(shape("positions")[0], n_frames);
    assert_eq!(shape("positions")[2], 3);
    assert_eq!(shape("tick"), std::slice::from_ref(&n_frames));
    assert_eq!(shape("confidence")[0], n_frames);
    assert_eq!(shape("force"), [n_frames.clone(), 1.into(), 3.into()]);
    assert_eq!(shape("proxy"), [n_frames.clone(), 1.into(), 7.into()]);
    assert_eq!(n_frames, 80, "one frame every five of 401 ticks; {summary}");
    assert_eq!(summary["rollbacks"], 0);
}

#[test]
fn the_sample_motion_presses_the_wedge() {
    let folder = TempDir::new().unwrap();
    let summary = simulate(Path::new("configs/poses/press.csv"), &folder.path().join("press.safetensors"));
    assert!(summary["ticks_in_contact"].as_u64().unwrap() > 300, "{summary}");
    assert!(summary["peak_force_n"].as_f64().unwrap() > 0.1, "{summary}");
    assert_eq!((&summary["rollbacks"], &summary["placements"]), (&0.into(), &0.into()), "{summary}");
}

#[test]
fn a_tool_put_anew_is_told_to_people_and_programs() {
    let folder = TempDir::new().unwrap();
    let (poses, out) = (folder.path().join("jump.csv"), folder.path().join("jump.safetensors"));
    // Half a metre in 10 ms is fifty times as fast as a tool may be.
    let header = "time_s,tool,px,py,pz,qx,qy,qz,qw";
    fs::write(&poses, format!("{header}\n0,probe,0.05,0.03,0.06,0,0,0,1\n0.01,probe,0.55,0.03,0.06,0,0,0,1\n"))
        .unwrap();
    assert_eq!(simulate(&poses, &out)["placements"], 1);
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let said = plicad(&["simulate", "wedge", "--poses", poses, "--out", out]);
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.contains("1 times a tool was placed anew, without a sweep"), "{said}");
    assert!(!said.contains("rollbacks"), "a line for nothing: {said}");
}

#[test]
fn every_command_takes_the_built_in_scene_and_says_so_in_the_same_words() {
    for command in ["serve", "simulate", "check", "train", "evaluate", "bench", "chart"] {
        let help = plicad(&[command, "--help"]);
        let help = String::from_utf8_lossy(&help.stdout).into_owned();
        assert!(help.contains("or `wedge`, the built-in one"), "{command}: {help}");
        assert!(!help.contains('\\'), "{command}: {help}");
    }
    for (program_name, command) in [("plicad", "simulate"), ("plicad", "demo"), ("plica", "probe")] {
        let help = Command::new(program(program_name)).args([command, "--help"]).output().unwrap();
        let words: Vec<String> = String::from_utf8_lossy(&help.stdout).split_whitespace().map(str::to_owned).collect();
        let said = words.join(" ");
        assert!(said.contains("Scales and moves the motion so that its lowest part presses the object"), "{said}");
    }
}

#[test]
fn a_recorded_hand_motion_is_simulated() {
    let recorded = repository().join("../shared/data/poses/handheld_xyz.tum");
    if !recorded.exists() {
        println!("skipped: no recorded motion beside the repository");
        return;
    }
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("hand.safetensors");
    let (recorded, out) = (recorded.to_str().unwrap(), out.to_str().unwrap());
    let arguments = ["simulate", "wedge", "--poses", recorded, "--fit", "--out", out, "--every", "100", "--json"];
    let summary = last_line(&plicad(&arguments));
    assert_eq!(summary["rollbacks"], 0, "{summary}");
    let motion = &summary["motion"];
    assert!(motion["rows"] == motion["poses"] && motion["duration_s"].as_f64().unwrap() > 30.0, "{summary}");
    assert!(summary["n_frames"].as_u64().unwrap() > 100, "{summary}");
}

/// A press of the wedge, 1.5 s at 60 Hz: `row` writes one from its number.
fn write_press(path: &Path, header: &str, row: impl Fn(u32, f64) -> String) {
    let height_m = |k: u32| 0.04 - 0.01 * (std::f64::consts::PI * f64::from(k) / 90.0).sin();
    let rows: String = (0..=90).map(|k| row(k, height_m(k)) + "\n").collect();
    fs::write(path, format!("{header}{rows}")).unwrap();
}

#[test]
fn poses_of_any_origin_and_unit_press_alike() {
    let folder = TempDir::new().unwrap();
    let (poses, out) = (folder.path().join("poses.tum"), folder.path().join("out.safetensors"));
    let peak = |origin: f64, unit: f64| {
        write_press(&poses, "", |k, z| format!("{:.6} 0.05 0.03 {z} 0 0 0 1", origin + unit * f64::from(k) / 60.0));
        let said = simulate(&poses, &out);
        assert!(said["n_ticks"] == 1501 && said["remarks"] == serde_json::json!([]), "{said}");
        said["peak_force_n"].as_f64().unwrap()
    };
    let plain = peak(0.0, 1.0);
    assert!(plain > 0.5, "{plain} N");
    for (origin, unit) in
        [(-0.75, 1.0), (5.0, 1.0), (1.7e9, 1.0), (0.0, 1e3), (1.7e12, 1e3), (77.0, 1e6), (1.7e18, 1e9)]
    {
        let other = peak(origin, unit);
        assert!((other / plain - 1.0).abs() < 0.02, "{other} N from {origin} by {unit}, {plain} N from 0 s");
    }
}

#[test]
fn a_tool_out_of_sight_touches_nothing_and_is_told() {
    let folder = TempDir::new().unwrap();
    let (poses, out) = (folder.path().join("poses.tum"), folder.path().join("out.safetensors"));
    let seen = |k: u32, z: f64| format!("{:.6} 0.05 0.03 {z} 0 0 0 1", f64::from(k) / 60.0);
    let lost = |k: u32| format!("{:.6} 0 0 0 0 0 0 1", f64::from(k) / 60.0);
    write_press(&poses, "", seen);
    let whole = simulate(&poses, &out)["peak_force_n"].as_f64().unwrap();
    write_press(&poses, "", |k, z| if (40..52).contains(&k) { lost(k) } else { seen(k, z) });
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    let arguments = ["simulate", "wedge", "--poses", poses, "--out", out, "--every", "5"];
    let refused = errors(&plicad(&arguments));
    assert!(
        refused.contains("poses.tum:41: the tool jumps to the origin") && refused.contains("--on-bad-row skip"),
        "{refused}"
    );
    let said = last_line(&plicad(&[&arguments[..], &["--on-bad-row", "skip", "--json"]].concat()));
    assert_eq!(said["motion"]["skipped"], serde_json::json!({"lost": 12}), "{said}");
    assert!(said["peak_force_n"].as_f64().unwrap() < 1.05 * whole, "{said}");
}

#[test]
fn a_run_that_does_not_fit_or_takes_hours_is_refused_before_it_starts() {
    let folder = TempDir::new().unwrap();
    let (poses, out) = (folder.path().join("poses.tum"), folder.path().join("out.safetensors"));
    fs::write(&poses, "0 0.05 0.03 0.04 0 0 0 1\n9e6 0.05 0.03 0.04 0 0 0 1\n").unwrap();
    let arguments =
        ["simulate", "wedge", "--poses", poses.to_str().unwrap(), "--out", out.to_str().unwrap(), "--time-unit", "s"];
    let refused = errors(&plicad(&arguments));
    assert!(refused.contains("more than the disk has free") && refused.contains("--no-limits"), "{refused}");
    let refused = errors(&plicad(&[&arguments[..], &["--every", "1000000"]].concat()));
    assert!(refused.contains("hours") && refused.contains("--no-limits"), "{refused}");
    assert!(!out.exists());
}

#[test]
fn a_quaternion_with_w_first_is_asked_about() {
    let folder = TempDir::new().unwrap();
    let (poses, out) = (folder.path().join("poses.csv"), folder.path().join("out.safetensors"));
    let row = |k: u32, z: f64| format!("{:.6},probe,0.05,0.03,{z},1,0,0,0", f64::from(k) / 60.0);
    write_press(&poses, "time_s,tool,px,py,pz,qx,qy,qz,qw\n", row);
    let arguments =
        ["simulate", "wedge", "--poses", poses.to_str().unwrap(), "--out", out.to_str().unwrap(), "--every", "50"];
    let question = errors(&plicad(&arguments));
    assert!(
        question.contains("`probe` starts upside down") && question.contains("--quaternion-order wxyz"),
        "{question}"
    );
    let with = |order: &str| last_line(&plicad(&[&arguments[..], &["--quaternion-order", order, "--json"]].concat()));
    assert_eq!(with("wxyz")["remarks"], serde_json::json!([]));
    let remarks = with("xyzw")["remarks"].to_string();
    assert!(remarks.contains("upside down") && remarks.contains("inside the object"), "{remarks}");
}

#[test]
fn check_says_what_a_scene_costs() {
    for scene in ["wedge", "configs/scenes/wedge.toml", "configs/scenes/peer-wedge.toml"] {
        let said = last_line(&plicad(&["check", scene, "--json"]));
        assert_eq!(said["n_hexes"], 128, "{said}");
        let n_skin = said["n_skin"].as_u64().unwrap();
        assert!((6_000..8_000).contains(&n_skin), "about 6.9 k vertices: {said}");
        assert!(said["frame_bytes"].as_u64().unwrap() >= 64 + 12 * n_skin, "{said}");
    }
    let spoken = plicad(&["check", "wedge"]);
    let spoken = String::from_utf8_lossy(&spoken.stdout);
    assert!(spoken.contains("128 hexahedra") && spoken.contains("`probe` steps with each pose"), "{spoken}");
}

#[test]
fn the_schema_is_json_and_knows_the_tables() {
    let output = plicad(&["schema"]);
    let schema: Value = serde_json::from_slice(&output.stdout).unwrap();
    for table in ["objects", "tools", "contact", "runtime"] {
        assert!(schema["properties"][table].is_object(), "no `{table}`");
    }
    assert_eq!(last_line(&plicad(&["schema", "--json"])), schema);
}

/// Wedge with one line changed: what was typed, what it becomes, and what the message must say.
const BAD_SCENES: [(&str, &str, &[&str]); 7] = [
    ("young_modulus_pa = 3e4", "young_modulus = 3e4", &["young_modulus", "young_modulus_pa"]),
    ("poisson_ratio = 0.45", "poisson_ratio = 0.6", &["poisson_ratio", "0.6", "0 to 0.499"]),
    ("poisson_ratio = 0.45", "poisson_ratio = \"soft\"", &["poisson_ratio"]),
    ("thin_height_m = 0.01", "thin_height_m = -1.0", &["thin_height_m", "-1"]),
    ("friction = 0.8", "friction = nan", &["friction"]),
    ("timestep_s = 0.001", "timestep_s = 1.0", &["timestep_s", "0.02"]),
    ("[tools.probe]", "[tools.\"a/b\"]", &["a/b"]),
];

#[test]
fn bad_scene_files_name_file_line_key_and_range() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.toml");
    let good = read(&repository().join("configs/scenes/wedge.toml"));
    for (typed, becomes, expected) in BAD_SCENES {
        let line = 1 + good.lines().position(|l| l.starts_with(typed)).unwrap_or_else(|| panic!("no `{typed}`"));
        let bad = good.replacen(&format!("\n{typed}"), &format!("\n{becomes}"), 1);
        fs::write(&path, bad).unwrap();
        let message = errors(&plicad(&["check", path.to_str().unwrap()]));
        assert_eq!(message.trim().lines().count(), 1, "one clear message: {message}");
        assert!(message.contains(&format!("scene.toml:{line}")), "file and line {line}: {message}");
        for part in expected {
            assert!(message.contains(part), "`{part}` in: {message}");
        }
    }
    fs::write(&path, "[objects").unwrap();
    assert!(errors(&plicad(&["check", path.to_str().unwrap()])).contains("scene.toml:1"));
    assert!(errors(&plicad(&["check", "no/such.toml"])).contains("no/such.toml"));
}

#[test]
fn bad_pose_files_are_named() {
    let folder = TempDir::new().unwrap();
    let (poses, out) = (folder.path().join("poses.csv"), folder.path().join("out.safetensors"));
    let header = "time_s,tool,px,py,pz,qx,qy,qz,qw\n";
    let run = |text: &str| {
        fs::write(&poses, text).unwrap();
        let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
        errors(&plicad(&["simulate", "wedge", "--poses", poses, "--out", out]))
    };
    for (rows, expected) in [
        ("0,probe,0,0,0,0,0,0\n", ":2"),
        ("0,probe,0,0,0.1,0,0,0,1\n0.1,probe,x,0,0,0,0,0,1\n", ":3"),
        ("0,knife,0,0,0.1,0,0,0,1\n", "knife"),
        ("0,probe,NaN,0,0.1,0,0,0,1\n", ":2"),
        ("0.2,probe,0,0,0.1,0,0,0,1\n0.1,probe,0,0,0.1,0,0,0,1\n", ":3"),
        ("0,probe,0,0,0.1,0,0,0,7\n", ":2"),
    ] {
        let message = run(&format!("{header}{rows}"));
        assert!(message.contains("poses.csv") && message.contains(expected), "`{expected}` in: {message}");
        assert!(!out.exists(), "nothing is written for a bad pose file: {rows}");
    }
}

#[test]
fn with_json_a_refusal_is_an_object_on_standard_output_too() {
    let folder = TempDir::new().unwrap();
    let scene = folder.path().join("scene.toml");
    fs::write(&scene, "[objects").unwrap();
    let scene = scene.to_str().unwrap();
    let cases: [(&[&str], i32, &str); 6] = [
        (&["check", scene], 1, "scene.toml:1"),
        (&["bench", "no/such.toml"], 1, "no/such.toml"),
        (&["serve", scene], 1, "scene.toml:1"),
        (&["demo", "--seconds", "0"], 1, "--seconds"),
        (&["simulate", "wedge", "--poses", "none.csv", "--out", "none.safetensors"], 1, "none.csv"),
        (&["bench", "wedge", "--ticks", "many"], 2, "--ticks"),
    ];
    for (arguments, status, expected) in cases {
        let output = plicad(&[arguments, &["--json"]].concat());
        let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {errors}");
        let said: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
        let message = said["error"]["message"].as_str().unwrap();
        assert!(message.contains(expected) && errors.contains(expected), "`{expected}` in: {said}; {errors}");
        let without = plicad(arguments);
        assert!(without.stdout.is_empty(), "{arguments:?}: {}", String::from_utf8_lossy(&without.stdout));
    }
}

/// Confidence in the frames file, and the stage of the bench, need a database; a wrong one is refused by name.
#[test]
fn simulate_and_bench_refuse_what_is_no_database() {
    let folder = TempDir::new().unwrap();
    let (poses, out) = (folder.path().join("poses.csv"), folder.path().join("out.safetensors"));
    write_poses(&poses);
    simulate(&poses, &out);
    let (poses, out) = (poses.to_str().unwrap(), out.to_str().unwrap());
    for arguments in [
        &["bench", "wedge", "--database", out][..],
        &["simulate", "wedge", "--poses", poses, "--out", out, "--database", out],
    ] {
        let said = errors(&plicad(arguments));
        assert!(said.contains(out) && said.contains("not an example database"), "{said}");
    }
}

#[test]
fn bench_reports_every_stage() {
    let said = last_line(&plicad(&["bench", "wedge", "--ticks", "300", "--json"]));
    let is_spread = |v: &Value| ["min", "p50", "p99"].iter().all(|k| v[k].as_f64().is_some_and(|us| us >= 0.0));
    assert_eq!(said["scene"], "wedge");
    assert!(is_spread(&said["tick_us"]), "{said}");
    for stage in ["poses", "contact", "solve", "embedding", "gates"] {
        assert!(is_spread(&said["stages"][stage]), "{stage}: {said}");
    }
    assert!(said["roofline_ratio"].as_f64().unwrap() > 0.0, "{said}");
}

#[test]
fn the_demo_trains_once_reports_and_writes_pictures_and_a_mesh() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().to_str().unwrap();
    let demo = |seconds| last_line(&plicad(&["demo", "--examples", "8", "--seconds", seconds, "--out", out, "--json"]));
    let said = demo("2");
    let number = |v: &Value| v.as_f64().unwrap_or_else(|| panic!("{said}"));
    assert!(number(&said["ticks"]) > 500.0);
    for quantile in ["p50", "p99", "p999"] {
        assert!(number(&said["tick_us"][quantile]) > 0.0);
    }
    assert!(number(&said["overruns"]) >= 0.0);
    assert!(number(&said["frames_received"]) > 10.0, "{said}");
    assert!(number(&said["max_penetration_m"]) < 1e-2 && number(&said["peak_force_n"]) > 0.1, "{said}");
    assert!(number(&said["frames_enriched"]) > 10.0, "{said}");
    let rms = |which: &str| number(&said["held_out"][which]["rms_m"]);
    assert!(0.0 < rms("enriched") && rms("enriched") < 0.5 * rms("coarse"), "{said}");
    let start = |key: &str| fs::read(repository().join(said[key].as_str().unwrap())).unwrap()[..4].to_vec();
    assert_eq!(start("picture"), b"\x89PNG");
    assert_eq!(start("live_picture"), b"\x89PNG");
    assert_eq!(start("glb"), b"glTF");

    // The second time it finds the examples of the first, and says the same of them.
    assert!(number(&said["trained"]["seconds"]) > 0.0, "{said}");
    let again = demo("1");
    assert_eq!(again["trained"]["seconds"], 0.0);
    assert_eq!(again["held_out"], said["held_out"]);
}

/// `plicad serve` on a free port with a data folder of its own; ended when dropped.
struct Daemon {
    process: Child,
    endpoint: String,
    _data: TempDir,
}

impl Daemon {
    fn start() -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let mut command = Command::new(program("plicad"));
        let data = TempDir::new().unwrap();
        command.args(["serve", "wedge", "--listen", &endpoint, "--data", data.path().to_str().unwrap()]);
        let process = command.stderr(Stdio::null()).spawn().unwrap();
        let daemon = Self { process, endpoint, _data: data };
        let deadline = Instant::now() + Duration::from_secs(60);
        while !daemon.plica(&["status"]).status.success() {
            assert!(Instant::now() < deadline, "plicad never answered");
            std::thread::sleep(Duration::from_millis(100));
        }
        daemon
    }

    fn plica(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(program("plica"));
        command.args(arguments).args(["--connect", &self.endpoint, "--json"]).output().unwrap()
    }

    fn ask(&self, arguments: &[&str]) -> Value {
        last_line(&self.plica(arguments))
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn the_client_command_works_with_the_daemon() {
    let daemon = Daemon::start();
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    assert_eq!(daemon.ask(&["status"])["scene"], "wedge");

    let pressed = daemon.ask(&["probe", "--seconds", "1", "--period-s", "1", "--rate-hz", "250"]);
    assert!(pressed["peak_force_n"].as_f64().unwrap() > 0.1, "{pressed}");
    let latency = daemon.ask(&["latency", "--seconds", "1", "--rate-hz", "200"]);
    assert!(latency["motion_to_force_us"]["p50"].as_f64().unwrap() < 1e6, "{latency}");
    println!("motion to force over loopback: {}", latency["motion_to_force_us"]);

    daemon.ask(&["export", "--mesh", &path("wedge.glb"), "--skin", &path("wedge.plsk")]);
    assert_eq!(fs::read(path("wedge.glb")).unwrap()[..4], *b"glTF");
    assert_eq!(fs::read(path("wedge.plsk")).unwrap()[..4], *b"PLSK");

    assert_eq!(daemon.ask(&["rpc", "pause"])["paused"], true);
    assert_eq!(daemon.ask(&["rpc", "reset"])["tick"], 0);
    assert_eq!(daemon.ask(&["rpc", "step", r#"{"ticks": 7}"#])["tick"], 7);
    assert!(!daemon.plica(&["rpc", "explode"]).status.success());
}

#[test]
fn a_recording_replayed_and_recorded_again_holds_the_same_poses() {
    let daemon = Daemon::start();
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    // Until Ctrl-C, or so many poses, or a minute.
    let record = |file: &str, n_poses: &str| {
        let mut command = Command::new(program("plica"));
        command.args([
            "record",
            file,
            "--max-poses",
            n_poses,
            "--seconds",
            "60",
            "--connect",
            &daemon.endpoint,
            "--json",
        ]);
        let mut recorder = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut notes = BufReader::new(recorder.stderr.as_mut().unwrap()).lines();
        assert!(notes.any(|line| line.unwrap().contains("recording to")), "the recorder ended early");
        recorder
    };
    let recorder = record(&path("1.mcap"), "250");
    let sent = daemon.ask(&["probe", "--seconds", "1", "--rate-hz", "250"]);
    assert_eq!(sent["poses"], 250);
    let _ = Command::new("kill").args(["-INT", &recorder.id().to_string()]).output();
    let first = last_line(&recorder.wait_with_output().unwrap());
    // What is sent live may be dropped on a busy machine; what is replayed may not.
    let n_poses = first["poses"].as_u64().unwrap();
    assert!((1..=250).contains(&n_poses), "{first}");
    let recorder = record(&path("2.mcap"), &n_poses.to_string());
    daemon.ask(&["replay", &path("1.mcap")]);
    let second = last_line(&recorder.wait_with_output().unwrap());
    assert_eq!(first["poses"], second["poses"], "{second}");
}
