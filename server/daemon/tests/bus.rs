//! The daemon in this process, real clients over loopback: what arrives, what is refused, and that nobody delays a tick.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use plica_client::protocol::pose::Pose;
use plica_client::protocol::rpc::{SnapshotReply, StateReply, StepPose};
use plica_client::protocol::wrench::Wrench;
use plica_client::{Client, ClientError};
use serde_json::{Value, json};
use zenoh::Wait;

use common::{Misbehaviour, TICKS_FOR_A_WHILE, TestServer, pose, wait_for};

const SECOND: Duration = Duration::from_secs(1);

#[test]
fn a_client_publishes_poses_and_receives_skin_and_wrenches() {
    let server = TestServer::start(false);
    let client = server.client();
    let skins = client.subscribe_skin("block").unwrap();
    let wrenches = client.subscribe_wrenches("ball", 4096).unwrap();
    let rest = client.skin_now("block").unwrap().frame().unwrap().vectors();
    let publisher = client.lossless_pose_publisher("ball").unwrap();
    for k in 1..=100 {
        publisher.publish(&pose(5, k, 0.024)).unwrap();
        std::thread::sleep(Duration::from_millis(4));
    }
    let pressed = skins.next(SECOND).unwrap();
    let positions = pressed.frame().unwrap().vectors();
    assert_eq!(positions.len(), rest.len());
    assert!(positions.iter().zip(&rest).any(|(p, r)| r[2] - p[2] > 5e-4), "the ball has dented the skin");
    let mut newest = Wrench::default();
    while newest.pose_sequence < 100 {
        let next = wrenches.next(SECOND).unwrap().wrench;
        assert!(next.sequence > newest.sequence);
        newest = next;
    }
    assert!(newest.flags.in_contact && newest.force_n[2] > 0.01, "{newest:?}");
    let status = client.status().unwrap();
    let tool = &status.tools["ball"];
    assert_eq!(tool.poses_accepted + tool.poses_rejected.values().sum::<u64>(), 100, "{tool:?}");
    assert_eq!(tool.poses_rejected.keys().find(|kind| *kind != "queue_full"), None, "{tool:?}");
    assert_eq!(status.objects["block"].n_vertices as usize, rest.len());
    assert!(status.objects["block"].frames_published > 0);
    assert!(status.stages.contains_key("contact") && status.tick_us.count > 100);
}

#[test]
fn the_mesh_comes_in_pieces_and_is_a_glb() {
    let server = TestServer::start(false);
    let client = server.client();
    let glb = client.mesh("block").unwrap();
    assert_eq!(&glb[..4], b"glTF");
    let mesh = plica_client::mesh::rest_mesh(&glb).unwrap();
    assert_eq!(
        mesh.positions_m,
        client.skin_now("block").unwrap().frame().unwrap().vectors(),
        "same order, same numbers"
    );
    let status = client.status().unwrap();
    assert_eq!(mesh.triangles.len(), status.objects["block"].n_triangles as usize);
    assert_eq!(refused(client.mesh("sphere")), "unknown_object");
}

#[test]
fn the_status_has_the_keys_of_the_page() {
    let page = include_str!("../../../protocol/PROTOCOL.md");
    let example = page.split("```json").find(|block| block.contains("\"versions\"")).unwrap();
    let example: Value = serde_json::from_str(example.split("```").next().unwrap()).unwrap();
    let server = TestServer::start(false);
    let status = server.client().status_json().unwrap();
    assert_eq!(key_paths(&status, ""), key_paths(&example, ""));
}

/// Paths of all keys; names that a scene chooses are `*`, counters are left out.
fn key_paths(value: &Value, path: &str) -> BTreeSet<String> {
    let Some(map) = value.as_object().filter(|_| !path.ends_with("rejected")) else { return [path.to_owned()].into() };
    let named = ["/objects", "/tools"].contains(&path);
    map.iter().flat_map(|(key, value)| key_paths(value, &format!("{path}/{}", if named { "*" } else { key }))).collect()
}

