//! `plica jobs` and the library beneath it, against a small daemon.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod common;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use plica_client::protocol::jobs::{JobFile, JobKind, JobProgressMessage, JobState, JobSubmitRequest};
use serde_json::Value;
use tempfile::TempDir;

use common::jobs::{BROKEN, DONE, ENDLESS, ENDS, FAILED};
use common::{SmallDaemon, mesh_bytes};

fn plica(daemon: &SmallDaemon, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_plica"));
    command.arg("jobs").args(arguments).args(["--json", "--connect", &daemon.endpoint]);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn last_line(output: &Output) -> Value {
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(text.lines().last().unwrap_or_else(|| panic!("no output; {errors}"))).unwrap()
}

fn ask(daemon: &SmallDaemon, arguments: &[&str]) -> Value {
    last_line(&plica(daemon, arguments).output().unwrap())
}

fn error(daemon: &SmallDaemon, arguments: &[&str]) -> (String, Value) {
    let output = plica(daemon, arguments).output().unwrap();
    assert!(!output.status.success(), "{arguments:?} was not refused");
    let error = last_line(&output)["error"].clone();
    (error["message"].as_str().unwrap().to_owned(), error["code"].clone())
}

#[test]
fn a_job_is_submitted_as_it_was_typed() {
    let daemon = SmallDaemon::start();
    let plain = ask(&daemon, &["submit"]);
    assert_eq!(
        (&plain["created"], &plain["kind"], &plain["scene_name"]),
        (&true.into(), &"training".into(), &"served".into())
    );
    assert!(plain["examples"].is_null() && plain["seed"].is_null());
    assert_ne!(plain["client_id"], ask(&daemon, &["submit"])["client_id"], "drawn at random");

    let folder = TempDir::new().unwrap();
    let scene = folder.path().join("my-wedge.toml");
    fs::write(&scene, "[objects]").unwrap();
    let scene = scene.to_str().unwrap();
    let typed = ["submit", scene, "--kind", "evaluation", "--examples", "5", "--seed", "9", "--threads", "3"];
    let full = ask(&daemon, &typed);
    let number = |key: &str| full[key].as_u64().unwrap();
    assert_eq!((number("examples"), number("seed"), number("threads")), (5, 9, 3));
    assert_eq!((&full["kind"], &full["scene_name"]), (&"evaluation".into(), &"my-wedge".into()));

    let output = plica(&daemon, &["submit", "--client-id", "again"]).output().unwrap();
    assert_eq!(last_line(&output)["created"], false);
    assert!(String::from_utf8_lossy(&output.stderr).contains("`again` was submitted before, as job 0004"));
}

#[test]
fn what_is_refused_says_why() {
    let daemon = SmallDaemon::start();
    let folder = TempDir::new().unwrap();
    let bad = folder.path().join("bad.toml");
    fs::write(&bad, "bad").unwrap();
    assert_eq!(
        error(&daemon, &["submit", bad.to_str().unwrap()]),
        ("bad_scene: mine.toml:1: not valid TOML".to_owned(), "bad_scene".into())
    );
    assert!(error(&daemon, &["submit", "none.toml"]).0.starts_with("cannot read none.toml: "));
    assert!(error(&daemon, &["submit", "--client-id", "a/b"]).0.contains("--client-id: `a/b` is not a name"));
    assert!(error(&daemon, &["submit", "--examples", "0"]).0.contains("1..=100000"));
    assert_eq!(error(&daemon, &["cancel", "0009"]).1, "unknown_job");
    assert_eq!(error(&daemon, &["watch", "0009"]).1, "unknown_job");
    assert_eq!(error(&daemon, &["fetch", ENDLESS, "--out", bad.to_str().unwrap()]).1, "job_state");
    assert_eq!(fs::read(bad).unwrap(), b"bad", "what was there before stays");
}

#[test]
fn jobs_are_listed_cancelled_and_resumed() {
    let daemon = SmallDaemon::start();
    let list = ask(&daemon, &["list"]);
    assert_eq!((list["jobs"].as_array().unwrap().len(), &list["older"]), (3, &2.into()));
    let mut people = Command::new(env!("CARGO_BIN_EXE_plica"));
    let spoken = people.args(["jobs", "list", "--connect", &daemon.endpoint]).output().unwrap();
    let spoken = String::from_utf8_lossy(&spoken.stdout).into_owned();
    assert!(spoken.contains("0001   done       training    wedge            8 of 8"), "{spoken}");
    assert!(spoken.contains("exit code 1: disk full") && spoken.contains("and 2 older ones"), "{spoken}");
    assert_eq!(ask(&daemon, &["cancel", ENDLESS])["state"], "cancelled");
    assert_eq!(ask(&daemon, &["resume", FAILED])["state"], "queued");
}

#[test]
fn the_examples_of_a_job_or_of_a_file_are_activated() {
    let daemon = SmallDaemon::start();
    let reply = ask(&daemon, &["activate", DONE]);
    assert_eq!((&reply["examples"], &reply["database_generation"]), (&8.into(), &2.into()), "{reply}");
    assert_eq!(daemon.client().activate("wedge.safetensors").unwrap().examples, 9);
    for id in ["0009", "none"] {
        let (message, _) = error(&daemon, &["activate", id]);
        assert!(message.ends_with(&format!(": no job and no file `{id}`; see `plica jobs list`")), "{message}");
    }
}

#[test]
fn watching_ends_with_the_job() {
    let daemon = SmallDaemon::start();
    assert_eq!(ask(&daemon, &["watch", ENDS])["state"], "done");
    assert_eq!(ask(&daemon, &["watch", DONE])["done"], 8);
    let (message, _) = error(&daemon, &["watch", FAILED]);
    assert_eq!(
        message,
        "job 0002 is failed: exit code 1: disk full; `plica jobs resume 0002` continues it with its finished examples"
    );
}

#[test]
fn ctrl_c_ends_the_watching_and_not_the_job() {
    let daemon = SmallDaemon::start();
    // Without a name it is the first that is not over.
    let mut watching = plica(&daemon, &["watch"]).spawn().unwrap();
    let mut notes = BufReader::new(watching.stderr.take().unwrap()).lines();
    assert!(notes.any(|line| line.unwrap().contains("job 0004 is running")), "it ended early");
    assert!(Command::new("kill").args(["-INT", &watching.id().to_string()]).status().unwrap().success());
    let notes: Vec<_> = notes.map(Result::unwrap).collect();
    assert!(notes.iter().any(|line| line.contains("job 0004 continues; `plica jobs watch")), "{notes:?}");
    let output = watching.wait_with_output().unwrap();
    assert_eq!((output.status.code(), &last_line(&output)["state"]), (Some(130), &"running".into()));
}

#[test]
fn a_result_is_whole_and_checked_or_not_there() {
    let daemon = SmallDaemon::start();
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("a.safetensors");
    let said = ask(&daemon, &["fetch", DONE, "--out", out.to_str().unwrap()]);
    assert_eq!(fs::read(&out).unwrap(), mesh_bytes());
    assert_eq!(said["bytes"], mesh_bytes().len());
    assert_eq!(said["sha256"].as_str().unwrap().len(), 64);
    let other = folder.path().join("b.safetensors");
    assert!(error(&daemon, &["fetch", BROKEN, "--out", other.to_str().unwrap()]).0.contains("SHA-256"));
    let nowhere = folder.path().join("no/such/folder/c");
    assert!(error(&daemon, &["fetch", DONE, "--out", nowhere.to_str().unwrap()]).0.contains("cannot write"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else is left");

    let mut command = plica(&daemon, &["fetch", DONE, "--what", "report"]);
    assert_eq!(last_line(&command.current_dir(folder.path()).output().unwrap())["file"], "wedge-0001.json");
    assert!(folder.path().join("wedge-0001.json").exists());
}

#[test]
fn the_library_hears_progress() {
    let daemon = SmallDaemon::start();
    let client = daemon.client();
    let messages = client.subscribe_job_progress(16).unwrap();
    let running = JobProgressMessage::from(&client.job(ENDLESS).unwrap());
    let key = client.keys().job_progress();
    let deadline = std::time::Instant::now() + Duration::from_secs(10);
    let heard = loop {
        daemon.put(&key, b"{".to_vec());
        daemon.put(&key, serde_json::to_vec(&running).unwrap());
        if let Some(heard) = messages.next(Duration::from_millis(50)) {
            break heard;
        }
        assert!(std::time::Instant::now() < deadline, "nothing was heard");
    };
    assert_eq!((heard, messages.stats().malformed > 0), (running, true));
    let reply = client.submit_job(&JobSubmitRequest::new("a", JobKind::Training)).unwrap();
    assert_eq!((reply.created, reply.job.state), (true, JobState::Queued));
    let mut seen = Vec::new();
    let mut out = Vec::new();
    client.fetch_job(DONE, JobFile::Database, &mut out, &mut |have, total| seen.push((have, total))).unwrap();
    assert!(out == mesh_bytes() && seen.len() == 3 && seen[2].0 == seen[2].1, "{seen:?}");
}
