//! Publishes wrenches, with priority over frames, on a thread of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

use plica_protocol::ENCODING_BYTES;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::matching::MatchingStatus;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};

use super::error::BusError;
use super::guard::guarded;
use super::shared::{Shared, spawn};
use crate::realtime::WrenchPort;
use crate::wire;

const IDLE: Duration = Duration::from_millis(100);

/// One tool's stream.
struct Stream {
    port: WrenchPort,
    publisher: Publisher<'static>,
    sequence: u64,
}

pub(super) fn start(shared: &Arc<Shared>, ports: Vec<WrenchPort>) -> Result<JoinHandle<()>, BusError> {
    let streams = ports.into_iter().zip(&shared.scene.tools).map(|(port, tool)| declare(shared, port, &tool.name));
    let streams: Vec<_> = streams.collect::<Result<_, _>>()?;
    let shared = Arc::clone(shared);
    spawn("plica-wrench", move || run(&shared, streams))
}

fn declare(shared: &Arc<Shared>, port: WrenchPort, tool: &str) -> Result<Stream, BusError> {
    let publisher = shared
        .session
        .declare_publisher(shared.keys.wrench(tool))
        .congestion_control(CongestionControl::Drop)
        .priority(Priority::RealTime)
        .express(true)
        .encoding(Encoding::from(ENCODING_BYTES))
        .wait()
        .map_err(|e| shared.error(e))?;
    follow_listeners(shared, &publisher, &port.listening)?;
    Ok(Stream { port, publisher, sequence: 0 })
}

/// Keeps `listening` true while the publisher has a subscriber.
pub(super) fn follow_listeners(
    shared: &Arc<Shared>,
    publisher: &Publisher<'static>,
    listening: &Arc<AtomicBool>,
) -> Result<(), BusError> {
    let flag = Arc::clone(listening);
    let callback = guarded(&shared.counters, move |status: MatchingStatus| flag.store(status.matching(), Relaxed));
    publisher.matching_listener().callback(callback).background().wait().map_err(|e| shared.error(e))?;
    let now = publisher.matching_status().wait().map_err(|e| shared.error(e))?;
    if now.matching() {
        listening.store(true, Relaxed);
    }
    Ok(())
}

fn run(shared: &Shared, mut streams: Vec<Stream>) {
    if let Some(stream) = streams.first() {
        stream.port.published.register_current();
    }
    while !shared.stopping() {
        for stream in &mut streams {
            stream.send_all();
        }
        std::thread::park_timeout(IDLE);
    }
}

impl Stream {
    fn send_all(&mut self) {
        // Only the wrenches present now, so that a busy tool does not delay the others.
        for _ in 0..self.port.wrenches.slots() {
            let Ok(frame) = self.port.wrenches.pop() else { return };
            self.sequence += 1;
            let bytes = wire::wrench(&frame, self.sequence).encode().to_vec();
            // Dropped where it does not fit into the queue at once; an error means that the session is closing.
            let _ = self.publisher.put(bytes).wait();
        }
    }
}
