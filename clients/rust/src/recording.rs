//! Recordings: MCAP files, which robotics tools can open.
//!
//! One channel per key of the bus, the key as topic, messages byte by byte as they arrived:
//!
//! | topic | message encoding | schema |
//! | --- | --- | --- |
//! | `plica/v1/<session>/tool/<tool>/pose` | `plica.pose.v1`, or `json` for poses sent as JSON | `plica.Pose` |
//! | `plica/v1/<session>/object/<object>/skin` | `plica.skin.v1` | `plica.Skin` |
//! | `plica/v1/<session>/tool/<tool>/wrench` | `plica.wrench.v1` | `plica.Wrench` |
//!
//! `log_time` is when the recorder received the message, in nanoseconds since 1970. Chunks are not compressed.
//! Needs no bus.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a recording cannot be written or read.
#[derive(Debug, Error)]
#[error("{}: {message}", path.display())]
pub struct RecordingError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub message: String,
}

/// Kind of the messages on a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A pose, 96 bytes.
    Pose,
    /// A pose in its JSON form.
    JsonPose,
    /// A skin frame.
    Skin,
    /// A wrench.
    Wrench,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Pose, Self::JsonPose, Self::Skin, Self::Wrench];

    /// Kind by the last part of the key; `None` for other keys.
    pub fn of(key: &str, json: bool) -> Option<Self> {
        match key.rsplit('/').next() {
            Some("pose") if json => Some(Self::JsonPose),
            Some("pose") => Some(Self::Pose),
            Some("skin") => Some(Self::Skin),
            Some("wrench") => Some(Self::Wrench),
            _ => None,
        }
    }

    /// MCAP's message encoding.
    pub fn encoding(self) -> &'static str {
        match self {
            Self::Pose => "plica.pose.v1",
            Self::JsonPose => "json",
            Self::Skin => "plica.skin.v1",
            Self::Wrench => "plica.wrench.v1",
        }
    }

    /// Name and text of the schema; for binary messages the text is their layout.
    fn schema(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Pose => ("plica.Pose", "plica.layout", POSE_LAYOUT),
            Self::JsonPose => ("plica.JsonPose", "jsonschema", "{\"type\":\"object\"}"),
            Self::Skin => ("plica.Skin", "plica.layout", SKIN_LAYOUT),
            Self::Wrench => ("plica.Wrench", "plica.layout", WRENCH_LAYOUT),
        }
    }
}

const POSE_LAYOUT: &str = "little-endian; u8[4] magic PLPS; u16 version; u16 bytes; u64 sequence; u64 source_time_ns; \
    u32 source_id; u32 flags; f64[3] position_m; f64[4] orientation_xyzw; u32 buttons; f32 grip";
const SKIN_LAYOUT: &str = "little-endian; u8[4] magic PLSK; u16 version; u16 header_bytes; u64 sequence; u64 tick; \
    f64 sim_time_s; u64 newest_pose_source_time_ns; u32 n_vertices; u32 flags; f32 confidence; \
    u32 database_generation; f32 scale; u32 reserved; then positions, then normals if flags & 8";
const WRENCH_LAYOUT: &str = "little-endian; u8[4] magic PLWR; u16 version; u16 bytes; u64 sequence; u64 tick; \
    f64 sim_time_s; u64 pose_sequence; u64 pose_source_time_ns; f64[3] force_n; f64[3] torque_n_m; \
    f64[3] contact_point_m; f64[3] proxy_position_m; f64[4] proxy_orientation_xyzw; u32 flags; u32 n_contacts; \
    f32 confidence; u32 reserved";

/// One message of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recorded {
    /// Key of the message.
    pub key: String,
    /// Kind of the message.
    pub kind: Kind,
    /// When the recorder received it, in nanoseconds since 1970.
    pub log_time_ns: u64,
    /// Bytes of the message.
    pub bytes: Vec<u8>,
}

/// Writes a recording.
pub struct Recorder {
    path: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
    channels: HashMap<(String, Kind), Channel>,
}

struct Channel {
    id: u16,
    n_messages: u32,
}

impl Recorder {
    /// Starts a file; an existing one is replaced.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let path = path.as_ref().to_owned();
        let file = File::create(&path).map_err(|error| fault(&path, error))?;
        let options = mcap::WriteOptions::new().compression(None).profile("plica");
        let writer = options.create(BufWriter::new(file)).map_err(|error| fault(&path, error))?;
        Ok(Self { path, writer, channels: HashMap::new() })
    }

    /// Appends a message.
    pub fn write(&mut self, message: &Recorded) -> Result<(), RecordingError> {
        self.append(message).map_err(|error| fault(&self.path, error))
    }

    /// Ends the file with its index. (Dropping does the same, but cannot report an error.)
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.writer.finish().map(drop).map_err(|error| fault(&self.path, error))
    }

    fn append(&mut self, message: &Recorded) -> mcap::McapResult<()> {
        let slot = (message.key.clone(), message.kind);
        if !self.channels.contains_key(&slot) {
            let (name, encoding, text) = message.kind.schema();
            let schema = self.writer.add_schema(name, encoding, text.as_bytes())?;
            let encoding = message.kind.encoding();
            let id = self.writer.add_channel(schema, &message.key, encoding, &BTreeMap::new())?;
            self.channels.insert(slot.clone(), Channel { id, n_messages: 0 });
        }
        let channel = self.channels.get_mut(&slot).expect("inserted above");
        let header = mcap::records::MessageHeader {
            channel_id: channel.id,
            sequence: channel.n_messages,
            log_time: message.log_time_ns,
            publish_time: message.log_time_ns,
        };
        channel.n_messages = channel.n_messages.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &message.bytes)
    }
}

/// Reads a recording message by message, in file order. Channels of other programs are skipped.
pub fn read(path: impl AsRef<Path>) -> Result<impl Iterator<Item = Result<Recorded, RecordingError>>, RecordingError> {
    let path = path.as_ref().to_owned();
    let file = File::open(&path).map_err(|error| fault(&path, error))?;
    let messages = mcap::io::MessageReader::new(BufReader::new(file));
    Ok(messages.filter_map(move |message| match message {
        Ok(message) => recorded(message).map(Ok),
        Err(error) => Some(Err(fault(&path, error))),
    }))
}

fn recorded(message: mcap::Message<'_>) -> Option<Recorded> {
    let encoding = &message.channel.message_encoding;
    let key = message.channel.topic.clone();
    let kind = Kind::ALL.into_iter().find(|kind| kind.encoding() == encoding)?;
    (Kind::of(&key, kind == Kind::JsonPose) == Some(kind)).then(|| Recorded {
        key,
        kind,
        log_time_ns: message.log_time,
        bytes: message.data.into_owned(),
    })
}

fn fault(path: &Path, error: impl std::fmt::Display) -> RecordingError {
    RecordingError { path: path.to_owned(), message: error.to_string() }
}

/// Tool of a pose key of any session.
pub fn tool_of(key: &str) -> Option<&str> {
    let parts: Vec<&str> = key.split('/').collect();
    match parts.as_slice() {
        ["plica", "v1", _, "tool", tool, "pose"] => Some(tool),
        _ => None,
    }
}
