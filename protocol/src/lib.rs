//! Wire format of Plica: binary messages, keys, JSON types.
//!
//! `PROTOCOL.md` beside this crate describes the same format for other languages. This crate holds bytes and the rule by which
//! poses are accepted ([`order`]); it knows neither Zenoh nor simulation types. Decoding never panics on any bytes, and never
//! allocates for binary messages.
//!
//! All binary messages are little-endian and start with four magic bytes, `u16 version` and a `u16` length: of the
//! whole message for poses and wrenches, of the header for skin frames.

mod bytes;
pub mod chunk;
pub mod connection;
pub mod encoding;
mod error;
pub mod jobs;
pub mod keys;
mod object;
pub mod order;
pub mod pose;
pub mod rpc;
pub mod skin;
pub mod status;
pub mod wrench;

pub use error::DecodeError;

/// Version of every binary message, and the `v1` of every key.
pub const VERSION: u16 = 1;

/// Encoding of JSON payloads; a pose whose encoding says JSON in any way ([`encoding::is_json`]) is read as JSON.
pub const ENCODING_JSON: &str = "application/json";

/// Encoding of binary payloads, and of payloads without a named encoding.
pub const ENCODING_BYTES: &str = "zenoh/bytes";

/// Encoding of the mesh reply.
pub const ENCODING_GLB: &str = "model/gltf-binary";

/// Default endpoint of daemon and client.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Default session name.
pub const DEFAULT_SESSION: &str = "main";
