//! Bytes of a VTU array: size header, base64, compressed blocks.

use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use roxmltree::Node;

use super::arrays::{Array, Source, Stream, place};
use crate::import::error::{DAMAGED, Fault, fault};

/// Compression of blocks.
#[derive(Clone, Copy)]
pub(super) enum Compressor {
    Zlib,
    Lz4,
}

/// Largest expansion of a byte by LZ4.
const MOST_LZ4_GROWTH: usize = 256;

impl Compressor {
    pub(super) fn by_name(root: Node<'_, '_>, name: &str) -> Result<Self, Fault> {
        match name {
            "vtkZLibDataCompressor" => Ok(Self::Zlib),
            "vtkLZ4DataCompressor" => Ok(Self::Lz4),
            other => fault(place(root, "compressor"), format!("`{other}` is not read"), "save it with ZLib or without"),
        }
    }

    fn decompress(self, block: &[u8], n_bytes: usize) -> Option<Vec<u8>> {
        let bytes = match self {
            Self::Zlib => {
                let mut bytes = Vec::new();
                flate2::read::ZlibDecoder::new(block).take(n_bytes as u64 + 1).read_to_end(&mut bytes).ok()?;
                bytes
            }
            Self::Lz4 if n_bytes > MOST_LZ4_GROWTH * (block.len() + 1) => return None,
            Self::Lz4 => lz4_flex::block::decompress(block, n_bytes).ok()?,
        };
        (bytes.len() == n_bytes).then_some(bytes)
    }
}

/// The bytes of an array.
pub(super) fn read(source: &Source<'_>, array: &Array<'_, '_>, stream: Stream<'_>) -> Result<Vec<u8>, Fault> {
    let bytes = match source.compressor {
        None => plain(source, &stream),
        Some(compressor) => compressed(source, &stream, compressor),
    };
    match bytes {
        Some(bytes) => Ok(bytes),
        None => fault(array.place(), "its data ends early, is not base64, or does not decompress", DAMAGED),
    }
}

/// `[n_bytes] data`
fn plain(source: &Source<'_>, stream: &Stream<'_>) -> Option<Vec<u8>> {
    let h = source.header_bytes;
    let n_bytes = header(source, &prefix(stream, &[h])?)?[0];
    prefix(stream, &[h, n_bytes])?.get(h..).map(<[u8]>::to_vec)
}

/// `[n_blocks] [block_size] [last_size or 0] [compressed_size of each] data`
fn compressed(source: &Source<'_>, stream: &Stream<'_>, compressor: Compressor) -> Option<Vec<u8>> {
    let h = source.header_bytes;
    let n_blocks = header(source, &prefix(stream, &[h])?)?[0];
    let header_size = h.checked_mul(n_blocks.checked_add(3)?)?;
    let numbers = header(source, &prefix(stream, &[header_size])?)?;
    let (block_size, last_size, sizes) = (numbers[1], numbers[2], &numbers[3..]);
    let n_bytes = sizes.iter().try_fold(0_usize, |sum, &size| sum.checked_add(size))?;
    let bytes = prefix(stream, &[header_size, n_bytes])?;
    let mut rest = bytes.get(header_size..)?;
    let mut out = Vec::new();
    for (i, &size) in sizes.iter().enumerate() {
        let is_last = i + 1 == n_blocks;
        let full_size = if is_last && last_size > 0 { last_size } else { block_size };
        let (block, after) = rest.split_at_checked(size)?;
        out.extend(compressor.decompress(block, full_size)?);
        rest = after;
    }
    Some(out)
}

/// Header numbers.
fn header(source: &Source<'_>, bytes: &[u8]) -> Option<Vec<usize>> {
    let number = |word: &[u8]| {
        let add = |sum: u64, byte: &u8| (sum << 8) | u64::from(*byte);
        let word = if source.is_big_endian { word.iter().fold(0, add) } else { word.iter().rev().fold(0, add) };
        usize::try_from(word).ok()
    };
    bytes.chunks_exact(source.header_bytes).map(number).collect()
}

/// First bytes of a stream in `parts`, encoded one by one or together.
fn prefix(stream: &Stream<'_>, parts: &[usize]) -> Option<Vec<u8>> {
    let n_bytes = parts.iter().try_fold(0_usize, |sum, &part| sum.checked_add(part))?;
    match stream {
        Stream::Raw(bytes) => bytes.get(..n_bytes).map(<[u8]>::to_vec),
        Stream::Base64(text) => {
            let n_characters = parts.iter().try_fold(0_usize, |sum, &part| {
                part.div_ceil(3).checked_mul(4).and_then(|characters| sum.checked_add(characters))
            })?;
            let mut bytes = decode(&text[..n_characters.min(text.len())])?;
            bytes.truncate(n_bytes);
            (bytes.len() == n_bytes).then_some(bytes)
        }
    }
}

/// Decodes base64 of one or several padded pieces.
fn decode(text: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(3 * (text.len() / 4));
    let mut rest = text;
    while !rest.is_empty() {
        let padding = rest.iter().position(|b| *b == b'=');
        let end = padding.map_or(rest.len(), |at| at.next_multiple_of(4).max(at + 1).min(rest.len()));
        STANDARD.decode_vec(&rest[..end], &mut bytes).ok()?;
        rest = &rest[end..];
    }
    Some(bytes)
}
