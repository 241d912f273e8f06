//! Messages of a recording, and why a recording cannot be used.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a recording cannot be written or read.
#[derive(Debug, Error)]
#[error("{}: {message}", path.display())]
pub struct RecordingError {
    /// The file.
    pub path: PathBuf,
    /// Fault and remedy, in a sentence.
    pub message: String,
    /// Text of the library that met the fault, if there is one.
    pub detail: Option<String>,
}

impl RecordingError {
    pub(super) fn new(path: &Path, message: impl Into<String>) -> Self {
        Self { path: path.to_owned(), message: message.into(), detail: None }
    }
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
    /// Every kind.
    pub const ALL: [Self; 4] = [Self::Pose, Self::JsonPose, Self::Skin, Self::Wrench];
    /// Poses in both forms.
    pub const POSES: [Self; 2] = [Self::Pose, Self::JsonPose];

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

    /// Kind of a channel of a recording; `None` for channels of other programs.
    pub(super) fn of_channel(topic: &str, encoding: &str) -> Option<Self> {
        let kind = Self::ALL.into_iter().find(|kind| kind.encoding() == encoding)?;
        let is_ours = topic.starts_with("plica/v1/") && Self::of(topic, kind == Self::JsonPose) == Some(kind);
        is_ours.then_some(kind)
    }

    /// Schema; for binary messages its text is their layout.
    pub(super) fn schema(self) -> Schema {
        let schema = |name, encoding, text| Schema { name, encoding, text };
        match self {
            Self::Pose => schema("plica.Pose", "plica.layout", POSE_LAYOUT),
            Self::JsonPose => schema("plica.JsonPose", "jsonschema", "{\"type\":\"object\"}"),
            Self::Skin => schema("plica.Skin", "plica.layout", SKIN_LAYOUT),
            Self::Wrench => schema("plica.Wrench", "plica.layout", WRENCH_LAYOUT),
        }
    }
}

/// Schema of a channel.
pub(super) struct Schema {
    pub(super) name: &'static str,
    pub(super) encoding: &'static str,
    pub(super) text: &'static str,
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
    /// Time of arrival at the recorder, in nanoseconds since 1970.
    pub log_time_ns: u64,
    /// Bytes of the message.
    pub bytes: Vec<u8>,
}

/// Tool of a pose key of any session.
pub fn tool_of(key: &str) -> Option<&str> {
    let parts: Vec<&str> = key.split('/').collect();
    match parts.as_slice() {
        ["plica", "v1", _, "tool", tool, "pose"] => Some(tool),
        _ => None,
    }
}
