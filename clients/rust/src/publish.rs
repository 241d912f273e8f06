//! Publishing of poses.

use std::hash::{BuildHasher, RandomState};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use plica_protocol::pose::Pose;
use plica_protocol::{ENCODING_BYTES, ENCODING_JSON};
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

use crate::error::ClientError;

/// Publishes the poses of one tool.
pub struct PosePublisher {
    publisher: Publisher<'static>,
}

impl PosePublisher {
    pub(crate) fn declare(session: &Session, key: String, lossless: bool) -> Result<Self, ClientError> {
        let congestion = if lossless { CongestionControl::Block } else { CongestionControl::Drop };
        let publisher = session
            .declare_publisher(key)
            .congestion_control(congestion)
            .priority(Priority::RealTime)
            .express(true)
            .wait()
            .map_err(ClientError::bus)?;
        Ok(Self { publisher })
    }

    /// Sends a pose in its binary form.
    pub fn publish(&self, pose: &Pose) -> Result<(), ClientError> {
        self.publish_bytes(pose.encode().to_vec(), false)
    }

    /// Sends bytes unchecked, with the encoding of JSON or of binary poses.
    pub fn publish_bytes(&self, bytes: Vec<u8>, json: bool) -> Result<(), ClientError> {
        let encoding = Encoding::from(if json { ENCODING_JSON } else { ENCODING_BYTES });
        self.publisher.put(bytes).encoding(encoding).wait().map_err(ClientError::bus)
    }
}

/// Clock in nanoseconds since 1970 without steps: wall clock at the start, monotonic clock from then on.
#[derive(Debug, Clone, Copy)]
pub struct SourceClock {
    start: Instant,
    start_unix_ns: u64,
}

impl SourceClock {
    /// Starts a clock.
    pub fn new() -> Self {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { start: Instant::now(), start_unix_ns: since_1970.as_nanos() as u64 }
    }

    /// Present time in nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.at_ns(Instant::now())
    }

    /// An instant on this clock, in nanoseconds.
    pub fn at_ns(&self, instant: Instant) -> u64 {
        self.start_unix_ns + instant.saturating_duration_since(self.start).as_nanos() as u64
    }
}

impl Default for SourceClock {
    fn default() -> Self {
        Self::new()
    }
}

/// Numbers and times the poses of one publisher: a random `source_id`, sequences from 1 on, the time of the call.
#[derive(Debug, Clone)]
pub struct PoseSource {
    /// Random id of this source.
    pub source_id: u32,
    clock: SourceClock,
    sequence: u64,
}

impl PoseSource {
    /// A new source.
    pub fn new() -> Self {
        // The standard library seeds each hasher at random.
        let source_id = RandomState::new().hash_one(0_u8) as u32;
        Self { source_id, clock: SourceClock::new(), sequence: 0 }
    }

    /// The next pose. `position_m` in metres, `orientation_xyzw` a unit quaternion.
    pub fn pose(&mut self, position_m: [f64; 3], orientation_xyzw: [f64; 4]) -> Pose {
        self.sequence += 1;
        let (sequence, source_time_ns, source_id) = (self.sequence, self.clock.now_ns(), self.source_id);
        Pose { sequence, source_time_ns, source_id, position_m, orientation_xyzw, ..Pose::default() }
    }

    /// Clock of the source times.
    pub fn clock(&self) -> SourceClock {
        self.clock
    }
}

impl Default for PoseSource {
    fn default() -> Self {
        Self::new()
    }
}
