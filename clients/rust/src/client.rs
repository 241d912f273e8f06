//! Connection to a daemon.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Duration;

use plica_protocol::keys::{Keys, check_name};
use plica_protocol::pose::Pose;
use zenoh::{Session, Wait};

use crate::error::ClientError;
use crate::options::ClientOptions;
use crate::publish::PosePublisher;
use crate::reach::cause;

/// Longest wait for Zenoh's close, which can hang for 10 s.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// A connection to one daemon. Closed when dropped, within two seconds.
pub struct Client {
    pub(crate) session: Session,
    pub(crate) keys: Keys,
    pub(crate) place: String,
    pub(crate) timeout: Duration,
    publishers: Mutex<HashMap<String, PosePublisher>>,
}

impl std::fmt::Debug for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Client").field("place", &self.place).field("root", &self.keys.root()).finish_non_exhaustive()
    }
}

impl Client {
    /// Connects, or fails at once: it does not wait for a daemon to start.
    ///
    /// A connection does not prove that a daemon with this session listens: [`Client::status`] does.
    pub fn connect(options: &ClientOptions) -> Result<Self, ClientError> {
        let keys = Keys::new(&options.session)?;
        let config = options.zenoh_config()?;
        let session = zenoh::open(config.clone())
            .wait()
            .map_err(|error| ClientError::Connect { problem: cause(options, &config), detail: error.to_string() })?;
        let publishers = Mutex::new(HashMap::new());
        Ok(Self { session, keys, place: options.place(), timeout: options.timeout, publishers })
    }

    /// Keys of this session.
    pub fn keys(&self) -> &Keys {
        &self.keys
    }

    /// Endpoint or configuration file, for messages.
    pub fn place(&self) -> &str {
        &self.place
    }

    /// Publishes one pose. For a stream, [`Client::pose_publisher`] saves the look-up.
    pub fn publish_pose(&self, tool: &str, pose: &Pose) -> Result<(), ClientError> {
        let mut publishers = self.publishers.lock().unwrap_or_else(PoisonError::into_inner);
        if !publishers.contains_key(tool) {
            publishers.insert(tool.to_owned(), self.pose_publisher(tool)?);
        }
        publishers[tool].publish(pose)
    }

    /// Publisher of poses of one tool: real-time priority, sent at once, dropped instead of waiting.
    pub fn pose_publisher(&self, tool: &str) -> Result<PosePublisher, ClientError> {
        check_name(tool)?;
        PosePublisher::declare(&self.session, self.keys.pose(tool), false)
    }

    /// Publisher that waits for room on the bus instead of dropping, for replays.
    pub fn lossless_pose_publisher(&self, tool: &str) -> Result<PosePublisher, ClientError> {
        check_name(tool)?;
        PosePublisher::declare(&self.session, self.keys.pose(tool), true)
    }

    /// Closes the connection, as a drop does; waits at most two seconds.
    pub fn close(self) {}
}

impl Drop for Client {
    fn drop(&mut self) {
        self.publishers.lock().unwrap_or_else(PoisonError::into_inner).clear();
        close_within(self.session.clone(), CLOSE_TIMEOUT);
    }
}

/// Closes on a thread of its own, which is abandoned after `timeout`.
fn close_within(session: Session, timeout: Duration) {
    let (done, closed) = mpsc::channel();
    let closing = thread::Builder::new().name("plica-close".to_owned()).spawn(move || {
        // An error means that the link is closed already.
        let _ = session.close().wait();
        let _ = done.send(());
    });
    if closing.is_ok() {
        let _ = closed.recv_timeout(timeout);
    }
}
