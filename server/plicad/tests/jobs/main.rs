//! Jobs whose process does whatever a process can do: the supervisor says what became of it, and goes on.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![cfg(unix)]

mod fixture;

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use plica_client::protocol::jobs::{JobFetchRequest, JobFile, JobKind, JobState, JobSubmitRequest};
use plica_jobs::{Keep, Priority};
use serde_json::Value;

use fixture::{Workplace, wait_for_file, wait_until};

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn failed(script: &str) -> String {
    let workplace = Workplace::new(script);
    let daemon = workplace.open();
    let id = daemon.submit("a").id;
    let job = daemon.wait_for(&id, JobState::Failed);
    let reason = job.reason.unwrap();
    daemon.stop();
    assert_eq!(json(&workplace.in_job(&id, "state.json"))["reason"], reason);
    reason
}

#[test]
fn a_job_runs_and_its_result_is_fetched() {
    let workplace = Workplace::new("echo hello; progress 2 3; progress 3 3; finish");
    let daemon = workplace.open();
    let (before, _) = daemon.jobs.changed_since(0);
    let request = JobSubmitRequest {
        examples: Some(3),
        seed: Some(7),
        threads: Some(2),
        ..JobSubmitRequest::new("night-run", JobKind::Evaluation)
    };
    let submitted = daemon.jobs.submit(&request).unwrap();
    assert!(submitted.created && submitted.job.state == JobState::Queued);
    let id = submitted.job.id;
    let job = daemon.wait_for(&id, JobState::Done);
    assert_eq!((job.progress.done, job.progress.total, job.reason.clone()), (3, 3, None));
    assert_eq!((job.scene_name.as_str(), job.threads), ("wedge", 2));
    assert!(job.finished_unix_s >= job.started_unix_s && job.started_unix_s >= Some(job.submitted_unix_s));
    let (_, changed) = daemon.jobs.changed_since(before);
    assert_eq!(changed.as_slice(), std::slice::from_ref(&job));

    let order = json(&workplace.in_job(&id, "job.json"));
    assert_eq!((&order["kind"], &order["examples"], &order["seed"]), (&"evaluation".into(), &3.into(), &7.into()));
    wait_until("state.json to follow", || {
        (json(&workplace.in_job(&id, "state.json"))["state"] == "done").then_some(())
    });
    assert_eq!(fs::read_to_string(workplace.in_job(&id, "log.txt")).unwrap(), "hello\n");
    assert_eq!(fs::read_to_string(workplace.in_job(&id, "scene.toml")).unwrap(), plica_scene::BUILT_IN_SCENE);

    let fetch = |file| JobFetchRequest { id: id.clone(), file };
    let (header, piece) = daemon.jobs.piece(&fetch(JobFile::Database), 4).unwrap();
    assert_eq!((header.total_bytes, header.offset, piece.as_slice()), (12, 4, b"examples".as_slice()));
    assert_eq!(daemon.jobs.piece(&fetch(JobFile::Report), 0).unwrap().1, b"{}");
    assert_eq!(daemon.jobs.piece(&fetch(JobFile::Report), 3).unwrap_err().code, "bad_offset");
}

#[test]
fn every_bad_end_has_a_reason() {
    assert_eq!(failed("echo scene.toml: no such key >&2; exit 1"), "exit code 1: scene.toml: no such key");
    assert_eq!(failed("exit 7"), "exit code 7; its log is empty");
    assert!(failed("exit 75").starts_with("interrupted from outside"));
    assert_eq!(failed("kill -9 $$"), "killed by signal 9 (SIGKILL): out of memory, or by hand");
    assert!(failed("echo example 3; kill -SEGV $$").contains("signal 11 (SIGSEGV, a crash): example 3"));
    assert!(failed("exit 0").contains("without a result") && failed("exit 0").contains("database.safetensors"));
    let full = failed("cat /dev/zero 2>/dev/null | head -c 9 >/dev/full || echo 'No space left on device'; exit 3");
    assert!(full.starts_with("exit code 3: ") && full.contains("; the disk is full: make room at "), "{full}");
}

