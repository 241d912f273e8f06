//! Replies in chunks: `?offset=N` requests the chunk that starts at byte N.
//!
//! Each chunk carries a [`ChunkHeader`] as JSON in the reply's attachment. A reader requests from offset 0 on until it has
//! `total_bytes`, starts again if `sha256` changes meanwhile, and checks the SHA-256 of the whole at the end.

use serde::{Deserialize, Serialize};

use crate::rpc::{ErrorCode, ErrorReply};

/// Largest chunk in bytes (512 KiB).
pub const CHUNK_BYTES: usize = 512 * 1024;

/// Position of a chunk in the whole; attachment of the reply.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChunkHeader {
    /// Length of the whole in bytes.
    pub total_bytes: u64,
    /// First byte of this chunk.
    pub offset: u64,
    /// SHA-256 of the whole, 64 lower-case hexadecimal digits.
    pub sha256: String,
}

impl ChunkHeader {
    /// Encodes the attachment.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("numbers and hexadecimal digits always serialise")
    }

    /// Decodes an attachment.
    pub fn from_json(bytes: &[u8]) -> Result<Self, crate::error::DecodeError> {
        serde_json::from_slice(bytes).map_err(|error| crate::error::DecodeError::Json(error.to_string()))
    }
}

/// Offset in a selector's parameters (`offset=524288`, separated by `;`); 0 without one.
///
/// Other parameters are ignored. Errors with `bad_offset` if it is not a number.
pub fn offset_of(parameters: &str) -> Result<u64, ErrorReply> {
    let value = parameters.split(';').find_map(|pair| pair.strip_prefix("offset="));
    value.map_or(Ok(0), |text| {
        let digits = text.bytes().all(|b| b.is_ascii_digit());
        let number = digits.then(|| text.parse().ok()).flatten();
        number.ok_or_else(|| bad_offset(text, "a whole number of bytes is expected"))
    })
}

/// Chunk of `whole` from `offset` on; empty at the end. Errors with `bad_offset` beyond the end.
pub fn piece(whole: &[u8], offset: u64) -> Result<&[u8], ErrorReply> {
    check_offset(offset, whole.len() as u64)?;
    let start = offset as usize;
    Ok(&whole[start..whole.len().min(start + CHUNK_BYTES)])
}

/// Refuses an offset beyond the end, with `bad_offset`.
pub fn check_offset(offset: u64, total_bytes: u64) -> Result<(), ErrorReply> {
    if offset <= total_bytes {
        return Ok(());
    }
    Err(bad_offset(&offset.to_string(), &format!("the end is {total_bytes}")))
}

fn bad_offset(found: &str, why: &str) -> ErrorReply {
    ErrorReply::new(ErrorCode::BadOffset, format!("offset `{found}`: {why}"))
}
