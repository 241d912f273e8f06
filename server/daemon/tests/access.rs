//! The shipped configurations for networks: each client may do what its name allows, and nobody else may connect.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use plica_client::protocol::pose::Pose;
use plica_client::{Client, ClientError, ClientOptions};
use plica_daemon::bus::BusOptions;
use plica_daemon::server::Server;
use plica_scene::Config;
use serde_json::{Value, json};
use zenoh::Wait;

const SCENE: &str = r#"
[objects.block]
mesh = { generator = "block", size_m = [0.04, 0.04, 0.02] }
material = { young_modulus_pa = 3e4, poisson_ratio = 0.4, density_kg_per_m3 = 1000.0 }
supports = { fixed = { faces = ["z_min"] } }
coarse = { divisions = [2, 2, 2] }
skin = { spacing_m = 0.005 }
[tools.ball]
shape = { ball = { radius_m = 0.006 } }
[runtime]
realtime_priority = 0
lock_memory = false
"#;

#[test]
fn certificates_decide_who_may_do_what() {
    let folder = tempfile::tempdir().unwrap();
    if !make_certificates(folder.path()) {
        println!("skipped: openssl is not there to make certificates");
        return;
    }
    let endpoint = free_endpoint();
    let server = serve(folder.path(), &endpoint, "daemon");
    let connect = |name: &str| connect(folder.path(), &endpoint, &with_certificate(folder.path(), name));
    let (tracker, front_end, operator) =
        (connect("tracker").unwrap(), connect("front-end").unwrap(), connect("operator").unwrap());

    let pose = |sequence| Pose { sequence, position_m: [0.02, 0.02, 0.1], ..Pose::default() };
    let (forbidden, allowed) =
        (front_end.lossless_pose_publisher("ball").unwrap(), tracker.lossless_pose_publisher("ball").unwrap());
    for k in 1..=20 {
        forbidden.publish(&pose(1000 + k)).unwrap();
        allowed.publish(&pose(k)).unwrap();
        std::thread::sleep(Duration::from_millis(10));
    }
    let ball = || front_end.status().unwrap().tools["ball"].clone();
    let begin = Instant::now();
    while ball().pose_sequence != 20 && begin.elapsed() < Duration::from_secs(10) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let ball = ball();
    assert_eq!((ball.poses_accepted, ball.pose_sequence), (20, 20), "the tracker's poses, nobody else's");
    assert!(ball.poses_rejected.is_empty(), "{:?}", ball.poses_rejected);

    assert!(front_end.mesh("block").is_ok());
    let frames = front_end.subscribe_skin("block").unwrap();
    assert!(frames.next(Duration::from_secs(5)).is_some());
    assert!(denied(tracker.status().unwrap_err()));
    assert!(denied(front_end.rpc("reset", &json!({})).unwrap_err()));
    assert!(operator.rpc("pause", &json!({})).is_ok());
    assert!(operator.status().unwrap().paused);
    assert!(connect("stranger").is_err(), "a certificate of another authority");
    assert!(connect("daemon").is_err(), "the daemon's certificate is for the daemon");

    let session = |name: &str| {
        let file = client_configuration(folder.path(), &endpoint, &with_certificate(folder.path(), name));
        zenoh::open(zenoh::Config::from_file(file).unwrap()).wait().unwrap()
    };
    let (raw_tracker, raw_front_end) = (session("tracker"), session("front-end"));
    let forged = raw_tracker.liveliness().declare_token("plica/v1/other/alive").wait();
    let seen = raw_front_end.liveliness().get("plica/v1/*/alive").timeout(Duration::from_secs(1)).wait().unwrap();
    let seen: Vec<_> = seen.iter().filter_map(|r| Some(r.result().ok()?.key_expr().to_string())).collect();
    assert_eq!(seen, ["plica/v1/main/alive"], "no client says that a daemon is there");
    drop(forged);
    server.stop();
}

#[test]
fn a_certificate_of_a_client_never_serves_as_the_daemons() {
    let folder = tempfile::tempdir().unwrap();
    if !make_certificates(folder.path()) {
        println!("skipped: openssl is not there to make certificates");
        return;
    }
    let endpoint = free_endpoint();
    let impostor = serve(folder.path(), &endpoint, "tracker");
    let operator = connect(folder.path(), &endpoint, &with_certificate(folder.path(), "operator"));
    assert!(operator.is_err(), "the operator takes a tracker for the daemon");
    impostor.stop();
}