#[test]
fn a_program_that_is_not_there_fails_the_job_and_not_the_daemon() {
    let workplace = Workplace::new("finish");
    fs::remove_file(workplace.script()).unwrap();
    let daemon = workplace.open();
    let id = daemon.submit("a").id;
    let reason = daemon.wait_for(&id, JobState::Failed).reason.unwrap();
    assert!(reason.contains("script cannot be started: No such file"), "{reason}");
    workplace.replace_script("finish");
    daemon.jobs.resume(&id).unwrap();
    daemon.wait_for(&id, JobState::Done);
}

#[test]
fn a_folder_that_cannot_be_written_fails_the_job() {
    for obstacle in [".state.json.tmp", "log.txt"] {
        let workplace = Workplace::new("finish");
        workplace.replace_script("while [ ! -e $dir/go ]; do sleep 0.02; done; finish");
        let daemon = workplace.open();
        let (first, second) = (daemon.submit("first").id, daemon.submit("second").id);
        fs::create_dir(workplace.in_job(&second, obstacle)).unwrap();
        fs::write(workplace.in_job(&first, "go"), "").unwrap();
        daemon.wait_for(&first, JobState::Done);
        let reason = daemon.wait_for(&second, JobState::Failed).reason.unwrap();
        assert!(
            reason.contains("cannot be written") && !reason.contains(workplace.path("").to_str().unwrap()),
            "{reason}"
        );
        fs::remove_dir(workplace.in_job(&second, obstacle)).unwrap();
        fs::write(workplace.in_job(&second, "go"), "").unwrap();
        daemon.jobs.resume(&second).unwrap();
        daemon.wait_for(&second, JobState::Done);
    }
}

#[test]
fn submitting_twice_is_one_job() {
    let workplace = Workplace::new("finish");
    let daemon = workplace.open();
    let request = JobSubmitRequest { seed: Some(3), ..JobSubmitRequest::new("a", JobKind::Training) };
    let first = daemon.jobs.submit(&request).unwrap();
    let second = daemon.jobs.submit(&request).unwrap();
    assert_eq!((first.created, second.created, &first.job.id), (true, false, &second.job.id));
    daemon.wait_for(&first.job.id, JobState::Done);
    assert!(!daemon.jobs.submit(&request).unwrap().created, "done, it is still that job");
    let others = [
        (JobSubmitRequest { seed: Some(4), ..request.clone() }, "seed"),
        (JobSubmitRequest { kind: JobKind::Evaluation, ..request.clone() }, "kind"),
        (JobSubmitRequest { examples: Some(4), ..request.clone() }, "examples"),
        (JobSubmitRequest { scene: Some("[objects]".to_owned()), ..request.clone() }, "scene"),
    ];
    for (other, what) in others {
        let error = daemon.jobs.submit(&other).unwrap_err();
        assert!(error.code == "job_conflict" && error.message.contains(&format!("another {what};")), "{error:?}");
    }
    assert_eq!(daemon.jobs.list().unwrap().jobs.len(), 1);
}

#[test]
fn jobs_run_one_at_a_time_in_order() {
    let workplace =
        Workplace::new("echo begin $dir >>$dir/../../order; sleep 0.1; echo end $dir >>$dir/../../order; finish");
    let daemon = workplace.open();
    let ids = ["a", "b", "c"].map(|client_id| daemon.submit(client_id).id);
    assert_eq!(ids, ["0001", "0002", "0003"]);
    daemon.wait_for("0003", JobState::Done);
    let order = fs::read_to_string(workplace.path("order")).unwrap();
    let words: Vec<_> = order.lines().map(|l| (l.split(' ').next().unwrap(), &l[l.len() - 4..])).collect();
    let expected =
        [("begin", "0001"), ("end", "0001"), ("begin", "0002"), ("end", "0002"), ("begin", "0003"), ("end", "0003")];
    assert_eq!(words, expected);
}

