//! Keys, requests, chunks and status as they appear on the bus.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use plica_protocol::DecodeError;
use plica_protocol::chunk::{CHUNK_BYTES, ChunkHeader, offset_of, piece};
use plica_protocol::keys::{Keys, check_name, is_wildcard};
use plica_protocol::order::Refusal;
use plica_protocol::pose::Pose;
use plica_protocol::rpc::*;
use plica_protocol::status::{FRAME_REFUSED, QUEUE_FULL, REPLY_DROPPED, Status};

#[test]
fn keys_are_those_of_the_page() {
    let keys = Keys::new("main").unwrap();
    assert_eq!(keys.pose("probe"), "plica/v1/main/tool/probe/pose");
    assert_eq!(keys.wrench("probe"), "plica/v1/main/tool/probe/wrench");
    assert_eq!(keys.skin("wedge"), "plica/v1/main/object/wedge/skin");
    assert_eq!(keys.mesh("wedge"), "plica/v1/main/object/wedge/mesh");
    assert_eq!(keys.status(), "plica/v1/main/status");
    assert_eq!(keys.rpc("step"), "plica/v1/main/rpc/step");
    assert_eq!(keys.job_progress(), "plica/v1/main/job_progress");
    assert_eq!(keys.alive(), "plica/v1/main/alive");
}

#[test]
fn keys_are_read_back() {
    let keys = Keys::new("main").unwrap();
    assert_eq!(keys.tool_of_pose("plica/v1/main/tool/probe/pose"), Some("probe"));
    assert_eq!(keys.tool_of_pose("plica/v1/other/tool/probe/pose"), None);
    assert_eq!(keys.tool_of_pose("plica/v1/main/tool/a/b/pose"), None);
    assert_eq!(keys.tool_of_pose("plica/v1/main/tool/*/pose"), None);
    assert_eq!(keys.tool_of_pose("plica/v1/main/tool/pose"), None);
    assert_eq!(keys.tool_of_wrench("plica/v1/main/tool/probe/wrench"), Some("probe"));
    assert_eq!(keys.object_of_skin("plica/v1/main/object/wedge/skin"), Some("wedge"));
    assert_eq!(keys.object_of_mesh("plica/v1/main/object/wedge/mesh"), Some("wedge"));
    assert_eq!(keys.method_of_rpc("plica/v1/main/rpc/step"), Some("step"));
    assert!(is_wildcard(&keys.rpc("*")) && is_wildcard("plica/**") && !is_wildcard(&keys.rpc("step")));
}

#[test]
fn names_have_no_characters_that_mean_something_in_a_key() {
    for bad in ["", "a/b", "*", "$*", "a#", "a?b", "a b", "ä", &"x".repeat(65)] {
        check_name(bad).unwrap_err();
        Keys::new(bad).unwrap_err();
    }
    check_name("probe-1_left.tip").unwrap();
}

#[test]
fn step_takes_poses_as_json() {
    let json = br#"{"ticks": 3, "poses": [{"tool": "probe", "position": [0, 0, 0.1], "orientation": [0, 0, 0, 1]}]}"#;
    let request: StepRequest = decode_request(json).unwrap();
    assert_eq!((request.ticks, request.poses[0].tool.as_str()), (3, "probe"));
    let pose = request.poses[0].to_pose(1.0).unwrap();
    assert_eq!(pose, Pose { position_m: [0.0, 0.0, 0.1], ..Pose::default() });
    assert_eq!(StepPose::new("probe", &pose), request.poses[0]);
    let sent = serde_json::to_vec(&request).unwrap();
    assert_eq!(decode_request::<StepRequest>(&sent).unwrap(), request);
}

