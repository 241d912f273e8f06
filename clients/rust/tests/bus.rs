//! A client against a small daemon, over loopback.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod common;

use std::net::TcpListener;
use std::time::{Duration, Instant};

use plica_client::mesh::{rest_mesh, rest_positions};
use plica_client::protocol::pose::Pose;
use plica_client::protocol::rpc::StepReply;
use plica_client::{Client, ClientError, ClientOptions, PoseSource};
use serde_json::json;

use common::{SmallDaemon, frame, mesh_bytes};

const LONG: Duration = Duration::from_secs(5);

#[test]
fn poses_out_wrenches_back() {
    let daemon = SmallDaemon::start();
    let client = daemon.client();
    let wrenches = client.subscribe_wrenches("probe", 1000).unwrap();
    let mut source = PoseSource::new();
    let sent: Vec<Pose> = (0..100).map(|i| source.pose([f64::from(i), 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])).collect();
    let publisher = client.lossless_pose_publisher("probe").unwrap();
    sent.iter().for_each(|pose| publisher.publish(pose).unwrap());
    for pose in &sent {
        let echo = wrenches.next(LONG).expect("an echo of each pose").wrench;
        assert_eq!((echo.pose_source_time_ns, echo.force_n), (pose.source_time_ns, pose.position_m));
    }
    assert_eq!((wrenches.stats().received, wrenches.stats().missed, wrenches.stats().dropped), (100, 0, 0));
    let started = Instant::now();
    drop(client);
    assert!(started.elapsed() < Duration::from_secs(3));
}

#[test]
fn a_slow_reader_gets_the_latest_skin_and_counts_the_rest() {
    let daemon = SmallDaemon::start();
    let client = daemon.client();
    let skins = client.subscribe_skin("wedge").unwrap();
    let key = client.keys().skin("wedge");
    let deadline = Instant::now() + LONG;
    while skins.stats().received == 0 && Instant::now() < deadline {
        daemon.put(&key, frame(1));
        std::thread::sleep(Duration::from_millis(20));
    }
    daemon.put(&key, b"no skin".to_vec());
    (10..20).for_each(|n| daemon.put(&key, frame(n)));
    let mut newest = 0;
    while newest != 19 {
        newest = skins.next(LONG).expect("the newest frame").header.sequence;
    }
    let stats = skins.stats();
    assert_eq!((stats.malformed, stats.missed), (1, 8));
    assert_eq!(client.skin_now("wedge").unwrap().header.sequence, 7);
}

#[test]
fn questions_and_refusals() {
    let daemon = SmallDaemon::start();
    let client = daemon.client();
    assert_eq!(client.status().unwrap().scene, "small");
    assert_eq!(client.rpc("pause", &json!({})).unwrap()["paused"], true);
    assert_eq!(client.step(5, Vec::new()).unwrap(), StepReply { tick: 5, sim_time_s: 0.0 });
    let Err(ClientError::Refused(error)) = client.rpc("step", &json!({"tick": 5})) else { panic!("refused") };
    assert_eq!(error.code, "rpc_malformed");
    let Err(ClientError::Refused(error)) = client.rpc("explode", &json!({})) else { panic!("refused") };
    assert_eq!(error.code, "rpc_unknown");
    assert!(matches!(client.rpc("*", &json!({})), Err(ClientError::Name(_))));
    assert!(matches!(client.skin_now("no_such"), Err(ClientError::NoAnswer { .. })));
}

#[test]
fn a_mesh_in_pieces_is_checked() {
    let daemon = SmallDaemon::start();
    let client = daemon.client();
    let glb = client.mesh("wedge").unwrap();
    assert_eq!(glb, mesh_bytes());
    assert_eq!(rest_positions(&glb).unwrap()[1], [0.04, 0.0, 0.01]);
    assert_eq!(rest_mesh(&glb).unwrap().triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(rest_positions(b"glTF").is_err());
    assert!(matches!(client.mesh("broken"), Err(ClientError::Checksum { .. })));
}

#[test]
fn nobody_there_is_said_at_once() {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let options = ClientOptions { endpoint: format!("tcp/127.0.0.1:{port}"), ..ClientOptions::default() };
    let started = Instant::now();
    let error = Client::connect(&options).unwrap_err().to_string();
    assert!(error.starts_with(&format!("no plicad answered on tcp/127.0.0.1:{port}: start one with `plicad serve`")));
    assert!(started.elapsed() < LONG, "{:?}", started.elapsed());
    assert!(error.ends_with("or wait if it is still starting"), "{error}");
    let options = ClientOptions { endpoint: "nonsense".to_owned(), ..ClientOptions::default() };
    assert!(matches!(Client::connect(&options), Err(ClientError::Endpoint(_))));
}

#[test]
fn a_failed_connection_is_told_with_its_cause_and_without_the_text_of_zenoh() {
    // Accepts and says nothing, as a program that is no daemon.
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = other.local_addr().unwrap().port();
    let to = |endpoint: String| ClientOptions { endpoint, timeout: Duration::from_secs(1), ..ClientOptions::default() };
    for (options, expected) in [
        (
            to("foo/1.2.3.4:5".into()),
            "`foo/1.2.3.4:5` is not an endpoint: the transport `foo` is not one of tcp, tls; ",
        ),
        (to("tcp/127.0.0.1".into()), "`tcp/127.0.0.1` is not an endpoint: no `:PORT` at the end; expected "),
        (
            to("tcp/no-such-host.invalid:7447".into()),
            "no plicad answered on tcp/no-such-host.invalid:7447: no host is known as `no-such-host.invalid`; check its name",
        ),
        (to(format!("tcp/127.0.0.1:{port}")), "a program listens on tcp/127.0.0.1:"),
        (to(format!("tls/127.0.0.1:{port}")), "tls/127.0.0.1:"),
    ] {
        let error = Client::connect(&options).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with(expected) && !text.contains(".rs"), "{text}");
        if let ClientError::Connect { detail, .. } = &error {
            assert!(detail.contains("Unable to connect"), "the text of Zenoh is kept: {detail}");
        }
    }
}

#[test]
fn faults_of_a_configuration_file_name_file_line_and_key() {
    let folder = tempfile::TempDir::new().unwrap();
    let refused = |name: &str, text: &str| {
        let file = folder.path().join(name);
        std::fs::write(&file, text).unwrap();
        Client::connect(&ClientOptions { config_file: Some(file), ..ClientOptions::default() }).unwrap_err().to_string()
    };
    let text = refused("key.json5", "{\n  mode: \"client\",\n  nokey: 1,\n}");
    assert!(text.ends_with("key.json5:3: unknown key `nokey`; configs/zenoh has working files"), "{text}");
    let text = refused("bad.json5", "{\n  mode: \n}");
    assert!(text.contains("bad.json5:") && text.contains(": not valid JSON5; "), "{text}");
    let closed = "mode: \"client\", connect: {endpoints: [\"tls/127.0.0.1:9\"], timeout_ms: 100}";
    let tls = format!("{{{closed}, transport: {{link: {{tls: {{root_ca_certificate: \"/no/such.pem\"}}}}}}}}");
    let text = refused("tls.json5", &tls);
    assert!(text.contains("tls.json5: `root_ca_certificate` is /no/such.pem, which cannot be read (No such"), "{text}");
    let options = ClientOptions { config_file: Some("no/such.json5".into()), ..ClientOptions::default() };
    let text = Client::connect(&options).unwrap_err().to_string();
    assert!(text.starts_with("no/such.json5: cannot be read (No such file"), "{text}");
}