#[test]
fn a_cancelled_process_that_will_not_go_is_ended() {
    let workplace = Workplace::new("trap '' TERM; echo $$ >$dir/pid; while :; do sleep 0.05; done");
    let daemon = workplace.open();
    let (running, waiting) = (daemon.submit("running").id, daemon.submit("waiting").id);
    let process: i32 = wait_for_file(&workplace.in_job(&running, "pid")).trim().parse().unwrap();
    assert_eq!(daemon.jobs.cancel(&waiting).unwrap().state, JobState::Cancelled);
    assert_eq!(daemon.jobs.cancel(&running).unwrap().state, JobState::Cancelled);
    assert_eq!(json(&workplace.in_job(&running, "state.json"))["state"], "cancelled", "on disk before the answer");
    let alive = || Path::new(&format!("/proc/{process}")).exists();
    wait_until("the process to go", || (!alive()).then_some(()));
    assert_eq!(daemon.jobs.cancel(&running).unwrap_err().to_string(), "job 0001 is cancelled already");
    // Resumed while its process may still be ending: it runs once more, and only once at a time.
    workplace.replace_script("finish");
    // The supervisor may have started it before the answer is put together.
    let state = daemon.jobs.resume(&running).unwrap().state;
    assert!(matches!(state, JobState::Queued | JobState::Running), "{state:?}");
    daemon.wait_for(&running, JobState::Done);
    assert_eq!(daemon.get(&waiting).state, JobState::Cancelled);
    assert!(daemon.jobs.resume(&running).unwrap_err().to_string().contains("job 0001 is done; only"));
}

#[test]
fn a_job_resumed_at_once_after_it_was_cancelled_waits_for_its_old_process() {
    let script = "trap 'sleep 0.2; echo end >>$dir/runs; exit 75' TERM; echo begin >>$dir/runs
        [ $(grep -c begin $dir/runs) -gt 1 ] && finish && exit 0
        while :; do sleep 0.02; done";
    // The old process needs 0.2 s to end, and far more on a loaded machine: it must not be killed before.
    let mut workplace = Workplace::new(script);
    workplace.grace = Duration::from_secs(50);
    let daemon = workplace.open();
    let id = daemon.submit("a").id;
    wait_for_file(&workplace.in_job(&id, "runs"));
    daemon.jobs.cancel(&id).unwrap();
    daemon.jobs.resume(&id).unwrap();
    daemon.wait_for(&id, JobState::Done);
    assert_eq!(fs::read_to_string(workplace.in_job(&id, "runs")).unwrap(), "begin\nend\nbegin\n");
}

#[test]
fn a_folder_in_which_somebody_works_has_to_wait() {
    let workplace = Workplace::new("while [ ! -e $dir/go ]; do sleep 0.02; done; finish");
    let daemon = workplace.open();
    let [first, busy, last] = ["a", "b", "c"].map(|client_id| daemon.submit(client_id).id);
    let held = plica_training::TrainingFolder::open(&workplace.path("jobs").join(&busy)).unwrap();
    for id in [&first, &busy, &last] {
        fs::write(workplace.in_job(id, "go"), "").unwrap();
    }
    daemon.wait_for(&last, JobState::Done);
    assert_eq!((daemon.get(&first).state, daemon.get(&busy).state), (JobState::Done, JobState::Queued));
    drop(held);
    daemon.wait_for(&busy, JobState::Done);
}

const COUNTS_TO_FIVE: &str = "trap 'exit 75' TERM
    n=$(ls $dir/examples 2>/dev/null | wc -l); mkdir -p $dir/examples; echo $n >>$dir/starts
    while [ $n -lt 5 ]; do
        [ $n -eq 2 ] && while [ ! -e $dir/go ]; do sleep 0.02; done
        touch $dir/examples/$n; n=$((n + 1)); progress $n 5
    done; finish";

