//! Little-endian fields at fixed offsets, written and read in the order of the layout.

use crate::VERSION;
use crate::error::DecodeError;

/// Reads fields in order. [`open`] checks the length once; reads after it are infallible.
pub(crate) struct Fields<'a> {
    rest: &'a [u8],
}

/// Checks magic, version and the `u16` length field (`header_bytes`), and moves to offset 8 behind them.
///
/// Errors in this order: too short, magic, version, length.
pub(crate) fn open<'a>(bytes: &'a [u8], magic: [u8; 4], header_bytes: usize) -> Result<Fields<'a>, DecodeError> {
    if bytes.len() < header_bytes {
        return Err(DecodeError::TooShort { needed: header_bytes as u64, got: bytes.len() as u64 });
    }
    let mut fields = Fields { rest: &bytes[..header_bytes] };
    let found = fields.take::<4>();
    if found != magic {
        return Err(DecodeError::Magic { found, expected: magic });
    }
    let version = u16::from_le_bytes(fields.take());
    if version != VERSION {
        return Err(DecodeError::Version { found: version, expected: VERSION });
    }
    let declared = u16::from_le_bytes(fields.take());
    if usize::from(declared) != header_bytes {
        return Err(DecodeError::Length { expected: header_bytes as u64, got: u64::from(declared) });
    }
    Ok(fields)
}

/// [`open`] for a message without a body.
pub(crate) fn open_exact<'a>(bytes: &'a [u8], magic: [u8; 4], n_bytes: usize) -> Result<Fields<'a>, DecodeError> {
    let fields = open(bytes, magic, n_bytes)?;
    if bytes.len() != n_bytes {
        return Err(DecodeError::Length { expected: n_bytes as u64, got: bytes.len() as u64 });
    }
    Ok(fields)
}

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut field = [0; N];
        let (head, tail) = self.rest.split_at(N);
        field.copy_from_slice(head);
        self.rest = tail;
        field
    }

    pub(crate) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    pub(crate) fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }

    pub(crate) fn f32(&mut self) -> f32 {
        f32::from_le_bytes(self.take())
    }

    pub(crate) fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    pub(crate) fn f64s<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| self.f64())
    }
}

/// Writes fields in order into a message of known length.
pub(crate) struct Layout<const BYTES: usize> {
    bytes: [u8; BYTES],
    at: usize,
}

impl<const BYTES: usize> Layout<BYTES> {
    /// Starts a message with magic, version and length.
    pub(crate) fn new(magic: [u8; 4]) -> Self {
        let mut layout = Self { bytes: [0; BYTES], at: 0 };
        layout.put(magic).put(VERSION.to_le_bytes()).put((BYTES as u16).to_le_bytes());
        layout
    }

    fn put<const N: usize>(&mut self, field: [u8; N]) -> &mut Self {
        self.bytes[self.at..self.at + N].copy_from_slice(&field);
        self.at += N;
        self
    }

    pub(crate) fn u32(&mut self, value: u32) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    pub(crate) fn u64(&mut self, value: u64) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    pub(crate) fn f32(&mut self, value: f32) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    pub(crate) fn f64(&mut self, value: f64) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    pub(crate) fn f64s<const N: usize>(&mut self, values: [f64; N]) -> &mut Self {
        values.into_iter().for_each(|value| {
            self.f64(value);
        });
        self
    }

    /// The finished message.
    pub(crate) fn finish(&self) -> [u8; BYTES] {
        debug_assert_eq!(self.at, BYTES, "layout not filled");
        self.bytes
    }
}

/// Refuses NaN and infinity.
pub(crate) fn finite(field: &'static str, values: &[f64]) -> Result<(), DecodeError> {
    if values.iter().all(|value| value.is_finite()) { Ok(()) } else { Err(DecodeError::NonFinite { field }) }
}
