//! Publishes skin frames at the scene's rate while a client listens, and answers queries for the newest one.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use plica_geometry::{DisplaySurface, vertex_normals_into};
use plica_protocol::rpc::{ErrorCode, ErrorReply};
use plica_protocol::status::FRAME_REFUSED;
use plica_protocol::{ENCODING_BYTES, skin};
use plica_scene::scene::PositionFormat;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{Query, Queryable};

use super::error::BusError;
use super::guard::guarded;
use super::replies::{Content, Replies};
use super::requests::refused;
use super::shared::{Shared, spawn};
use super::wrench::follow_listeners;
use crate::realtime::{Frame, FramePort};
use crate::wire;

/// Queries that may wait.
const QUEUE: usize = 16;
/// Longest wait of a query for a tick.
const PATIENCE: Duration = Duration::from_secs(1);
const IDLE: Duration = Duration::from_millis(100);
const WITH_QUESTIONS: Duration = Duration::from_millis(2);

/// Counters of published frames, for the status.
#[derive(Debug, Default)]
pub(super) struct Published {
    /// Frames handed to the bus.
    pub(super) frames: AtomicU64,
    /// Frames that were due and overwritten before this thread could publish them.
    pub(super) dropped: AtomicU64,
}

pub(super) fn start(
    shared: &Arc<Shared>,
    port: FramePort,
    published: Arc<Published>,
    replies: Replies,
) -> Result<(Queryable<()>, JoinHandle<()>), BusError> {
    let (questions_in, questions) = sync_channel(QUEUE);
    let waker = Arc::clone(&port.published);
    let busy = replies.clone();
    let callback = guarded(&shared.counters, move |query: Query| match questions_in.try_send(query) {
        Ok(()) => waker.wake(),
        Err(error) => {
            let query = refused(error);
            busy.send(query, Err(ErrorReply::new(ErrorCode::Busy, "too many questions for the skin are waiting")));
        }
    });
    let queryable = shared.session.declare_queryable(shared.keys.skin("*")).callback(callback);
    let queryable = queryable.wait().map_err(|e| shared.error(e))?;
    let publisher = declare_publisher(shared, &port)?;
    let worker = Worker {
        encoder: Encoder::new(shared),
        shared: Arc::clone(shared),
        publisher,
        port,
        published,
        replies,
        questions,
        waiting: VecDeque::new(),
        due: 0,
    };
    Ok((queryable, spawn("plica-skin", move || worker.run())?))
}

fn declare_publisher(shared: &Arc<Shared>, port: &FramePort) -> Result<Publisher<'static>, BusError> {
    let publisher = shared
        .session
        .declare_publisher(shared.keys.skin(&shared.scene.object))
        .congestion_control(CongestionControl::Drop)
        .priority(Priority::Data)
        .encoding(Encoding::from(ENCODING_BYTES))
        .wait()
        .map_err(|e| shared.error(e))?;
    follow_listeners(shared, &publisher, &port.listening)?;
    Ok(publisher)
}

struct Worker {
    shared: Arc<Shared>,
    publisher: Publisher<'static>,
    port: FramePort,
    published: Arc<Published>,
    replies: Replies,
    questions: Receiver<Query>,
    waiting: VecDeque<Waiting>,
    encoder: Encoder,
    due: u64,
}

/// A query, the number of its frame request, and its deadline.
struct Waiting {
    query: Query,
    number: u64,
    deadline: Instant,
}

impl Worker {
    fn run(mut self) {
        self.port.published.register_current();
        while !self.shared.stopping() {
            self.take_questions();
            if self.port.frames.update() {
                self.publish();
                self.answer();
            }
            self.give_up();
            std::thread::park_timeout(if self.waiting.is_empty() { IDLE } else { WITH_QUESTIONS });
        }
    }

    fn take_questions(&mut self) {
        while let Ok(query) = self.questions.try_recv() {
            let deadline = Instant::now() + PATIENCE;
            match self.shared.unknown_object(query.key_expr().as_str()) {
                Some(error) => self.replies.send(query, Err(error)),
                None => self.waiting.push_back(Waiting { query, number: self.port.ask(), deadline }),
            }
        }
    }

    fn publish(&mut self) {
        let frame = self.port.frames.output_buffer();
        if frame.due == self.due {
            return;
        }
        self.published.dropped.fetch_add(frame.due - self.due - 1, Relaxed);
        self.due = frame.due;
        let sequence = self.published.frames.load(Relaxed) + 1;
        let Some(bytes) = self.encoder.encode(frame, sequence) else {
            self.shared.counters.count(FRAME_REFUSED);
            return;
        };
        self.published.frames.store(sequence, Relaxed);
        // Dropped where it does not fit into the queue at once; an error means that the session is closing.
        let _ = self.publisher.put(bytes).wait();
    }

    fn answer(&mut self) {
        let frame = self.port.frames.output_buffer();
        let sequence = self.published.frames.load(Relaxed);
        while let Some(waiting) = self.waiting.pop_front_if(|w| w.number <= frame.answers) {
            let refused = || ErrorReply::new(ErrorCode::NotReady, "the frame was not finite");
            let content = self.encoder.encode(frame, sequence).ok_or_else(refused).map(|payload| Content {
                key: self.shared.keys.skin(&self.shared.scene.object),
                payload,
                encoding: ENCODING_BYTES,
                attachment: None,
            });
            self.replies.send(waiting.query, content);
        }
    }

    fn give_up(&mut self) {
        let now = Instant::now();
        while let Some(waiting) = self.waiting.pop_front_if(|w| w.deadline <= now) {
            let error = ErrorReply::new(ErrorCode::NotReady, "the simulation has made no frame; is it stopping?");
            self.replies.send(waiting.query, Err(error));
        }
    }
}

/// Encoder of frames.
struct Encoder {
    format: PositionFormat,
    surface: DisplaySurface,
    normals: Option<Vec<[f32; 3]>>,
    n_bytes: usize,
}

impl Encoder {
    fn new(shared: &Shared) -> Self {
        let surface = DisplaySurface::new(&shared.model.description().skin);
        let with_normals = shared.scene.publish.normals;
        let normals = with_normals.then(|| vec![[0.0; 3]; surface.rest.len()]);
        Self { format: shared.scene.publish.format, surface, normals, n_bytes: 0 }
    }

    /// Encodes a frame; `None` if a position is not finite, the last gate before publishing.
    fn encode(&mut self, frame: &Frame, sequence: u64) -> Option<Vec<u8>> {
        if !frame.positions.iter().flatten().all(|x| x.is_finite()) {
            return None;
        }
        if let Some(normals) = &mut self.normals {
            vertex_normals_into(&self.surface.triangles, &frame.positions, normals);
        }
        let header = wire::skin_header(frame, sequence);
        let mut bytes = Vec::with_capacity(self.n_bytes);
        let normals = self.normals.as_deref();
        let encoded = match self.format {
            PositionFormat::F32 => skin::encode_f32_into(&mut bytes, &header, &frame.positions, normals),
            PositionFormat::I16 => {
                skin::encode_i16_into(&mut bytes, &header, &frame.positions, &self.surface.rest, normals)
            }
        };
        encoded.ok()?;
        self.n_bytes = bytes.len();
        Some(bytes)
    }
}