#[test]
fn a_job_outlives_its_daemon() {
    let workplace = Workplace::new(COUNTS_TO_FIVE);
    let daemon = workplace.open();
    let (id, waiting) = (daemon.submit("a").id, daemon.submit("b").id);
    wait_until("two examples", || (daemon.get(&id).progress.done == 2).then_some(()));
    daemon.stop();
    let state = json(&workplace.in_job(&id, "state.json"));
    assert_eq!(
        (&state["state"], &state["reason"], &state["pid"]),
        (&"paused".into(), &"the daemon was stopped".into(), &Value::Null)
    );

    let daemon = workplace.open();
    assert_eq!(daemon.get(&id).progress.done, 2, "known before it runs again");
    for id in [&id, &waiting] {
        fs::write(workplace.in_job(id, "go"), "").unwrap();
        daemon.wait_for(id, JobState::Done);
    }
    assert_eq!(fs::read_to_string(workplace.in_job(&id, "starts")).unwrap(), "0\n2\n", "examples are not repeated");
}

#[test]
fn a_job_outlives_a_daemon_that_was_killed() {
    let workplace = Workplace::new(COUNTS_TO_FIVE);
    let daemon = workplace.open();
    let [running, cancelled, failed] = ["a", "b", "c"].map(|client_id| daemon.submit(client_id).id);
    wait_until("two examples", || (daemon.get(&running).progress.done == 2).then_some(()));
    daemon.jobs.cancel(&cancelled).unwrap();
    daemon.stop();
    // What a daemon leaves that had no time to write anything.
    let left = |id: &str, state: &str| {
        let text = format!(
            r#"{{"state": "{state}", "reason": null, "started_unix_s": 1, "finished_unix_s": null, "pid": 1}}"#
        );
        fs::write(workplace.in_job(id, "state.json"), text).unwrap();
    };
    left(&running, "running");
    left(&failed, "failed");
    fs::write(workplace.in_job(&running, "go"), "").unwrap();
    fs::create_dir_all(workplace.path("jobs/.submitting")).unwrap();

    let daemon = workplace.open();
    daemon.wait_for(&running, JobState::Done);
    assert_eq!((daemon.get(&cancelled).state, daemon.get(&failed).state), (JobState::Cancelled, JobState::Failed));
    assert!(!workplace.path("jobs/.submitting").exists());
    assert_eq!(daemon.submit("d").id, "0004");
}

#[test]
fn what_is_damaged_is_left_alone() {
    let workplace = Workplace::new("finish");
    let daemon = workplace.open();
    let ids = ["a", "b", "c", "d"].map(|client_id| daemon.submit(client_id).id);
    daemon.wait_for(&ids[3], JobState::Done);
    daemon.stop();
    fs::write(workplace.in_job(&ids[0], "job.json"), "{").unwrap();
    fs::write(workplace.in_job(&ids[1], "state.json"), "[]").unwrap();
    fs::remove_file(workplace.in_job(&ids[2], "state.json")).unwrap();
    fs::write(workplace.in_job(&ids[3], "progress.json"), "\u{0}").unwrap();
    fs::create_dir_all(workplace.path("jobs/notes")).unwrap();
    fs::create_dir_all(workplace.path("jobs/0009")).unwrap();
    let copy = workplace.path("jobs/0010");
    fs::create_dir_all(&copy).unwrap();
    fs::copy(workplace.in_job(&ids[3], "job.json"), copy.join("job.json")).unwrap();

    let daemon = workplace.open();
    // Without a state a job has not been finished, as far as anybody knows.
    for id in &ids[1..] {
        daemon.wait_for(id, JobState::Done);
    }
    assert!(daemon.jobs.get(&ids[0]).is_err() && daemon.jobs.get("0010").is_err());
    assert_eq!(daemon.submit("e").id, "0011", "no number is used twice");
    assert_eq!(fs::read_to_string(workplace.in_job(&ids[0], "job.json")).unwrap(), "{");
}