#[test]
fn the_protocol_names_the_stages_in_the_order_of_a_tick() {
    assert_eq!(plica_client::protocol::status::STAGES, plica_sim::Stage::ALL.map(plica_sim::Stage::name));
}

#[test]
fn a_whole_step_comes_in_parts_where_the_daemon_limits_it_and_an_interrupt_ends_it() {
    let server = TestServer::start(true);
    let client = server.client();
    // Pressed, so that no tick is skipped asleep.
    client.step(1, vec![StepPose::new("ball", &pose(1, 1, 0.023))]).unwrap();
    let stepping = std::thread::spawn({
        let client = server.client();
        move || (0..).map(|_| client.step(10_000, Vec::new())).find_map(Result::err).unwrap()
    });
    wait_for("ticks", || client.status().unwrap().tick > 10);
    let mut state = client.interrupt().unwrap();
    wait_for("the end of the step", || {
        state = client.interrupt().unwrap();
        stepping.is_finished()
    });
    let ClientError::Refused(error) = stepping.join().unwrap() else { panic!("not refused") };
    assert_eq!(
        (error.code.as_str(), error.tick, error.retryable),
        ("interrupted", Some(state.tick), false),
        "{error:?}"
    );
    assert_eq!(client.interrupt().unwrap(), state);
}

#[test]
fn lock_step_over_the_bus_gives_the_bytes_of_a_replay() {
    let server = TestServer::start(true);
    let client = server.client();
    let mut over_the_bus = Vec::new();
    for k in 0..60 {
        let step = StepPose::new("ball", &common::pose_on_path(k));
        let reply = client.step(1, vec![step]).unwrap();
        assert_eq!(reply.tick, k + 1);
        let message = client.skin_now("block").unwrap();
        assert_eq!(message.header.tick, k + 1);
        over_the_bus.push(message.frame().unwrap().position_bytes().to_vec());
    }
    assert_eq!(over_the_bus, common::replay_bytes(60));
    assert_ne!(over_the_bus[0], over_the_bus[59], "the path touches the object");
}

#[test]
fn methods_do_what_they_say() {
    let server = TestServer::start(false);
    let client = server.client();
    let paused: StateReply = client.call("pause", &json!({})).unwrap();
    assert!(paused.paused);
    let tick = client.step(3, Vec::new()).unwrap().tick;
    assert!(tick >= paused.tick + 3);
    let snapshot: SnapshotReply = client.call("snapshot", &json!({})).unwrap();
    client.step(5, Vec::new()).unwrap();
    let restored: StateReply = client.call("restore", &json!({ "id": snapshot.id })).unwrap();
    assert_eq!(restored.tick, tick);
    let reset: StateReply = client.call("reset", &json!({})).unwrap();
    assert_eq!((reset.tick, reset.paused), (0, true));
    let resumed: StateReply = client.call("resume", &json!({})).unwrap();
    assert!(!resumed.paused);
    wait_for("ticks after resume", || client.status().unwrap().tick > 10);
}

