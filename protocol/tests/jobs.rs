//! Requests and replies about jobs: as the page shows them, there and back, and refused when malformed.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use plica_protocol::jobs::*;
use plica_protocol::rpc::{Method, decode_request};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

fn a_job() -> Job {
    Job {
        id: "0003".to_owned(),
        client_id: "night-run".to_owned(),
        kind: JobKind::Training,
        scene_name: "wedge".to_owned(),
        examples: Some(128),
        seed: None,
        threads: 3,
        submitted_unix_s: 1_700_000_000,
        state: JobState::Running,
        reason: None,
        started_unix_s: Some(1_700_000_001),
        finished_unix_s: None,
        progress: JobProgress {
            stage: Some("examples".to_owned()),
            done: 40,
            rejected: 1,
            total: 128,
            seconds_left: Some(512.5),
        },
    }
}

fn comes_back<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(sent: &T) -> Value {
    let json = serde_json::to_string(sent).unwrap();
    assert_eq!(&serde_json::from_str::<T>(&json).unwrap(), sent, "{json}");
    serde_json::from_str(&json).unwrap()
}

#[test]
fn requests_are_short_and_come_back() {
    let request = JobSubmitRequest::new("night-run", JobKind::Training);
    assert_eq!(comes_back(&request), json!({"client_id": "night-run", "kind": "training"}));
    let full = JobSubmitRequest {
        examples: Some(8),
        seed: Some(u64::MAX),
        threads: Some(2),
        scene: Some("[objects]".to_owned()),
        scene_name: Some("pillow".to_owned()),
        ..JobSubmitRequest::new("a", JobKind::Evaluation)
    };
    let json = comes_back(&full);
    assert_eq!((&json["kind"], &json["seed"]), (&"evaluation".into(), &u64::MAX.into()));
    full.check().unwrap();
    assert_eq!(comes_back(&JobRequest { id: "0003".to_owned() }), json!({"id": "0003"}));
    let fetch = JobFetchRequest { id: "0003".to_owned(), file: JobFile::Database };
    assert_eq!(comes_back(&fetch), json!({"id": "0003", "what": "database"}));
}

#[test]
fn replies_are_flat_and_come_back() {
    let job = a_job();
    let json = comes_back(&job);
    assert_eq!((&json["state"], &json["done"], &json["seconds_left"]), (&"running".into(), &40.into(), &512.5.into()));
    assert!(json["seed"].is_null() && json["reason"].is_null());
    let reply = comes_back(&JobSubmitReply { created: true, job: job.clone() });
    assert_eq!((&reply["created"], &reply["id"]), (&true.into(), &"0003".into()));
    comes_back(&JobListReply { jobs: vec![job.clone()], older: 7, removed: 3 });
    let progress = comes_back(&JobProgressMessage::from(&job));
    assert_eq!((&progress["stage"], &progress["rejected"]), (&"examples".into(), &1.into()));
    let status = comes_back(&JobStatus::from(&job));
    assert_eq!(status, json!({"id": "0003", "state": "running", "done": 40, "rejected": 1, "total": 128}));
}

