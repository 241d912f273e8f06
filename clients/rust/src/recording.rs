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
//! `log_time` is when the recorder received the message, in nanoseconds since 1970. Chunks are written without
//! compression; zstd and lz4 are read as well. Needs no bus.

mod decompress;
mod message;
mod read;
mod write;

pub use message::{Kind, Recorded, RecordingError, tool_of};
pub use read::{Recording, read};
pub use write::Recorder;
