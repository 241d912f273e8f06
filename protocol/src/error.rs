//! Why a message was refused.

use thiserror::Error;

/// A refused message. [`DecodeError::kind`] is its counter in the daemon's status.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DecodeError {
    /// Fewer bytes than the message needs.
    #[error("message too short: {got} bytes, {needed} needed")]
    TooShort {
        /// Bytes needed, as far as known.
        needed: u64,
        /// Bytes that arrived.
        got: u64,
    },
    /// The first four bytes belong to another message.
    #[error("wrong magic bytes {found:?}, expected {expected:?}")]
    Magic {
        /// The bytes that arrived.
        found: [u8; 4],
        /// The bytes of this message.
        expected: [u8; 4],
    },
    /// A version that this build does not read.
    #[error("protocol version {found} is not supported, expected {expected}")]
    Version {
        /// The version that arrived.
        found: u16,
        /// The version of this build.
        expected: u16,
    },
    /// The length field or the length of the message contradicts the layout.
    #[error("wrong length: {got} bytes, expected {expected}")]
    Length {
        /// Bytes of the layout.
        expected: u64,
        /// Bytes that arrived or were declared.
        got: u64,
    },
    /// NaN or infinity.
    #[error("`{field}` is not finite")]
    NonFinite {
        /// Name of the field.
        field: &'static str,
    },
    /// An orientation with a length more than 1e-2 from 1.
    #[error("orientation has length {norm}, expected 1 within 0.01")]
    NotUnit {
        /// Length of the quaternion that arrived.
        norm: f64,
    },
    /// A finite value above the limit.
    #[error("`{field}` is {value}, at most {limit} is accepted")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// The value that arrived.
        value: f64,
        /// Largest accepted magnitude.
        limit: f64,
    },
    /// Not JSON, or JSON of another shape.
    #[error("invalid JSON: {0}")]
    Json(String),
}

impl DecodeError {
    /// All values of [`DecodeError::kind`].
    pub const KINDS: [&'static str; 8] =
        ["too_short", "bad_magic", "bad_version", "bad_length", "non_finite", "not_unit", "out_of_range", "bad_json"];

    /// Name of the counter in the status.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::TooShort { .. } => "too_short",
            Self::Magic { .. } => "bad_magic",
            Self::Version { .. } => "bad_version",
            Self::Length { .. } => "bad_length",
            Self::NonFinite { .. } => "non_finite",
            Self::NotUnit { .. } => "not_unit",
            Self::OutOfRange { .. } => "out_of_range",
            Self::Json(_) => "bad_json",
        }
    }
}