#[test]
fn ids_lead_nowhere() {
    let workplace = Workplace::new("finish");
    let daemon = workplace.open();
    let id = daemon.submit("a").id;
    daemon.wait_for(&id, JobState::Done);
    let long = "0".repeat(5000);
    for bad in ["", "1", "01", "+0001", "../0001", "0001/", "0001/../0001", ".", "..", "/", "0002", "\u{0}", &long] {
        for error in
            [daemon.jobs.get(bad).map(drop), daemon.jobs.cancel(bad).map(drop), daemon.jobs.resume(bad).map(drop)]
        {
            let message = error.unwrap_err().to_string();
            assert!(message.starts_with("no job `") && message.len() < 200, "{message}");
        }
        let fetch = JobFetchRequest { id: bad.to_owned(), file: JobFile::Database };
        assert_eq!(daemon.jobs.piece(&fetch, 0).unwrap_err().code, "unknown_job");
    }
}

#[test]
fn a_result_is_fetched_when_it_is_there() {
    let workplace = Workplace::new("sleep 600");
    let daemon = workplace.open();
    let fetch = JobFetchRequest { id: daemon.submit("a").id, file: JobFile::Database };
    let error = daemon.jobs.piece(&fetch, 0).unwrap_err();
    assert!(error.code == "job_state" && error.message.ends_with("its database can be fetched when it is done"));
}

#[test]
fn a_hundred_jobs_may_wait() {
    let workplace = Workplace::new("sleep 600");
    let daemon = workplace.open();
    for i in 0..100 {
        daemon.submit(&format!("job-{i}"));
    }
    let error = daemon.jobs.submit(&JobSubmitRequest::new("more", JobKind::Training)).unwrap_err();
    assert_eq!((error.code.as_str(), error.retryable), ("too_many_jobs", true));
    daemon.jobs.cancel("0050").unwrap();
    daemon.submit("more");
    assert_eq!(daemon.jobs.status().len(), 16);
    assert_eq!(daemon.jobs.status()[15].id, "0101");
}

#[test]
fn jobs_make_room_for_everything_else() {
    let says =
        "cut -d' ' -f19,41 /proc/$$/stat; cat /proc/$$/oom_score_adj; grep Cpus_allowed_list /proc/$$/status; finish";
    let (nice, idle, batch, other) = ("19", "5", "3", "0");
    for (priority, expected) in
        [(Priority::Idle, [nice, idle]), (Priority::Low, [nice, batch]), (Priority::Normal, ["0", other])]
    {
        let mut workplace = Workplace::with_launcher(says, priority);
        workplace.avoid_cpu = Some(0);
        let daemon = workplace.open();
        daemon.wait_for(&daemon.submit("a").id, JobState::Done);
        let log = fs::read_to_string(workplace.in_job("0001", "log.txt")).unwrap();
        let lines: Vec<&str> = log.lines().filter(|line| !line.contains("WARN")).collect();
        let own = fs::read_to_string("/proc/self/stat").unwrap();
        let own_nice = own.split(' ').nth(18).unwrap();
        if own_nice == "0" {
            assert_eq!(lines[0].split(' ').collect::<Vec<_>>(), expected, "{log}");
        }
        assert_eq!(lines[1], "1000", "{log}");
        let cores = lines[2].split_whitespace().nth(1).unwrap();
        let only_core = log.contains("there is no other core");
        assert!(only_core || !cores.starts_with('0'), "{log}");
    }
}

#[test]
fn a_job_whose_daemon_is_gone_does_not_start() {
    let plicad = env!("CARGO_BIN_EXE_plicad");
    let child = ["child", "--parent", "1", "--priority", "normal", "--", "echo", "started"];
    let output = Command::new(plicad).args(child).output().unwrap();
    assert!(!output.status.success() && output.stdout.is_empty());
    assert!(String::from_utf8_lossy(&output.stderr).contains("the daemon that started this job is gone"));
}