#[test]
fn requests_of_another_shape_are_malformed() {
    for bad in ["{\"tick\": 1}", "{}", "[]", "{\"ticks\": -1}", "{\"ticks\": 1, \"poses\": [{}]}", "x"] {
        let error = decode_request::<StepRequest>(bad.as_bytes()).unwrap_err();
        assert_eq!((error.code.as_str(), error.retryable), ("rpc_malformed", false), "{bad}");
    }
    decode_request::<EmptyRequest>(b"").unwrap();
    decode_request::<EmptyRequest>(b"{}").unwrap();
    decode_request::<EmptyRequest>(b"{\"now\": true}").unwrap_err();
    assert_eq!(decode_request::<RestoreRequest>(br#"{"id": "1"}"#).unwrap().id, "1");
}

#[test]
fn digits_name_a_job_and_everything_else_a_file() {
    let read = |json: &str| decode_request::<ActivateRequest>(json.as_bytes());
    assert_eq!(read(r#"{"database": "0012"}"#).unwrap().job(), Some("0012"));
    for path in ["", "./0012", "wedge.safetensors", "/data/1"] {
        assert_eq!(ActivateRequest { database: path.into() }.job(), None, "{path}");
    }
    assert_eq!(read("{}").unwrap_err().code, "rpc_malformed");
}

#[test]
fn methods_and_codes() {
    for method in Method::ALL {
        assert_eq!(Method::parse(method.name()).unwrap(), method);
    }
    let error = Method::parse("rest").unwrap_err();
    assert_eq!(
        error.to_json(),
        r#"{"code":"rpc_unknown","message":"no method `rest`; there are reset, pause, resume, step, interrupt, snapshot, restore, job_submit, job_list, job_get, job_cancel, job_resume, job_fetch, activate","retryable":false,"done":"no"}"#
    );
    assert!(ErrorReply::new(ErrorCode::Busy, "").retryable);
}

#[test]
fn repeating_is_only_advised_where_nothing_was_done() {
    for code in ErrorCode::ALL {
        let reply = ErrorReply::new(code, "");
        assert!(!reply.retryable || reply.done == Done::No, "{reply:?}");
    }
    let stopped = ErrorReply::new(ErrorCode::TimedOut, "").stopped_at(1200, 200);
    let expected =
        r#"{"code":"timed_out","message":"","retryable":false,"done":"partly","tick":1200,"ticks_done":200}"#;
    assert_eq!(stopped.to_json(), expected);
    // A reply of an earlier version does not say it, and one of a later version may say something new.
    for done in ["", r#", "done": "twice""#] {
        let json = format!(r#"{{"code": "busy", "message": "", "retryable": true{done}}}"#);
        assert_eq!(serde_json::from_str::<ErrorReply>(&json).unwrap().done, Done::Unknown);
    }
}

#[test]
fn an_array_is_no_object_wherever_one_is_expected() {
    let pose = "[\"probe\", 0, 0, 5, true, [0, 0, 0], [0, 0, 0, 1], 0, 0]";
    let step = format!("{{\"ticks\": 1, \"poses\": [{pose}]}}");
    for request in ["[]", "[1]", "[1, []]", "null", "1", "true", "\"x\"", " ", "[{}]", &step] {
        let code = |error: ErrorReply| error.code;
        assert_eq!(
            decode_request::<EmptyRequest>(request.as_bytes()).map_err(code),
            Err("rpc_malformed".into()),
            "{request}"
        );
        assert_eq!(
            decode_request::<StepRequest>(request.as_bytes()).map_err(code),
            Err("rpc_malformed".into()),
            "{request}"
        );
    }
    decode_request::<RestoreRequest>(br#"["0001"]"#).unwrap_err();
    decode_request::<ActivateRequest>(br#"["0001"]"#).unwrap_err();
    let pose = b"[0, 0, 5, true, [0, 0, 0], [0, 0, 0, 1], 0, 0]";
    assert_eq!(Pose::decode_json(pose).map_err(|e| e.kind()), Err("bad_json"));
    // A key twice, or one too many, is refused as before.
    for bad in [r#"{"ticks": 1, "ticks": 2}"#, r#"{"ticks": 1, "tick": 2}"#] {
        decode_request::<StepRequest>(bad.as_bytes()).unwrap_err();
    }
}

#[test]
fn a_snapshot_id_is_compared_as_text() {
    let number = |id: &str| RestoreRequest { id: id.to_owned() }.number();
    assert_eq!(number("1"), Some(1));
    for id in ["+1", "0001", "01", " 1", "1 ", "1.0", "", "-1", "99999999999999999999"] {
        assert_eq!(number(id), None, "{id}");
    }
}

#[test]
fn pieces_make_the_whole() {
    let whole: Vec<u8> = (0..CHUNK_BYTES + 10).map(|i| i as u8).collect();
    let mut read = Vec::new();
    while read.len() < whole.len() {
        read.extend_from_slice(piece(&whole, read.len() as u64).unwrap());
    }
    assert_eq!(read, whole);
    assert!(piece(&whole, whole.len() as u64).unwrap().is_empty());
    assert_eq!(piece(&whole, whole.len() as u64 + 1).unwrap_err().code, "bad_offset");
    assert_eq!(piece(&whole, u64::MAX).unwrap_err().code, "bad_offset");
}

#[test]
fn offsets_are_selector_parameters() {
    assert_eq!(offset_of("").unwrap(), 0);
    assert_eq!(offset_of("offset=524288").unwrap(), 524_288);
    assert_eq!(offset_of("_time=now;offset=7").unwrap(), 7);
    for bad in ["offset=", "offset=-1", "offset=+7", "offset=1e3", "offset=99999999999999999999"] {
        assert_eq!(offset_of(bad).unwrap_err().code, "bad_offset", "{bad}");
    }
    let header = ChunkHeader { total_bytes: 3, offset: 0, sha256: "00".repeat(32) };
    assert_eq!(ChunkHeader::from_json(header.to_json().as_bytes()).unwrap(), header);
}

#[test]
fn status_reads_older_and_newer_daemons() {
    let status: Status = serde_json::from_str(r#"{"tick": 7, "realtime": {"scheduling": "fifo"}, "new": 1}"#).unwrap();
    assert_eq!(status.tick, 7);
    let json = serde_json::to_string(&Status::default()).unwrap();
    assert_eq!(serde_json::from_str::<Status>(&json).unwrap(), Status::default());
    for key in [
        "\"scheduling\":\"normal\"",
        "\"jobs_unavailable\":null",
        "\"tick_us\":{\"count\":0",
        "\"jobs\":[]",
        "\"drops\":{\"wrenches\":0",
    ] {
        assert!(json.contains(key), "{key} in {json}");
    }
}

#[test]
fn the_page_names_every_counter_and_every_code() {
    let page = include_str!("../PROTOCOL.md");
    let refusals = Refusal::ALL.map(Refusal::kind);
    let codes = ErrorCode::ALL.map(ErrorCode::name);
    let others = [QUEUE_FULL, REPLY_DROPPED, FRAME_REFUSED];
    for name in [DecodeError::KINDS.as_slice(), &refusals, &codes, &others].concat() {
        let in_a_table = |line: &str| line.starts_with('|') && line.contains(&format!("`{name}`"));
        assert!(page.lines().any(in_a_table), "no table of PROTOCOL.md has `{name}`");
    }
}

#[test]
fn the_page_names_the_limits() {
    let page = include_str!("../PROTOCOL.md");
    let limits = page.split("**Limits.**").nth(1).unwrap().split("\n## ").next().unwrap();
    let zenoh = include_str!("../../configs/zenoh/default.json5");
    let thousands = |n: usize| if n < 1000 { n.to_string() } else { format!("{},{:03}", n / 1000, n % 1000) };
    let ticks_and_poses = format!("| {} and {} |", thousands(MAX_STEP_TICKS as usize), thousands(MAX_STEP_POSES));
    for row in [ticks_and_poses, format!("| {MAX_SNAPSHOTS} | snapshots"), "| 64 | clients".into(), "| 4 MiB |".into()]
    {
        assert!(limits.contains(&row), "{row}");
    }
    assert!(
        zenoh.contains("max_sessions: 64,") && zenoh.contains("max_message_size: 4194304"),
        "they stand on the page"
    );
    assert!(page.contains(&format!("stops early after {} s", ANSWER_WITHIN.as_secs())));
}
