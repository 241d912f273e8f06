//! A small daemon made of nothing but Zenoh and the protocol.
#![allow(dead_code, reason = "not every test uses all of it")]
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

pub(crate) mod jobs;

use std::net::TcpListener;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex};

use plica_client::protocol::chunk::{CHUNK_BYTES, ChunkHeader, offset_of, piece};
use plica_client::protocol::keys::Keys;
use plica_client::protocol::pose::Pose;
use plica_client::protocol::rpc::{
    ActivateRequest, ErrorCode, ErrorReply, Method, StepReply, StepRequest, decode_request,
};
use plica_client::protocol::skin::{self, SkinHeader};
use plica_client::protocol::status::{ObjectStatus, Status, ToolStatus};
use plica_client::protocol::wrench::Wrench;
use plica_client::{Client, ClientOptions};
use serde_json::json;
use sha2::{Digest, Sha256};
use zenoh::qos::CongestionControl;
use zenoh::query::Query;
use zenoh::{Config, Session, Wait};

/// Answers a wrench to each pose, serves a mesh, a status and methods.
pub(crate) struct SmallDaemon {
    pub(crate) session: Session,
    pub(crate) endpoint: String,
    /// Whether another source seems to move each tool: poses are rejected, and counted in the status.
    pub(crate) conflicts: Arc<AtomicBool>,
    /// Positions received.
    pub(crate) positions_m: Arc<Mutex<Vec<[f64; 3]>>>,
}

impl SmallDaemon {
    pub(crate) fn start() -> Self {
        let daemon = Self::silent();
        daemon.serve();
        daemon
    }

    /// Listens, and serves nothing.
    pub(crate) fn silent() -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let mut config = Config::default();
        for (key, value) in [
            ("mode", "\"peer\"".to_owned()),
            ("listen/endpoints", format!("[\"{endpoint}\"]")),
            ("scouting/multicast/enabled", "false".to_owned()),
            ("scouting/gossip/enabled", "false".to_owned()),
        ] {
            config.insert_json5(key, &value).unwrap();
        }
        let session = zenoh::open(config).wait().unwrap();
        Self { session, endpoint, conflicts: Arc::default(), positions_m: Arc::default() }
    }

    fn serve(&self) {
        let keys = Keys::new("main").unwrap();
        let (session, echo_keys) = (self.session.clone(), keys.clone());
        let (conflicts, positions_m) = (Arc::clone(&self.conflicts), Arc::clone(&self.positions_m));
        let n_rejected = Arc::new(AtomicU64::new(0));
        let in_status = Arc::clone(&n_rejected);
        let echo = self.session.declare_subscriber(keys.pose("*")).callback(move |sample| {
            let tool = echo_keys.tool_of_pose(sample.key_expr().as_str()).unwrap().to_owned();
            let pose = Pose::decode(&sample.payload().to_bytes()).unwrap();
            positions_m.lock().unwrap().push(pose.position_m);
            if conflicts.load(Relaxed) {
                n_rejected.fetch_add(1, Relaxed);
                return;
            }
            let wrench = Wrench {
                sequence: pose.sequence,
                pose_sequence: pose.sequence,
                pose_source_time_ns: pose.source_time_ns,
                force_n: pose.position_m,
                ..Wrench::default()
            };
            put(&session, &echo_keys.wrench(&tool), wrench.encode().to_vec());
        });
        echo.background().wait().unwrap();
        self.queryable(&keys.mesh("*"), serve_mesh);
        self.queryable(&keys.status(), move |query: Query| {
            let mut status = Status { scene: "small".to_owned(), ..Status::default() };
            status.objects.insert("wedge".to_owned(), ObjectStatus::default());
            let mut tool = ToolStatus::default();
            let n_rejected = in_status.load(Relaxed);
            if n_rejected > 0 {
                tool.poses_rejected.insert("conflict".to_owned(), n_rejected);
            }
            status.tools.insert("probe".to_owned(), tool);
            query.reply(query.key_expr().clone(), serde_json::to_vec(&status).unwrap()).wait().unwrap();
        });
        self.queryable(&keys.rpc("*"), serve_rpc);
        self.queryable(&keys.skin("wedge"), |query: Query| {
            query.reply(query.key_expr().clone(), frame(7)).wait().unwrap();
        });
    }

    pub(crate) fn put(&self, key: &str, bytes: Vec<u8>) {
        put(&self.session, key, bytes);
    }

    fn queryable(&self, key: &str, answer: impl Fn(Query) + Send + Sync + 'static) {
        self.session.declare_queryable(key.to_owned()).callback(answer).background().wait().unwrap();
    }

    pub(crate) fn client(&self) -> Client {
        Client::connect(&ClientOptions { endpoint: self.endpoint.clone(), ..ClientOptions::default() }).unwrap()
    }
}

