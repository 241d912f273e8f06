//! Subscriptions. Callbacks decode, store and return. A panic in a callback would end the link, so panics are caught.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use plica_protocol::encoding::is_json;
use plica_protocol::keys::check_name;
use plica_protocol::skin::{SkinFrame, SkinHeader};
use plica_protocol::wrench::Wrench;
use plica_protocol::{DecodeError, ENCODING_BYTES};
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use crate::client::Client;
use crate::error::ClientError;
use crate::queue::{Overflow, Queue, StreamStats};

/// A received skin frame.
#[derive(Debug, Clone)]
pub struct SkinMessage {
    /// Its header.
    pub header: SkinHeader,
    /// The whole message.
    pub bytes: Vec<u8>,
    /// Time of arrival.
    pub received: Instant,
}

impl SkinMessage {
    /// View of the frame in the checked bytes.
    pub fn frame(&self) -> Result<SkinFrame<'_>, DecodeError> {
        SkinFrame::decode(&self.bytes)
    }

    pub(crate) fn decode(bytes: Vec<u8>) -> Result<Self, DecodeError> {
        let header = SkinFrame::decode(&bytes)?.header;
        Ok(Self { header, bytes, received: Instant::now() })
    }
}

/// A received wrench.
#[derive(Debug, Clone, Copy)]
pub struct WrenchMessage {
    /// The wrench.
    pub wrench: Wrench,
    /// Time of arrival.
    pub received: Instant,
}

/// A received message, not decoded.
#[derive(Debug, Clone)]
pub struct RawMessage {
    /// Key of the message.
    pub key: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Whether its encoding is JSON.
    pub json: bool,
    /// Time of arrival.
    pub received: Instant,
}

/// Subscription with a queue of received messages. Ends on drop.
pub struct Subscription<T> {
    queue: Arc<Queue<T>>,
    _subscribers: Vec<Subscriber<()>>,
}

impl<T> Subscription<T> {
    /// The next message, waiting at most `timeout`.
    pub fn next(&self, timeout: Duration) -> Option<T> {
        self.queue.pop(timeout)
    }

    /// The next message if it is there.
    pub fn try_next(&self) -> Option<T> {
        self.queue.pop(Duration::ZERO)
    }

    /// Counters since the start.
    pub fn stats(&self) -> StreamStats {
        self.queue.stats()
    }
}

impl Client {
    /// Frames of an object; a slow reader gets only the newest.
    pub fn subscribe_skin(&self, object: &str) -> Result<Subscription<SkinMessage>, ClientError> {
        check_name(object)?;
        self.subscribe(&[self.keys.skin(object)], Queue::new(1, Overflow::DropOldest), |sample| {
            let message = SkinMessage::decode(sample.payload().to_bytes().into_owned())?;
            let sequence = message.header.sequence;
            Ok((message, Some(sequence)))
        })
    }

    /// Wrenches of a tool, at most `capacity` waiting; more are dropped and counted.
    pub fn subscribe_wrenches(&self, tool: &str, capacity: usize) -> Result<Subscription<WrenchMessage>, ClientError> {
        check_name(tool)?;
        self.subscribe(&[self.keys.wrench(tool)], Queue::new(capacity, Overflow::DropNewest), |sample| {
            let wrench = Wrench::decode(&sample.payload().to_bytes())?;
            Ok((WrenchMessage { wrench, received: Instant::now() }, Some(wrench.sequence)))
        })
    }

    /// All messages on some key expressions, in order of arrival, at most `capacity` waiting.
    pub fn subscribe_raw(
        &self,
        key_expressions: &[String],
        capacity: usize,
    ) -> Result<Subscription<RawMessage>, ClientError> {
        let binary = Encoding::from(ENCODING_BYTES);
        self.subscribe(key_expressions, Queue::new(capacity, Overflow::DropNewest), move |sample| {
            let message = RawMessage {
                key: sample.key_expr().as_str().to_owned(),
                bytes: sample.payload().to_bytes().into_owned(),
                json: *sample.encoding() != binary && is_json(&sample.encoding().to_string()),
                received: Instant::now(),
            };
            Ok((message, None))
        })
    }

    /// JSON messages of one key, at most `capacity` waiting.
    pub(crate) fn subscribe_json<T: Send + 'static>(
        &self,
        key: &str,
        capacity: usize,
        read: fn(&[u8]) -> Result<T, DecodeError>,
    ) -> Result<Subscription<T>, ClientError> {
        self.subscribe(&[key.to_owned()], Queue::new(capacity, Overflow::DropOldest), move |sample| {
            Ok((read(&sample.payload().to_bytes())?, None))
        })
    }

    fn subscribe<T: Send + 'static>(
        &self,
        key_expressions: &[String],
        queue: Queue<T>,
        decode: impl Fn(&Sample) -> Result<(T, Option<u64>), DecodeError> + Clone + Send + Sync + 'static,
    ) -> Result<Subscription<T>, ClientError> {
        let queue = Arc::new(queue);
        let mut subscribers = Vec::new();
        for key in key_expressions {
            let (queue, decode) = (Arc::clone(&queue), decode.clone());
            let store = move |sample: Sample| match decode(&sample) {
                Ok((message, sequence)) => queue.push(message, sequence),
                Err(_) => queue.count_malformed(),
            };
            let subscriber = self.session.declare_subscriber(key.clone()).callback(guarded(store));
            subscribers.push(subscriber.wait().map_err(ClientError::bus)?);
        }
        Ok(Subscription { queue, _subscribers: subscribers })
    }
}

/// Catches panics, which would end Zenoh's receiving thread.
fn guarded<T>(callback: impl Fn(T) + Send + Sync + 'static) -> impl Fn(T) + Send + Sync + 'static {
    move |value| {
        let _ = catch_unwind(AssertUnwindSafe(|| callback(value)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_stays_inside_the_callback() {
        let callback = guarded(|divisor: u32| assert!(divisor != 0, "on purpose"));
        callback(0);
        callback(1);
    }
}
