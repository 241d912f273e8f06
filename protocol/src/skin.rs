//! Skin frames, output: `PLSK`, a 64-byte header, positions, and normals if the scene publishes them.
//!
//! | format | positions | normals |
//! | --- | --- | --- |
//! | f32 | `f32[n][3]`, world frame, metres | `f32[n][3]`, unit |
//! | 16-bit | `i16[n][3]`; `rest + scale * value` is the world position | `i16[n][3]`; `value / 32767` |

use thiserror::Error;

use crate::bytes::{Layout, finite, open};
use crate::error::DecodeError;

/// First bytes of a skin frame.
pub const MAGIC: [u8; 4] = *b"PLSK";
/// Length of the header in bytes.
pub const HEADER_BYTES: usize = 64;
/// Value of a 16-bit normal component that means 1.
const NORMAL_ONE: f32 = 32767.0;

/// Header of a skin frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SkinHeader {
    /// Number of the published frame of this object; a gap shows lost frames.
    pub sequence: u64,
    /// Simulation tick of the frame.
    pub tick: u64,
    /// Simulated time in seconds.
    pub sim_time_s: f64,
    /// Source time of the newest pose of any tool in this frame; 0 if none.
    pub newest_pose_source_time_ns: u64,
    /// Number of vertices.
    pub n_vertices: u32,
    /// State and format of the frame.
    pub flags: SkinFlags,
    /// Least confidence over the tools in contact; 0 means plain coarse skin.
    pub confidence: f32,
    /// Rises with each activated example database.
    pub database_generation: u32,
    /// Metres per unit of a 16-bit offset; 0 in the f32 format.
    pub scale: f32,
}

/// State and format of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SkinFlags {
    /// Bit 1: detail has been added.
    pub enriched: bool,
    /// Bit 2: the state was rolled back or a stage was skipped.
    pub degraded: bool,
    /// Bit 4: the object sleeps and the frame repeats the last one.
    pub sleeping: bool,
    /// Bit 8: normals follow the positions.
    pub normals: bool,
    /// Bit 16: 16-bit format.
    pub offsets_i16: bool,
}

impl SkinFlags {
    /// Encodes the `u32`.
    pub fn bits(self) -> u32 {
        u32::from(self.enriched)
            | u32::from(self.degraded) << 1
            | u32::from(self.sleeping) << 2
            | u32::from(self.normals) << 3
            | u32::from(self.offsets_i16) << 4
    }

    /// Decodes the `u32`; unknown bits are ignored.
    pub fn from_bits(bits: u32) -> Self {
        Self {
            enriched: bits & 1 != 0,
            degraded: bits & 2 != 0,
            sleeping: bits & 4 != 0,
            normals: bits & 8 != 0,
            offsets_i16: bits & 16 != 0,
        }
    }

    fn element_bytes(self) -> u64 {
        if self.offsets_i16 { 2 } else { 4 }
    }
}

impl SkinHeader {
    /// Length of the whole frame in bytes.
    pub fn frame_bytes(&self) -> u64 {
        let arrays = if self.flags.normals { 2 } else { 1 };
        HEADER_BYTES as u64 + arrays * self.array_bytes()
    }

    fn array_bytes(&self) -> u64 {
        3 * self.flags.element_bytes() * u64::from(self.n_vertices)
    }

    fn encode(&self) -> [u8; HEADER_BYTES] {
        Layout::new(MAGIC)
            .u64(self.sequence)
            .u64(self.tick)
            .f64(self.sim_time_s)
            .u64(self.newest_pose_source_time_ns)
            .u32(self.n_vertices)
            .u32(self.flags.bits())
            .f32(self.confidence)
            .u32(self.database_generation)
            .f32(self.scale)
            .u32(0)
            .finish()
    }

    /// Decodes the first 64 bytes of a frame.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let mut fields = open(bytes, MAGIC, HEADER_BYTES)?;
        let header = Self {
            sequence: fields.u64(),
            tick: fields.u64(),
            sim_time_s: fields.f64(),
            newest_pose_source_time_ns: fields.u64(),
            n_vertices: fields.u32(),
            flags: SkinFlags::from_bits(fields.u32()),
            confidence: fields.f32(),
            database_generation: fields.u32(),
            scale: fields.f32(),
        };
        finite("sim_time_s", &[header.sim_time_s])?;
        finite("confidence", &[f64::from(header.confidence)])?;
        finite("scale", &[f64::from(header.scale)])?;
        Ok(header)
    }
}

/// Arrays with different numbers of vertices.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{array} has {got} vertices, positions have {expected}")]
pub struct EncodeError {
    /// Name of the array.
    pub array: &'static str,
    /// Vertices of the positions.
    pub expected: usize,
    /// Vertices of that array.
    pub got: usize,
}

/// Writes a frame in the f32 format to `out`, which is reallocated only while it is too small.
///
/// `n_vertices`, `scale` and the format flags of `header` are replaced by those of the arrays.
/// `positions`: `[n][3]`, world frame, metres. `normals`: `[n][3]`, unit.
pub fn encode_f32_into(
    out: &mut Vec<u8>,
    header: &SkinHeader,
    positions: &[[f32; 3]],
    normals: Option<&[[f32; 3]]>,
) -> Result<(), EncodeError> {
    check_lengths("normals", positions.len(), normals.map(<[_]>::len))?;
    let header = complete(header, positions.len(), normals.is_some(), None);
    start(out, &header);
    push_f32(out, positions);
    push_f32(out, normals.unwrap_or_default());
    Ok(())
}