/// Waits for room instead of dropping, so that a test may count what arrives.
fn put(session: &Session, key: &str, bytes: Vec<u8>) {
    session.put(key, bytes).congestion_control(CongestionControl::Block).wait().unwrap();
}

pub(crate) fn frame(sequence: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    let header = SkinHeader { sequence, ..SkinHeader::default() };
    skin::encode_f32_into(&mut bytes, &header, &[[1.0, 2.0, 3.0]; 4], None).unwrap();
    bytes
}

/// A plate of 40 x 20 mm, 10 mm high, as the smallest GLB; padded so that it needs three pieces.
pub(crate) fn mesh_bytes() -> Vec<u8> {
    let corners = [[0.0_f32, 0.0, 0.01], [0.04, 0.0, 0.01], [0.04, 0.02, 0.01], [0.0, 0.02, 0.0]];
    let mut binary: Vec<u8> = corners.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    binary.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    binary.resize(2 * CHUNK_BYTES + 1232, 7);
    let mut text = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": binary.len()}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                       "min": [0.0, 0.0, 0.0], "max": [0.04, 0.02, 0.01]},
                      {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    })
    .to_string();
    text.extend(std::iter::repeat_n(' ', text.len().next_multiple_of(4) - text.len()));
    let word = |n: usize| (n as u32).to_le_bytes();
    let total = 28 + text.len() + binary.len();
    [b"glTF".as_slice(), &word(2), &word(total), &word(text.len()), b"JSON", text.as_bytes()]
        .into_iter()
        .chain([word(binary.len()).as_slice(), b"BIN\0", &binary])
        .flatten()
        .copied()
        .collect()
}

fn serve_mesh(query: Query) {
    let whole = mesh_bytes();
    let offset = offset_of(query.parameters().as_str()).unwrap();
    let mut sha256: String = Sha256::digest(&whole).iter().map(|b| format!("{b:02x}")).collect();
    if query.key_expr().as_str().contains("/broken/") {
        sha256 = "0".repeat(64);
    }
    let header = ChunkHeader { total_bytes: whole.len() as u64, offset, sha256 };
    let reply = query.reply(query.key_expr().clone(), piece(&whole, offset).unwrap().to_vec());
    reply.attachment(header.to_json()).wait().unwrap();
}

fn serve_rpc(query: Query) {
    let name = query.key_expr().as_str().rsplit('/').next().unwrap().to_owned();
    let payload = query.payload().map(|bytes| bytes.to_bytes().into_owned()).unwrap_or_default();
    if name == "job_fetch" {
        return jobs::fetch(&query, &payload);
    }
    match answer_rpc(&name, &payload) {
        Ok(reply) => query.reply(query.key_expr().clone(), reply.to_string()).wait().unwrap(),
        Err(error) => query.reply_err(error.to_json()).wait().unwrap(),
    }
}

fn answer_rpc(name: &str, payload: &[u8]) -> Result<serde_json::Value, ErrorReply> {
    match Method::parse(name)? {
        Method::Step => {
            let request: StepRequest = decode_request(payload)?;
            let reply = StepReply { tick: u64::from(request.ticks), sim_time_s: request.poses.len() as f64 };
            Ok(serde_json::to_value(reply).unwrap())
        }
        Method::Activate => {
            let request: ActivateRequest = decode_request(payload)?;
            let n_examples = match request.job() {
                Some(id) => jobs::find(id).map(|_| 8)?,
                None if request.database == "none" => {
                    let message = "none: cannot be read: No such file or directory (os error 2)";
                    return Err(ErrorReply::new(ErrorCode::BadDatabase, message));
                }
                None => 9,
            };
            Ok(json!({"tick": 5, "database_generation": 2, "examples": n_examples}))
        }
        method if method.is_about_jobs() => jobs::answer(method, payload),
        _ => Ok(json!({"tick": 0, "sim_time_s": 0.0, "paused": true})),
    }
}
