//! Shared by the threads of the bus: session, keys, model, pose intake, counters, jobs.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Instant;

use plica_jobs::Jobs;
use plica_protocol::keys::Keys;
use plica_protocol::rpc::{ErrorCode, ErrorReply};
use plica_sim::Model;
use zenoh::Session;

use super::counters::SharedCounters;
use super::error::BusError;
use super::intake::PoseIntake;
use super::scene_info::SceneInfo;
use crate::database_loader::Enrichment;

/// Shared by the threads of the bus.
pub(super) struct Shared {
    pub(super) session: Session,
    pub(super) keys: Keys,
    pub(super) scene: SceneInfo,
    pub(super) model: Arc<Model>,
    pub(super) enrichment: Enrichment,
    pub(super) intake: Arc<PoseIntake>,
    pub(super) counters: Arc<SharedCounters>,
    pub(super) jobs: Jobs,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) started: Instant,
}

impl Shared {
    pub(super) fn stopping(&self) -> bool {
        self.stop.load(Relaxed)
    }

    pub(super) fn error(&self, problem: zenoh::Error) -> BusError {
        tracing::debug!("Zenoh: {problem}");
        BusError::Declare { root: self.keys.root().to_owned() }
    }

    /// The error of a query for an object that the scene does not have. A wildcard asks for the one it has.
    pub(super) fn unknown_object(&self, key: &str) -> Option<ErrorReply> {
        let named = self.keys.object_of_skin(key).or(self.keys.object_of_mesh(key));
        named.filter(|name| *name != self.scene.object).map(|name| {
            let message = format!("the scene has no object `{name}`; it has: {}", self.scene.object);
            ErrorReply::new(ErrorCode::UnknownObject, message)
        })
    }
}

/// Starts a named thread.
pub(super) fn spawn(name: &str, body: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, BusError> {
    Ok(std::thread::Builder::new().name(name.into()).spawn(body)?)
}