#[test]
fn a_reader_ignores_what_it_does_not_know() {
    let mut json = serde_json::to_value(a_job()).unwrap();
    json["colour"] = "green".into();
    assert_eq!(serde_json::from_value::<Job>(json).unwrap(), a_job());
    let progress = JobProgressMessage::from_json(br#"{"id": "1", "state": "done", "done": 8, "new": []}"#).unwrap();
    assert_eq!((progress.state, progress.progress.done, progress.progress.total), (JobState::Done, 8, 0));
}

#[test]
fn states_have_their_names_and_three_are_over() {
    for state in JobState::ALL {
        assert_eq!(serde_json::to_value(state).unwrap(), state.name());
    }
    assert_eq!(JobState::ALL.iter().filter(|s| s.is_over()).count(), 3);
    let about_jobs = Method::ALL.iter().filter(|m| m.is_about_jobs()).count();
    assert_eq!(about_jobs, 6);
}

#[test]
fn requests_of_another_shape_are_malformed() {
    let bad = [
        "",
        "[]",
        r#"{"kind": "training"}"#,
        r#"{"client_id": "a"}"#,
        r#"{"client_id": "a", "kind": "Training"}"#,
        r#"{"client_id": "a", "kind": "training", "example": 3}"#,
        r#"{"client_id": "a", "kind": "training", "examples": -1}"#,
        r#"{"client_id": "a", "kind": "training", "examples": 1.5}"#,
        r#"{"client_id": "a", "kind": "training", "seed": 18446744073709551616}"#,
        r#"{"client_id": 7, "kind": "training"}"#,
        r#"{"client_id": "a", "kind": {"training": null}}"#,
        r#"["a", "training"]"#,
        r#"{"client_id": "a", "kind": "training", "scene": ["x"]}"#,
    ];
    for text in bad {
        let error = decode_request::<JobSubmitRequest>(text.as_bytes()).unwrap_err();
        assert_eq!((error.code.as_str(), error.retryable), ("rpc_malformed", false), "{text}");
    }
    for text in ["{}", r#"{"id": 3}"#, r#"{"id": "3", "force": true}"#, r#"["3"]"#] {
        assert_eq!(decode_request::<JobRequest>(text.as_bytes()).unwrap_err().code, "rpc_malformed", "{text}");
    }
    for text in [
        r#"{"id": "3"}"#,
        r#"{"id": "3", "what": "log"}"#,
        r#"{"id": "3", "what": "../x"}"#,
        r#"["3", "report"]"#,
        r#"{"id": "3", "what": {"report": null}}"#,
    ] {
        assert_eq!(decode_request::<JobFetchRequest>(text.as_bytes()).unwrap_err().code, "rpc_malformed", "{text}");
    }
}

type Change = fn(&mut JobSubmitRequest);

#[test]
fn names_and_ranges_are_checked() {
    let good = JobSubmitRequest::new("a", JobKind::Training);
    let with = |change: Change| {
        let mut request = good.clone();
        change(&mut request);
        request.check().map_err(|error| (error.code, error.message))
    };
    let bad: [(Change, &str); 8] = [
        (|r| r.client_id = String::new(), "client_id"),
        (|r| r.client_id = "../a".to_owned(), "client_id"),
        (|r| r.client_id = "x".repeat(65), "client_id"),
        (|r| r.examples = Some(0), "examples is 0; the allowed range is 1 to 100000"),
        (|r| r.examples = Some(100_001), "examples is 100001"),
        (|r| r.threads = Some(1025), "threads is 1025"),
        (|r| r.scene_name = Some("wedge".to_owned()), "scene_name without scene"),
        (|r| (r.scene, r.scene_name) = (Some(String::new()), Some("a/b".to_owned())), "scene_name: `a/b`"),
    ];
    for (change, expected) in bad {
        let (code, message) = with(change).unwrap_err();
        assert!(code == "rpc_malformed" && message.starts_with(expected), "{message}");
    }
    good.check().unwrap();
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = decode_request::<JobSubmitRequest>(&bytes).map(|request| request.check());
        let _ = decode_request::<JobRequest>(&bytes);
        let _ = decode_request::<JobFetchRequest>(&bytes);
        let _ = JobProgressMessage::from_json(&bytes);
        let _ = serde_json::from_slice::<Job>(&bytes);
        let _ = serde_json::from_slice::<JobListReply>(&bytes);
    }

    #[test]
    fn truncated_messages_are_refused(cut in 0..200_usize) {
        let json = serde_json::to_vec(&JobProgressMessage::from(&a_job())).unwrap();
        let cut = cut.min(json.len() - 1);
        prop_assert!(JobProgressMessage::from_json(&json[..cut]).is_err());
    }

    #[test]
    fn any_progress_comes_back(done: u32, rejected: u32, total: u32, seconds_left in proptest::option::of(0.0..1e9_f64)) {
        let progress = JobProgress { stage: None, done, rejected, total, seconds_left };
        let job = Job { progress, ..a_job() };
        let sent = JobProgressMessage::from(&job);
        prop_assert_eq!(JobProgressMessage::from_json(&serde_json::to_vec(&sent).unwrap()).unwrap(), sent);
    }
}
