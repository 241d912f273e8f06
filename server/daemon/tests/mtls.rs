//! The shipped configuration for networks: each client may do what its certificate's name allows, and nobody else may connect.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use plica_client::protocol::pose::Pose;
use plica_client::{Client, ClientError, ClientOptions};
use plica_daemon::bus::BusOptions;
use plica_daemon::server::Server;
use plica_scene::Config;
use serde_json::json;

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
    let options = BusOptions { zenoh_config: Some(daemon_config(folder.path(), &endpoint)), ..BusOptions::default() };
    let config = Config::parse(Path::new("block.toml"), SCENE).unwrap();
    let server = Server::start(&config, &options, false).unwrap();
    let connect = |name: &str| connect(folder.path(), &endpoint, name);
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
    server.stop();
}

fn denied(error: ClientError) -> bool {
    matches!(error, ClientError::NoAnswer { .. } | ClientError::TimedOut { .. })
}

fn free_endpoint() -> String {
    format!("tls/127.0.0.1:{}", std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port())
}

/// The shipped file with this folder's certificates and a free port.
fn daemon_config(folder: &Path, endpoint: &str) -> PathBuf {
    let shipped = include_str!("../../../configs/zenoh/mtls.json5");
    let mut text = shipped.replace("tls/127.0.0.1:7447\"]", &format!("{endpoint}\"]"));
    for file in ["ca.pem", "daemon.pem", "daemon.key"] {
        text = text.replace(&format!("\"{file}\""), &format!("\"{}\"", folder.join(file).display()));
    }
    let path = folder.join("daemon.json5");
    std::fs::write(&path, text).unwrap();
    path
}

fn connect(folder: &Path, endpoint: &str, name: &str) -> Result<Client, ClientError> {
    let file = |ending: &str| folder.join(format!("{name}.{ending}")).display().to_string();
    let ca = folder.join("ca.pem").display().to_string();
    let config = json!({
        "mode": "client",
        "connect": { "endpoints": [endpoint], "timeout_ms": 3000 },
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "transport": {
            "unicast": { "open_timeout": 3000 },
            "link": { "protocols": ["tls"], "tls": {
                "root_ca_certificate": ca, "enable_mtls": true,
                "connect_certificate": file("pem"), "connect_private_key": file("key"),
            } },
        },
    });
    let path = folder.join(format!("{name}.json5"));
    std::fs::write(&path, config.to_string()).unwrap();
    let timeout = Duration::from_secs(3);
    Client::connect(&ClientOptions { config_file: Some(path), timeout, ..ClientOptions::default() })
}

/// Two authorities, the daemon and its clients under the first, a stranger under the second; false without openssl.
fn make_certificates(folder: &Path) -> bool {
    let openssl = |arguments: &str| {
        let mut command = Command::new("openssl");
        command.args(arguments.split(' ')).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    std::fs::write(folder.join("names"), "subjectAltName=DNS:localhost,IP:127.0.0.1").unwrap();
    let key = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes";
    let authority =
        |name: &str| openssl(&format!("req -x509 {key} -days 2 -subj /CN={name} -keyout {name}.key -out {name}.pem"));
    let signed = |name: &str, by: &str| {
        openssl(&format!("req {key} -subj /CN={name} -keyout {name}.key -out {name}.csr"))
            && openssl(&format!(
                "x509 -req -in {name}.csr -CA {by}.pem -CAkey {by}.key -CAcreateserial -days 2 -out {name}.pem -extfile names"
            ))
    };
    authority("ca")
        && authority("other-ca")
        && ["daemon", "tracker", "front-end", "operator"].iter().all(|name| signed(name, "ca"))
        && signed("stranger", "other-ca")
}
