//! `plicad train` from outside: the same bytes whatever happens to it, and clear words where it cannot go on.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// A block with few elements: an interaction takes a fraction of a second.
const SCENE: &str = r#"
[objects.block]
mesh = { generator = "block", size_m = [0.04, 0.04, 0.02] }
material = { young_modulus_pa = 3e4, poisson_ratio = 0.45, density_kg_per_m3 = 1000.0 }
supports = { fixed = { faces = ["z_min"] } }
coarse = { divisions = [3, 3, 2] }
skin = { spacing_m = 0.002 }
accurate = { divisions = [8, 8, 4], poisson_ratio = 0.48 }
[objects.block.training]
examples = 4
contact_regions = [{ min_m = [0.012, 0.012, 0.0], max_m = [0.028, 0.028, 1.0] }]
depth_share = [0.1, 0.25]
drag_m = [0.0, 0.002]
evaluation = { examples = 1, outside = [{ name = "lift", action = "lift", examples = 1, depth_share = [0.05, 0.1] }] }
[tools.rod]
shape = { capsule = { radius_m = 0.006, length_m = 0.1 } }
friction = 0.8
"#;

/// A folder with the scene in it.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("block.toml"), SCENE).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_plicad"));
        command.arg("train").args(arguments).current_dir(self.0.path());
        command
    }

    fn train(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn spawn(&self, arguments: &[&str]) -> Child {
        self.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }
}

/// The one JSON object on the last line.
fn summary(output: &Output) -> Value {
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{errors}");
    serde_json::from_str(text.lines().last().unwrap_or_default()).unwrap_or_else(|e| panic!("{e}: {text}"))
}