#[test]
fn finished_jobs_beyond_the_bounds_are_removed_cancelled_ones_first() {
    let mut workplace = Workplace::new("finish");
    workplace.keep = Keep { jobs: 3, ..Keep::default() };
    let daemon = workplace.open();
    let done = |name: &str| daemon.wait_for(&daemon.submit(name).id, JobState::Done).id;
    let first = done("first");
    assert!(daemon.jobs.begin_use(&first).is_ok());
    daemon.jobs.end_use(true);
    let second = done("second");
    workplace.replace_script("sleep 60");
    let cancelled = daemon.submit("cancelled").id;
    daemon.jobs.cancel(&cancelled).unwrap();
    workplace.replace_script("finish");
    let last = ["third", "fourth", "fifth"].map(done);
    let left = || -> Vec<String> { daemon.jobs.list().unwrap().jobs.into_iter().map(|job| job.id).collect() };
    let expected = [first.clone(), last[1].clone(), last[2].clone()];
    wait_until("old jobs to be removed", || (left() == expected).then_some(()));
    assert_eq!(daemon.jobs.list().unwrap().removed, 3);
    for id in [&second, &cancelled, &last[0]] {
        wait_until("its folder to go", || (!workplace.path("jobs").join(id).exists()).then_some(()));
        let message = daemon.jobs.get(id).unwrap_err().to_string();
        assert!(message.contains("any more"), "{message}");
    }
    // A client id is free again with its job.
    assert!(daemon.jobs.submit(&JobSubmitRequest::new("second", JobKind::Training)).unwrap().created);
    daemon.stop();
}

#[test]
fn bytes_of_finished_jobs_are_bounded_and_unfinished_ones_have_as_much_room() {
    let mut workplace =
        Workplace::new("head -c 60000 /dev/zero >$dir/database.safetensors; printf '{}' >$dir/report.json");
    workplace.keep = Keep { jobs: 100, bytes: 200_000 };
    let daemon = workplace.open();
    for name in ["a", "b", "c", "d", "e", "f"] {
        daemon.wait_for(&daemon.submit(name).id, JobState::Done);
    }
    wait_until("old jobs to be removed", || (daemon.jobs.list().unwrap().removed >= 3).then_some(()));
    assert!(daemon.jobs.list().unwrap().jobs.len() >= 2);
    workplace.replace_script("sleep 60");
    let refused =
        (0..100).find_map(|i| daemon.jobs.submit(&JobSubmitRequest::new(format!("q{i}"), JobKind::Training)).err());
    let refused = refused.unwrap();
    assert!(
        refused.code == "too_many_jobs" && refused.message.contains("at most 200000 are kept"),
        "{}",
        refused.message
    );
    daemon.stop();
}

#[test]
fn job_10000_comes_after_9999_and_older_folders_stay_valid() {
    let workplace = Workplace::new("finish");
    let daemon = workplace.open();
    let first = daemon.submit("first").id;
    daemon.wait_for(&first, JobState::Done);
    daemon.stop();
    let folder = workplace.path("jobs").join("9999");
    fs::rename(workplace.path("jobs").join(&first), &folder).unwrap();
    let job = fs::read_to_string(folder.join("job.json")).unwrap();
    fs::write(folder.join("job.json"), job.replace("\"0001\"", "\"9999\"")).unwrap();
    // No job has that number.
    fs::create_dir(workplace.path("jobs").join("4294967295")).unwrap();
    let daemon = workplace.open();
    let second = daemon.submit("second").id;
    assert_eq!(second, "10000");
    let listed: Vec<_> = daemon.jobs.list().unwrap().jobs.into_iter().map(|job| job.id).collect();
    assert_eq!(listed, ["9999", "10000"]);
    daemon.wait_for(&second, JobState::Done);
    daemon.stop();
}