#[test]
fn bad_requests_get_an_error_and_change_nothing() {
    let server = TestServer::start(true);
    let client = server.client();
    let before = client.skin_now("block").unwrap();
    let good = json!({ "tool": "ball", "position": [0.02, 0.02, 0.024], "orientation": [0, 0, 0, 1] });
    let far = json!({ "tool": "ball", "position": [1e9, 0, 0], "orientation": [0, 0, 0, 1] });
    let cases = [
        ("fly", json!({}), "rpc_unknown"),
        ("pause", json!({ "now": true }), "rpc_malformed"),
        ("step", json!({ "ticks": -1 }), "rpc_malformed"),
        ("step", json!({ "ticks": 10_001 }), "rpc_malformed"),
        ("step", json!({ "ticks": 1, "poses": [good, far] }), "bad_pose"),
        (
            "step",
            json!({ "ticks": 1, "poses": [{ "tool": "drill", "position": [0, 0, 0], "orientation": [0, 0, 0, 1] }] }),
            "unknown_tool",
        ),
        ("restore", json!({ "id": "77" }), "unknown_snapshot"),
        ("restore", json!({ "id": "x" }), "unknown_snapshot"),
        ("resume", json!({}), "rpc_malformed"),
    ];
    for (method, arguments, code) in cases {
        assert_eq!(refused(client.rpc(method, &arguments)), code, "{method} {arguments}");
    }
    let raw = server.raw_session();
    assert_eq!(ask_raw(&raw, "plica/v1/main/rpc/*", b"{}"), "rpc_wildcard");
    assert_eq!(ask_raw(&raw, "plica/v1/*/rpc/reset", b"{}"), "rpc_wildcard");
    assert_eq!(ask_raw(&raw, "plica/v1/main/rpc/reset", b"{\"a"), "rpc_malformed");
    assert_eq!(ask_raw(&raw, "plica/v1/main/object/block/mesh?offset=x", b""), "bad_offset");
    assert_eq!(ask_raw(&raw, "plica/v1/main/object/block/mesh?offset=999999999", b""), "bad_offset");
    let after = client.skin_now("block").unwrap();
    assert_eq!((after.header.tick, after.bytes), (before.header.tick, before.bytes));
    let rejected = client.status().unwrap().rejected;
    assert_eq!((rejected["rpc_unknown"], rejected["rpc_wildcard"], rejected["bad_pose"]), (1, 2, 1));
}

#[test]
fn bad_poses_are_counted_by_kind_and_change_nothing() {
    let server = TestServer::start(false);
    let client = server.client();
    let publisher = client.lossless_pose_publisher("ball").unwrap();
    publisher.publish(&pose(5, 10, 0.2)).unwrap();
    wait_for("the good pose", || client.status().unwrap().tools["ball"].poses_accepted == 1);
    let good = pose(5, 11, 0.2).encode();
    let changed = |at: usize, bytes: &[u8]| {
        let mut message = good.to_vec();
        message[at..at + bytes.len()].copy_from_slice(bytes);
        message
    };
    let binary = [
        good[..50].to_vec(),
        [&good[..], b"x"].concat(),
        changed(0, b"XXXX"),
        changed(4, &[9, 0]),
        changed(32, &f64::NAN.to_le_bytes()),
        changed(32, &1e6_f64.to_le_bytes()),
        changed(80, &2.0_f64.to_le_bytes()),
        pose(5, 10, 0.3).encode().to_vec(),
        pose(5, 9, 0.3).encode().to_vec(),
        pose(6, 1, 0.3).encode().to_vec(),
    ];
    binary.into_iter().for_each(|message| publisher.publish_bytes(message, false).unwrap());
    publisher.publish_bytes(b"{\"position\": [0, 0]}".to_vec(), true).unwrap();
    publish(&client, "drill", &pose(5, 1, 0.2));
    let kinds = [
        "too_short",
        "bad_length",
        "bad_magic",
        "bad_version",
        "non_finite",
        "out_of_range",
        "not_unit",
        "repeated",
        "out_of_order",
        "conflict",
        "bad_json",
    ];
    wait_for("all kinds", || {
        let status = client.status().unwrap();
        let rejected = &status.tools["ball"].poses_rejected;
        kinds.iter().all(|kind| rejected.get(*kind) == Some(&1)) && status.rejected.get("unknown_tool") == Some(&1)
    });
    assert_eq!(client.status().unwrap().tools["ball"].poses_accepted, 1);
    wait_for("a tick with the good pose", || client.status().unwrap().tools["ball"].pose_sequence == 10);
}

