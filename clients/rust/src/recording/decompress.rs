//! Decompression of the chunks of a recording, as far as they go.

use std::io::{self, Read};

use lz4_flex::frame::FrameDecoder as Lz4Decoder;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder as ZstdDecoder};

/// Most bytes of one chunk.
pub(super) const MAX_CHUNK_BYTES: u64 = 1 << 30;
/// Blocks of zstd that are decoded at once.
const BLOCKS: BlockDecodingStrategy = BlockDecodingStrategy::UptoBlocks(8);
/// A last block without content, and room for a checksum: ends a zstd frame that was cut, so that its decoder gives back
/// the blocks before the cut.
const LAST_BLOCK: [u8; 7] = [1, 0, 0, 0, 0, 0, 0];

/// Decompressed bytes of a chunk.
pub(super) struct Decompressed {
    pub(super) bytes: Vec<u8>,
    /// Whether nothing is missing or damaged, as far as the compression tells.
    pub(super) is_whole: bool,
}

/// Decompresses at most `limit` bytes; `None` for a compression that is not known.
pub(super) fn decompress(compression: &str, data: &[u8], limit: u64) -> Option<Decompressed> {
    let limit = limit.min(MAX_CHUNK_BYTES);
    let mut bytes = Vec::new();
    let result = match compression {
        "" => data.take(limit).read_to_end(&mut bytes).map(drop),
        "lz4" => lz4(data, limit, &mut bytes),
        "zstd" => zstd(data, limit, &mut bytes),
        _ => return None,
    };
    Some(Decompressed { bytes, is_whole: result.is_ok() })
}

fn lz4(mut data: &[u8], limit: u64, bytes: &mut Vec<u8>) -> io::Result<()> {
    while !data.is_empty() && (bytes.len() as u64) < limit {
        Lz4Decoder::new(&mut data).take(limit - bytes.len() as u64).read_to_end(bytes)?;
    }
    Ok(())
}

fn zstd(mut data: &[u8], limit: u64, bytes: &mut Vec<u8>) -> io::Result<()> {
    let mut decoder = ZstdDecoder::new();
    while !data.is_empty() && (bytes.len() as u64) < limit {
        match decoder.reset(&mut data) {
            Ok(()) => zstd_frame(&mut decoder, &mut data, limit, bytes)?,
            Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame { length, .. })) => {
                data = data.get(length as usize..).ok_or(io::ErrorKind::UnexpectedEof)?;
            }
            Err(error) => return Err(io::Error::other(error)),
        }
    }
    bytes.truncate(limit as usize);
    Ok(())
}

fn zstd_frame(decoder: &mut ZstdDecoder, data: &mut &[u8], limit: u64, bytes: &mut Vec<u8>) -> io::Result<()> {
    while !decoder.is_finished() && (bytes.len() as u64) < limit {
        if let Err(error) = decoder.decode_blocks(&mut *data, BLOCKS) {
            let _ = decoder.decode_blocks(LAST_BLOCK.as_slice(), BlockDecodingStrategy::All);
            decoder.collect_to_writer(&mut *bytes)?;
            return Err(io::Error::other(error));
        }
        decoder.collect_to_writer(&mut *bytes)?;
    }
    Ok(())
}