/// Writes a frame in the 16-bit format to `out`.
///
/// ```text
/// scale = max |positions - rest| / 32767      value = round((positions - rest) / scale)
/// ```
/// The error of a coordinate is at most `scale / 2`.
pub fn encode_i16_into(
    out: &mut Vec<u8>,
    header: &SkinHeader,
    positions: &[[f32; 3]],
    rest: &[[f32; 3]],
    normals: Option<&[[f32; 3]]>,
) -> Result<(), EncodeError> {
    check_lengths("rest", positions.len(), Some(rest.len()))?;
    check_lengths("normals", positions.len(), normals.map(<[_]>::len))?;
    let offset_m = |(p, r): (&[f32; 3], &[f32; 3])| [p[0] - r[0], p[1] - r[1], p[2] - r[2]];
    let largest_m = positions.iter().zip(rest).flat_map(offset_m).fold(0.0_f32, |most, d| most.max(d.abs()));
    let scale = largest_m / f32::from(i16::MAX);
    let header = complete(header, positions.len(), normals.is_some(), Some(scale));
    start(out, &header);
    let per_scale = if scale > 0.0 { scale.recip() } else { 0.0 };
    positions.iter().zip(rest).map(offset_m).for_each(|d| push_i16(out, d, per_scale));
    normals.unwrap_or_default().iter().for_each(|n| push_i16(out, *n, NORMAL_ONE));
    Ok(())
}

fn check_lengths(array: &'static str, expected: usize, got: Option<usize>) -> Result<(), EncodeError> {
    match got {
        Some(got) if got != expected => Err(EncodeError { array, expected, got }),
        _ => Ok(()),
    }
}

fn complete(header: &SkinHeader, n_vertices: usize, normals: bool, scale: Option<f32>) -> SkinHeader {
    let flags = SkinFlags { normals, offsets_i16: scale.is_some(), ..header.flags };
    SkinHeader { n_vertices: n_vertices as u32, flags, scale: scale.unwrap_or(0.0), ..*header }
}

fn start(out: &mut Vec<u8>, header: &SkinHeader) {
    out.clear();
    out.reserve(header.frame_bytes() as usize);
    out.extend_from_slice(&header.encode());
}

fn push_f32(out: &mut Vec<u8>, vectors: &[[f32; 3]]) {
    for vector in vectors {
        for component in vector {
            out.extend_from_slice(&component.to_le_bytes());
        }
    }
}

fn push_i16(out: &mut Vec<u8>, vector: [f32; 3], per_unit: f32) {
    for component in vector {
        // A cast from float to integer saturates.
        out.extend_from_slice(&((component * per_unit).round() as i16).to_le_bytes());
    }
}

/// View of a frame in received bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkinFrame<'a> {
    /// The header.
    pub header: SkinHeader,
    positions: &'a [u8],
    normals: &'a [u8],
}

impl<'a> SkinFrame<'a> {
    /// Checks the header; the arrays are not read.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, DecodeError> {
        let header = SkinHeader::decode(bytes)?;
        let (expected, got) = (header.frame_bytes(), bytes.len() as u64);
        if got < expected {
            return Err(DecodeError::TooShort { needed: expected, got });
        }
        if got > expected {
            return Err(DecodeError::Length { expected, got });
        }
        let (positions, normals) = bytes[HEADER_BYTES..].split_at(header.array_bytes() as usize);
        Ok(Self { header, positions, normals })
    }

    /// `[n][3]` in metres: world positions in the f32 format, offsets from rest in the 16-bit format.
    pub fn vectors(&self) -> Vec<[f32; 3]> {
        if self.header.flags.offsets_i16 {
            read_i16(self.positions, self.header.scale)
        } else {
            read_f32(self.positions)
        }
    }

    /// World positions `[n][3]` in metres. `rest` (of the mesh, same order) is used by the 16-bit format only.
    ///
    /// `None` if the format needs `rest` and it has another number of vertices.
    pub fn positions_m(&self, rest: &[[f32; 3]]) -> Option<Vec<[f32; 3]>> {
        let mut positions = self.vectors();
        if self.header.flags.offsets_i16 {
            if rest.len() != positions.len() {
                return None;
            }
            for (p, r) in positions.iter_mut().zip(rest) {
                *p = [p[0] + r[0], p[1] + r[1], p[2] + r[2]];
            }
        }
        Some(positions)
    }

    /// Unit normals `[n][3]`, if the frame has them.
    pub fn normals(&self) -> Option<Vec<[f32; 3]>> {
        self.header.flags.normals.then(|| {
            if self.header.flags.offsets_i16 {
                read_i16(self.normals, NORMAL_ONE.recip())
            } else {
                read_f32(self.normals)
            }
        })
    }

    /// Bytes of the positions: `f32[n][3]` or `i16[n][3]`.
    pub fn position_bytes(&self) -> &'a [u8] {
        self.positions
    }
}

fn read_f32(bytes: &[u8]) -> Vec<[f32; 3]> {
    let component = |four: &[u8]| f32::from_le_bytes([four[0], four[1], four[2], four[3]]);
    bytes.chunks_exact(12).map(|v| [component(&v[0..4]), component(&v[4..8]), component(&v[8..12])]).collect()
}

fn read_i16(bytes: &[u8], unit: f32) -> Vec<[f32; 3]> {
    let component = |two: &[u8]| f32::from(i16::from_le_bytes([two[0], two[1]])) * unit;
    bytes.chunks_exact(6).map(|v| [component(&v[0..2]), component(&v[2..4]), component(&v[4..6])]).collect()
}