#[test]
fn a_restarted_client_takes_over_once_the_old_one_is_stale() {
    let server = TestServer::start_with_impatient_tool();
    let client = server.client();
    publish(&client, "ball", &pose(1, 500, 0.2));
    wait_for("the first source", || client.status().unwrap().tools["ball"].pose_sequence == 500);
    let mut sequence = 0;
    wait_for("the second source", || {
        sequence += 1;
        client.publish_pose("ball", &pose(2, sequence, 0.2)).unwrap();
        let tool = &client.status().unwrap().tools["ball"];
        tool.poses_accepted > 1 && tool.pose_sequence < 500
    });
    let status = client.status().unwrap();
    assert!(status.tools["ball"].poses_rejected["conflict"] >= 1);
}

/// Subscribers in processes of their own that sleep, are stopped, or panic in their callback: every tick still happens, and
/// the good one is served. Ticks are counted, not timed: what the machine itself costs is counted as skipped.
#[test]
fn slow_frozen_and_panicking_subscribers_delay_no_tick() {
    let server = TestServer::start(false);
    let good = server.client();
    let frames = good.subscribe_skin("block").unwrap();
    // Touched, so that it does not fall asleep and publish twice a second only.
    publish(&good, "ball", &pose(1, 1, 0.024));
    let _bad = [Misbehaviour::Sleeps, Misbehaviour::Stopped, Misbehaviour::Panics].map(|m| m.start(server.endpoint()));
    let (begin, before, received) = (Instant::now(), good.status().unwrap(), frames.stats().received);
    wait_for("ticks", || good.status().unwrap().tick > before.tick + TICKS_FOR_A_WHILE);
    let (after, due) = (good.status().unwrap(), begin.elapsed().as_millis() as u64);
    let made = after.tick - before.tick + after.skipped_ticks - before.skipped_ticks;
    assert!(made + 50 >= due.min(TICKS_FOR_A_WHILE), "{made} ticks made or given up, {due} were due");
    let frames = frames.stats().received - received;
    let published = after.objects["block"].frames_published - before.objects["block"].frames_published;
    assert!(frames > published / 2, "the good subscriber received {frames} of {published} frames");
    assert!(published > 90 * TICKS_FOR_A_WHILE / 1000 / 2, "{published} frames were published");
}

#[test]
fn the_daemon_stops_within_three_seconds_beside_a_stopped_client() {
    let server = TestServer::start(false);
    publish(&server.client(), "ball", &pose(1, 1, 0.2));
    let _bad = Misbehaviour::Stopped.start(server.endpoint());
    std::thread::sleep(SECOND);
    let begin = Instant::now();
    server.stop();
    assert!(begin.elapsed() < 3 * SECOND, "{:?}", begin.elapsed());
}

/// No test of its own: the body of the processes that the two tests above start.
#[test]
fn misbehaving_subscriber() {
    common::misbehave_if_asked();
}

#[test]
fn a_liveliness_token_stands_while_the_daemon_runs() {
    let server = TestServer::start(false);
    let session = server.raw_session();
    let tokens = session.liveliness().get("plica/v1/*/alive").wait().unwrap();
    let token = tokens.recv().unwrap().into_result().unwrap();
    assert_eq!(token.key_expr().as_str(), "plica/v1/main/alive");
}

/// One pose that must arrive.
fn publish(client: &Client, tool: &str, pose: &Pose) {
    client.lossless_pose_publisher(tool).unwrap().publish(pose).unwrap();
}

/// Code of the error that the daemon answered with.
fn refused<T: std::fmt::Debug>(result: Result<T, ClientError>) -> String {
    match result.unwrap_err() {
        ClientError::Refused(error) => error.code,
        other => panic!("another error: {other}"),
    }
}

fn ask_raw(session: &zenoh::Session, selector: &str, payload: &[u8]) -> String {
    let replies = session.get(selector).payload(payload).wait().unwrap();
    let error = replies.recv().unwrap().into_result().unwrap_err();
    let error: Value = serde_json::from_slice(&error.payload().to_bytes()).unwrap();
    error["code"].as_str().unwrap().to_owned()
}