#[test]
fn passwords_decide_who_may_do_what() {
    let folder = tempfile::tempdir().unwrap();
    if !make_certificates(folder.path()) {
        println!("skipped: openssl is not there to make certificates");
        return;
    }
    std::fs::write(folder.path().join("passwords.txt"), "front-end:blue\noperator:green\n").unwrap();
    let endpoint = free_endpoint();
    let file = configuration(folder.path(), &endpoint, include_str!("../../../configs/zenoh/password.json5"), "daemon");
    let server = start(file);
    let connect = |user: &str, password: &str| {
        connect(folder.path(), &endpoint, &json!({ "auth": { "usrpwd": { "user": user, "password": password } } }))
    };
    let (front_end, operator) = (connect("front-end", "blue").unwrap(), connect("operator", "green").unwrap());
    assert!(front_end.status().is_ok() && denied(front_end.rpc("pause", &json!({})).unwrap_err()));
    assert!(operator.rpc("pause", &json!({})).is_ok());
    for (user, password) in [("operator", "blue"), ("tracker", "blue"), ("", "")] {
        assert!(connect(user, password).is_err(), "{user} with {password}");
    }
    server.stop();
}

fn denied(error: ClientError) -> bool {
    matches!(error, ClientError::NoAnswer { .. } | ClientError::TimedOut { .. })
}

fn free_endpoint() -> String {
    format!("tls/127.0.0.1:{}", std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port())
}

/// A daemon with certificates for everybody that shows the certificate of `identity`.
fn serve(folder: &Path, endpoint: &str, identity: &str) -> Server {
    start(configuration(folder, endpoint, include_str!("../../../configs/zenoh/mtls.json5"), identity))
}

fn start(zenoh_config: PathBuf) -> Server {
    let options = BusOptions { zenoh_config: Some(zenoh_config), ..BusOptions::default() };
    let config = Config::parse(Path::new("block.toml"), SCENE).unwrap();
    Server::start(&config, &options, false).unwrap()
}

/// A shipped file with this folder's certificates and passwords, and a free port.
fn configuration(folder: &Path, endpoint: &str, shipped: &str, identity: &str) -> PathBuf {
    let mut text = shipped.replace("tls/127.0.0.1:7447\"]", &format!("{endpoint}\"]"));
    text = text.replace("\"daemon.", &format!("\"{identity}."));
    for file in ["ca.pem", &format!("{identity}.pem"), &format!("{identity}.key"), "passwords.txt"] {
        text = text.replace(&format!("\"{file}\""), &format!("\"{}\"", folder.join(file).display()));
    }
    let path = folder.join("daemon.json5");
    std::fs::write(&path, text).unwrap();
    path
}

/// Transport of a client that shows a certificate.
fn with_certificate(folder: &Path, name: &str) -> Value {
    let file = |ending: &str| folder.join(format!("{name}.{ending}")).display().to_string();
    json!({ "link": { "tls": {
        "enable_mtls": true, "connect_certificate": file("pem"), "connect_private_key": file("key"),
    } } })
}

fn connect(folder: &Path, endpoint: &str, transport: &Value) -> Result<Client, ClientError> {
    let file = client_configuration(folder, endpoint, transport);
    let timeout = Duration::from_secs(3);
    Client::connect(&ClientOptions { config_file: Some(file), timeout, ..ClientOptions::default() })
}

fn client_configuration(folder: &Path, endpoint: &str, transport: &Value) -> PathBuf {
    let mut config = json!({
        "mode": "client",
        "connect": { "endpoints": [endpoint], "timeout_ms": 3000 },
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "transport": {
            "auth": transport.get("auth").cloned().unwrap_or_else(|| json!({})),
            "unicast": { "open_timeout": 3000 },
            "link": { "protocols": ["tls"], "tls": transport.pointer("/link/tls").cloned().unwrap_or_else(|| json!({})) },
        },
    });
    config["transport"]["link"]["tls"]["root_ca_certificate"] = json!(folder.join("ca.pem").display().to_string());
    let path = folder.join("client.json5");
    std::fs::write(&path, config.to_string()).unwrap();
    path
}

/// The authority, the daemon and its clients as `deploy/certificates` makes them, and a stranger of another authority; false without openssl.
fn make_certificates(folder: &Path) -> bool {
    if Command::new("openssl").arg("version").stdout(Stdio::null()).status().is_err() {
        return false;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy/certificates");
    let make = |folder: &Path, arguments: &[&str]| {
        let made = Command::new(&script).arg(folder).args(arguments).output().unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    };
    make(folder, &["daemon", "localhost", "127.0.0.1"]);
    make(folder, &["client", "tracker", "front-end", "operator"]);
    let elsewhere = tempfile::tempdir().unwrap();
    make(elsewhere.path(), &["client", "stranger"]);
    for ending in ["pem", "key"] {
        let name = format!("stranger.{ending}");
        std::fs::copy(elsewhere.path().join(&name), folder.join(&name)).unwrap();
    }
    true
}
