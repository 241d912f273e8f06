//! The connection.

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

/// Zenoh's own close can hang for 10 s.
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
    /// Connects, or says why not at once (it does not wait for a daemon to appear).
    ///
    /// That somebody listens does not mean that it is a daemon with this session: [`Client::status`] tells.
    pub fn connect(options: &ClientOptions) -> Result<Self, ClientError> {
        let keys = Keys::new(&options.session)?;
        let config = options.zenoh_config()?;
        let session = zenoh::open(config)
            .wait()
            .map_err(|error| ClientError::Connect { place: options.place(), message: error.to_string() })?;
        let publishers = Mutex::new(HashMap::new());
        Ok(Self { session, keys, place: options.place(), timeout: options.timeout, publishers })
    }

    /// The keys of this session.
    pub fn keys(&self) -> &Keys {
        &self.keys
    }

    /// Where this client is connected, for messages.
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

    /// A publisher of poses of one tool: real-time priority, sent at once, dropped rather than waiting.
    pub fn pose_publisher(&self, tool: &str) -> Result<PosePublisher, ClientError> {
        check_name(tool)?;
        PosePublisher::declare(&self.session, self.keys.pose(tool), false)
    }

    /// The same, but it waits for room on the bus instead of dropping, for replays.
    pub fn lossless_pose_publisher(&self, tool: &str) -> Result<PosePublisher, ClientError> {
        check_name(tool)?;
        PosePublisher::declare(&self.session, self.keys.pose(tool), true)
    }

    /// Closes the connection; gives up waiting after two seconds. The same as dropping the client.
    pub fn close(self) {}
}

impl Drop for Client {
    fn drop(&mut self) {
        self.publishers.lock().unwrap_or_else(PoisonError::into_inner).clear();
        close_within(self.session.clone(), CLOSE_TIMEOUT);
    }
}

/// Closes on a helper thread, which is left behind if it takes longer than `timeout`.
fn close_within(session: Session, timeout: Duration) {
    let (done, closed) = mpsc::channel();
    let closing = thread::Builder::new().name("plica-close".to_owned()).spawn(move || {
        // An error here means that the link is gone already.
        let _ = session.close().wait();
        let _ = done.send(());
    });
    if closing.is_ok() {
        let _ = closed.recv_timeout(timeout);
    }
}
