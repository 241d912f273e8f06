//! The bus: all code that uses Zenoh. Queues and triple buffers separate it from the simulation thread.
//!
//! Callbacks run on Zenoh's receiving threads: they decode, store and return, and panics are caught. Streams are
//! published and queries answered by threads of their own, so that a frozen client can block a reply but no tick.

mod activate;
mod counters;
mod error;
mod guard;
mod hearing;
mod intake;
mod jobs;
mod mesh;
mod port_owner;
mod pose_gate;
mod poses;
mod replies;
mod requests;
mod rpc;
mod scene_info;
mod session;
mod shared;
mod skin;
mod status;
mod wrench;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};

use plica_jobs::Jobs;
use plica_protocol::keys::Keys;
use plica_sim::Model;
use zenoh::{Session, Wait};

use crate::database_loader::Enrichment;
use crate::realtime::{Grants, Ports, Statistics};

use counters::SharedCounters;
pub use error::BusError;
pub use hearing::Deaf;
use hearing::{Hearing, Judge};
use intake::PoseIntake;
use port_owner::peers_of_port;
pub use port_owner::{Peer, Process};
pub use scene_info::{SceneInfo, ToolInfo};
pub use session::{BusOptions, DEFAULT_ZENOH_CONFIG};
use shared::Shared;

/// Longest wait for `Session::close`, which can hang for ten seconds when a client is frozen.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// Parts of a bus.
pub struct Parts {
    /// From [`Bus::open`].
    pub session: Session,
    /// TCP ports that the session listens on.
    pub ports_of_bus: Vec<u16>,
    /// Keys of the session.
    pub keys: Keys,
    /// Names, rates and formats of the scene.
    pub scene: SceneInfo,
    /// The scene's model.
    pub model: Arc<Model>,
    /// Loader of databases.
    pub enrichment: Enrichment,
    /// Far ends of the simulation thread's queues.
    pub ports: Ports,
    /// Privileges granted to the simulation thread.
    pub grants: Grants,
    /// Jobs, or the reason why there are none.
    pub jobs: Jobs,
}

/// An open bus with all its publishers, subscribers and answering threads.
pub struct Bus {
    session: Session,
    ports: Vec<u16>,
    statistics: Arc<Statistics>,
    hearing: Arc<Hearing>,
    judge: Judge,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    wake: Vec<Thread>,
    // Undeclared when dropped, before the session closes.
    _declared: Declared,
}

/// Declarations that receive from Zenoh, undeclared with the bus.
struct Declared {
    _poses: zenoh::pubsub::Subscriber<()>,
    _queryables: Vec<zenoh::query::Queryable<()>>,
    _alive: zenoh::liveliness::LivelinessToken,
}

impl Bus {
    /// Opens the session. Separate from [`Bus::start`] so that a taken port is known before anything else is built.
    pub fn open(options: &BusOptions) -> Result<Session, BusError> {
        session::open(options)
    }

    /// TCP ports that a session with these options listens on.
    pub fn ports(options: &BusOptions) -> Vec<u16> {
        session::ports(options)
    }

    /// Far ends of the connections to this session's ports.
    pub fn peers(&self) -> Vec<Peer> {
        self.ports.iter().flat_map(|port| peers_of_port(*port)).collect()
    }

    /// Turns of the simulation so far.
    pub fn turns(&self) -> u64 {
        self.statistics.turns.load(Relaxed)
    }

    /// Declares every key and starts the threads.
    pub fn start(parts: Parts) -> Result<Self, BusError> {
        let Parts { session, ports_of_bus, keys, scene, model, enrichment, ports, grants, jobs } = parts;
        let Ports { poses, commands, frames, wrenches, readings, statistics } = ports;
        let counters = Arc::new(SharedCounters::default());
        let intake = Arc::new(PoseIntake::new(&scene, poses, Arc::clone(&statistics)));
        let stop = Arc::new(AtomicBool::new(false));
        let shared = Arc::new(Shared {
            session: session.clone(),
            keys,
            scene,
            model,
            enrichment,
            intake,
            counters,
            jobs,
            stop: Arc::clone(&stop),
            started: Instant::now(),
        });
        let (replies, reply_thread) = replies::start(&shared)?;
        let published = Arc::new(skin::Published::default());
        let (skin_queries, skin_thread) = skin::start(&shared, frames, Arc::clone(&published), replies.clone())?;
        let wrench_thread = wrench::start(&shared, wrenches)?;
        let sources = status::Sources { readings, statistics: Arc::clone(&statistics), grants, published };
        let (status_queries, status_thread) = status::start(&shared, sources, replies.clone())?;
        let (job_requests, job_thread) = jobs::start(&shared, replies.clone())?;
        let (rpc_queries, rpc_threads) = rpc::start(&shared, commands, replies.clone(), job_requests)?;
        let (hearing, hearing_thread) = hearing::start(&shared)?;
        let mesh_queries = mesh::declare(&shared, replies)?;
        let declared = Declared {
            _poses: poses::declare(&shared)?,
            _queryables: vec![skin_queries, status_queries, rpc_queries, mesh_queries],
            _alive: alive(&shared)?,
        };
        let mut threads = vec![reply_thread, skin_thread, wrench_thread, status_thread, job_thread, hearing_thread];
        threads.extend(rpc_threads);
        let wake = threads.iter().map(|t| t.thread().clone()).collect();
        Ok(Self {
            session,
            ports: ports_of_bus,
            statistics,
            hearing,
            judge: Judge::default(),
            stop,
            threads,
            wake,
            _declared: declared,
        })
    }

    /// Judges whether the bus still answers; call it several times a second.
    ///
    /// # Errors
    /// No own query was answered for almost two seconds while the simulation ran. The bus will not recover: leave it with
    /// [`Bus::abandon`].
    pub fn listen(&mut self) -> Result<(), Deaf> {
        let turns = self.statistics.turns.load(Relaxed);
        self.judge.look(self.hearing.now_ms(), self.hearing.answered_ms(), turns)
    }

    /// Leaves a deaf bus as it is: taking it down would panic.
    pub fn abandon(self) {
        self.stop.store(true, Relaxed);
        std::mem::forget(self);
    }

    /// Stops the threads and closes the session, in two seconds at most.
    pub fn close(self) {
        if self.hearing.last_failed() {
            return self.abandon();
        }
        let deadline = Instant::now() + CLOSE_TIMEOUT;
        self.stop.store(true, Relaxed);
        self.wake.iter().for_each(Thread::unpark);
        let Self { session, threads, _declared, .. } = self;
        let (done, closed) = std::sync::mpsc::channel();
        let closing = std::thread::Builder::new().name("plica-close".into()).spawn(move || {
            drop(_declared);
            for thread in threads {
                let _ = thread.join();
            }
            // An error here means that the links are gone already.
            let _ = session.close().wait();
            let _ = done.send(());
        });
        let left = deadline.saturating_duration_since(Instant::now());
        if closing.is_ok() && closed.recv_timeout(left).is_err() {
            tracing::warn!("the bus did not close within {} s (a frozen client?); leaving it", CLOSE_TIMEOUT.as_secs());
        }
    }
}

fn alive(shared: &Shared) -> Result<zenoh::liveliness::LivelinessToken, BusError> {
    shared.session.liveliness().declare_token(shared.keys.alive()).wait().map_err(|e| shared.error(e))
}