fn errors(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn database(folder: &Path) -> Vec<u8> {
    fs::read(folder.join("database.safetensors")).unwrap()
}

#[test]
fn threads_and_repetition_change_no_bit_and_the_folder_tells_all() {
    let place = Place::new();
    let one = summary(&place.train(&["block.toml", "--folder", "one", "--threads", "1", "--json"]));
    let out = ["block.toml", "--folder", "two", "--threads", "2", "--out", "deep/copy.safetensors", "--json"];
    let two = summary(&place.train(&out));
    assert!(database(&place.path("one")) == database(&place.path("two")), "one thread and two differ");
    assert!(fs::read(place.path("deep/copy.safetensors")).unwrap() == database(&place.path("two")));
    assert_eq!(one["result"], two["result"], "what another machine would find as well");
    assert_eq!(one["result"]["examples"], 4, "{}", one["result"]["rejected"]);
    let folder = place.path("one");
    assert_eq!(json(&folder.join("state.json"))["state"], "done");
    let progress = json(&folder.join("progress.json"));
    assert_eq!((&progress["stage"], &progress["done"], &progress["total"]), (&"database".into(), &4.into(), &4.into()));
    assert_eq!(json(&folder.join("report.json"))["result"], one["result"]);
    let job = json(&folder.join("job.json"));
    assert_eq!((&job["kind"], &job["scene_name"]), (&"training".into(), &"block".into()));
    assert_eq!(fs::read_to_string(folder.join("scene.toml")).unwrap(), SCENE);
    assert!((0..4).all(|i| folder.join(format!("examples/0000{i}.safetensors")).exists()));
    // The folder of a job is all that it takes: as the daemon starts it.
    for file in ["examples", "database.safetensors", "report.json"] {
        let path = folder.join(file);
        let removed = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        removed.unwrap();
    }
    let output = place.train(&["--job", "one"]);
    assert!(output.status.success(), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("training: 4 examples, 0 rejected"), "{output:?}");
    assert!(database(&folder) == database(&place.path("two")));
}

#[test]
fn an_evaluation_has_two_references_and_other_interactions() {
    let place = Place::new();
    let made = summary(&place.train(&["block.toml", "--kind", "evaluation", "--threads", "2", "--json"]));
    assert_eq!(made["folder"], "out/train/block-evaluation");
    assert_eq!(made["result"]["kinds"], serde_json::json!({ "in_region": 1, "lift": 1 }), "{made}");
    let bytes = database(&place.path("out/train/block-evaluation"));
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let shape = |name: &str| tensors.tensor(name).unwrap().shape().to_vec();
    assert_eq!(shape("d"), shape("d_independent"));
    assert_eq!(shape("force_independent"), [2, 3]);
}

/// Comes down on the block, drags, and leaves: 1 s at 100 Hz.
fn recorded_motion() -> String {
    let mut text = "time_s,tool,px,py,pz,qx,qy,qz,qw\n".to_owned();
    for k in 0..=100 {
        let share = f64::from(k) / 100.0;
        let height = 0.03 - 0.008 * (std::f64::consts::PI * share).sin();
        text.push_str(&format!("{},rod,{},0.02,{height},0,0,0,1\n", 0.01 * f64::from(k), 0.018 + 0.004 * share));
    }
    text
}

#[test]
fn states_of_a_recorded_motion_are_trained_on_and_the_motion_goes_along() {
    let place = Place::new();
    fs::create_dir(place.path("motions")).unwrap();
    fs::write(place.path("motions/down.csv"), recorded_motion()).unwrap();
    let recorded = "examples = 3\nrecorded = { file = \"motions/down.csv\" }";
    fs::write(place.path("block.toml"), SCENE.replacen("examples = 4", recorded, 1)).unwrap();
    let made = summary(&place.train(&["block.toml", "--folder", "job", "--json"]));
    assert_eq!(made["result"]["examples"], 3, "{}", made["result"]["rejected"]);
    assert_eq!(fs::read_to_string(place.path("job/motions/down.csv")).unwrap(), recorded_motion());
    // The job's folder is complete without the place where it was made.
    fs::remove_dir_all(place.path("motions")).unwrap();
    fs::remove_file(place.path("job/report.json")).unwrap();
    assert!(place.train(&["--job", "job"]).status.success());
    assert!(place.path("job/report.json").exists());
    // A file beside the scene's folder is named by its absolute path.
    fs::write(place.path("up.csv"), recorded_motion()).unwrap();
    fs::create_dir(place.path("scenes")).unwrap();
    fs::write(
        place.path("scenes/block.toml"),
        SCENE.replacen("examples = 4", &recorded.replace("motions/down", "../up"), 1),
    )
    .unwrap();
    summary(&place.train(&["scenes/block.toml", "--folder", "other", "--json"]));
    assert!(fs::read_to_string(place.path("other/scene.toml")).unwrap().contains("file = \"/"));
}

/// Kills a job at ten random moments; then it is left alone.
#[test]
fn a_job_killed_ten_times_ends_with_the_same_database() {
    let place = Place::new();
    let arguments = |folder| ["block.toml", "--folder", folder, "--threads", "2", "--examples", "12"];
    let begin = Instant::now();
    summary(&place.train(&[&arguments("whole")[..], &["--json"]].concat()));
    let whole = begin.elapsed();
    let mut random = u64::from(std::process::id());
    let mut killed_before_the_end = 0;
    for kill in 0..10 {
        let mut child = place.spawn(&arguments("killed"));
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // Up to half of what the whole job takes: some die before their first example, some in the middle of one.
        let share = (random >> 33) as f64 / (1_u64 << 31) as f64;
        std::thread::sleep(whole.mul_f64(0.5 * share));
        let ended = child.try_wait().unwrap();
        child.kill().unwrap();
        let status = child.wait().unwrap();
        if ended.is_none() {
            assert_eq!(status.signal(), Some(9));
            killed_before_the_end += 1;
        }
        let finished = fs::read_dir(place.path("killed/examples")).map_or(0, |d| d.count());
        println!("kill {kill} after {:.0} ms: {finished} files", 1e3 * whole.mul_f64(0.5 * share).as_secs_f64());
    }
    assert!(killed_before_the_end >= 2, "the kills came too late to mean anything");
    let end = summary(&place.train(&[&arguments("killed")[..], &["--json"]].concat()));
    println!("{killed_before_the_end} kills before the end; the last run resumed {} of 12", end["run"]["resumed"]);
    assert!(database(&place.path("killed")) == database(&place.path("whole")), "a killed job differs");
    let left = fs::read_dir(place.path("killed/examples")).unwrap().map(|e| e.unwrap().file_name());
    assert!(left.into_iter().all(|name| !name.to_string_lossy().ends_with(".tmp")));
}

#[test]
fn a_job_that_is_asked_to_stop_says_so_and_goes_on_later() {
    let place = Place::new();
    let arguments = ["block.toml", "--folder", "job", "--threads", "1", "--examples", "40"];
    let mut child = place.command(&arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let begin = Instant::now();
    while fs::read_dir(place.path("job/examples")).map_or(0, |d| d.count()) < 2 {
        assert!(begin.elapsed() < Duration::from_secs(60), "no example after a minute");
        std::thread::sleep(Duration::from_millis(5));
    }
    let asked = Instant::now();
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    let status = child.wait().unwrap();
    println!("stopped after {:.0} ms", 1e3 * asked.elapsed().as_secs_f64());
    assert_eq!(status.code(), Some(75));
    let said = std::io::read_to_string(child.stderr.take().unwrap()).unwrap();
    assert!(said.contains("plicad: interrupted; finished examples are kept"), "{said}");
    assert_eq!(json(&place.path("job/state.json"))["state"], "paused");
    assert!(!place.path("job/database.safetensors").exists());
    let before = fs::read_dir(place.path("job/examples")).unwrap().count();
    assert!((2..40).contains(&before), "{before}");
    let rest = summary(&place.train(&[&arguments[..], &["--json"]].concat()));
    assert_eq!(rest["run"]["resumed"].as_u64().unwrap() as usize, before, "finished examples are not repeated");
}

#[test]
fn what_cannot_be_trained_is_refused_in_words() {
    let place = Place::new();
    fs::write(place.path("file"), "").unwrap();
    let message = errors(&place.train(&["block.toml", "--folder", "file/job"]));
    assert!(message.contains("file/job"), "{message}");
    let message = errors(&place.train(&["--job", "nowhere"]));
    assert!(message.contains("nowhere: not a job folder"), "{message}");
    assert!(!place.path("nowhere").exists(), "a refused folder is not made");
    fs::create_dir(place.path("empty")).unwrap();
    assert!(errors(&place.train(&["--job", "empty"])).contains("job.json: is missing"));

    summary(&place.train(&["block.toml", "--folder", "job", "--examples", "1", "--json"]));
    let message = errors(&place.train(&["block.toml", "--folder", "job", "--examples", "2"]));
    assert!(message.contains("job.json") && message.contains("another job"), "{message}");
    fs::write(place.path("block.toml"), SCENE.replace("3e4", "4e4")).unwrap();
    let message = errors(&place.train(&["block.toml", "--folder", "job", "--examples", "1"]));
    assert!(message.contains("another scene") && message.contains("choose another folder"), "{message}");
    assert_eq!(json(&place.path("job/state.json"))["state"], "failed");

    fs::write(place.path("block.toml"), SCENE.split("[tools").next().unwrap()).unwrap();
    assert!(errors(&place.train(&["block.toml"])).contains("no tool to train with"));
    let planes = "supports = { planes = [{ point_m = [0, 0, 0], normal = [0, 0, 1] }], fixed";
    fs::write(place.path("block.toml"), SCENE.replace("supports = { fixed", planes)).unwrap();
    assert!(errors(&place.train(&["block.toml"])).contains("supports.planes"));
}

/// A limit on file sizes stands in for a full disk: the same call fails, at the same place.
#[test]
fn a_disk_that_takes_no_more_fails_the_job_and_keeps_what_is_finished() {
    let place = Place::new();
    let program = env!("CARGO_BIN_EXE_plicad");
    let run = |kib: &str| {
        let script =
            format!("trap '' XFSZ; ulimit -f {kib}; exec \"{program}\" train block.toml --folder job --threads 1");
        Command::new("bash").args(["-c", &script]).current_dir(place.0.path()).output().unwrap()
    };
    // Small files still fit, an example does not.
    let message = errors(&run("8"));
    assert!(message.contains("job/examples/00000.safetensors") && message.contains("File too large"), "{message}");
    assert_eq!(json(&place.path("job/state.json"))["state"], "failed");
    assert_eq!(fs::read_dir(place.path("job/examples")).unwrap().count(), 0, "nothing half written is left");
    // Examples fit, the database does not.
    let example = {
        summary(&place.train(&["block.toml", "--folder", "other", "--examples", "1", "--json"]));
        fs::metadata(place.path("other/examples/00000.safetensors")).unwrap().len()
    };
    let message = errors(&run(&(2 * example / 1024).to_string()));
    assert!(message.contains("database.safetensors") && message.contains("finished examples are kept"), "{message}");
    assert_eq!(fs::read_dir(place.path("job/examples")).unwrap().count(), 4, "finished examples are kept");
    let rest = summary(&place.train(&["block.toml", "--folder", "job", "--threads", "1", "--json"]));
    assert_eq!((&rest["run"]["resumed"], &rest["run"]["solved"]), (&4.into(), &0.into()));
}

#[test]
fn sensitivity_is_a_table_and_json() {
    let place = Place::new();
    let output = place.train(&["block.toml", "--sensitivity", "2", "--threads", "2", "--json"]);
    let found = summary(&output);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{text}");
    assert_eq!(found["interactions"], 2, "{found}");
    let names: Vec<String> = found["differences"]
        .as_array()
        .unwrap()
        .iter()
        .map(|d| format!("{}: {} from {}", d["group"], d["of"], d["from"]).replace('"', ""))
        .collect();
    for expected in [
        "accurate mesh: tied, 6x6x3 from tied, 12x12x6",
        "tie stiffness: tie x 100 from tied",
        "reference: tied from independent",
        "coarse skin: coarse from independent",
        "coarse imprint (contact band): coarse from tied",
    ] {
        assert!(names.iter().any(|n| n == expected), "{expected} is not in {names:?}");
    }
    for d in found["differences"].as_array().unwrap() {
        assert!(d["rms_m"]["median"].as_f64().unwrap() > 0.0 && d["worst_m"]["max"].as_f64().unwrap() < 0.02, "{d}");
    }
    assert!(text.contains("force on the tool"));
}
