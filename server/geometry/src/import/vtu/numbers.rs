//! Numbers of VTU arrays from bytes and from text.

use std::str::FromStr;

use super::arrays::Array;
use crate::import::error::{DAMAGED, Fault, fault};

/// Number types by their names in VTU files.
#[derive(Clone, Copy)]
pub(super) enum NumberType {
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float32,
    Float64,
}

impl NumberType {
    pub(super) fn by_name(name: &str) -> Option<Self> {
        Some(match name {
            "Int8" => Self::Int8,
            "UInt8" => Self::UInt8,
            "Int16" => Self::Int16,
            "UInt16" => Self::UInt16,
            "Int32" => Self::Int32,
            "UInt32" => Self::UInt32,
            "Int64" => Self::Int64,
            "UInt64" => Self::UInt64,
            "Float32" => Self::Float32,
            "Float64" => Self::Float64,
            _ => return None,
        })
    }

    fn n_bytes(self) -> usize {
        match self {
            Self::Int8 | Self::UInt8 => 1,
            Self::Int16 | Self::UInt16 => 2,
            Self::Int32 | Self::UInt32 | Self::Float32 => 4,
            Self::Int64 | Self::UInt64 | Self::Float64 => 8,
        }
    }

    pub(super) fn to_f64(self, bytes: &[u8], is_big_endian: bool, array: &Array<'_, '_>) -> Result<Vec<f64>, Fault> {
        self.convert(bytes, is_big_endian, array, |word| {
            Some(match self {
                Self::Float32 => f64::from(f32::from_bits(word as u32)),
                Self::Float64 => f64::from_bits(word),
                Self::UInt8 | Self::UInt16 | Self::UInt32 | Self::UInt64 => word as f64,
                Self::Int8 | Self::Int16 | Self::Int32 | Self::Int64 => self.extend_sign(word) as f64,
            })
        })
    }

    /// Non-negative integers; other values are refused.
    pub(super) fn to_u64(self, bytes: &[u8], is_big_endian: bool, array: &Array<'_, '_>) -> Result<Vec<u64>, Fault> {
        self.convert(bytes, is_big_endian, array, |word| match self {
            Self::Float32 | Self::Float64 => None,
            Self::UInt8 | Self::UInt16 | Self::UInt32 | Self::UInt64 => Some(word),
            Self::Int8 | Self::Int16 | Self::Int32 | Self::Int64 => u64::try_from(self.extend_sign(word)).ok(),
        })
    }

    fn extend_sign(self, word: u64) -> i64 {
        let unused = 64 - 8 * self.n_bytes();
        ((word << unused) as i64) >> unused
    }

    fn convert<T>(
        self,
        bytes: &[u8],
        is_big_endian: bool,
        array: &Array<'_, '_>,
        number: impl Fn(u64) -> Option<T>,
    ) -> Result<Vec<T>, Fault> {
        if !bytes.len().is_multiple_of(self.n_bytes()) {
            let problem = format!("{} bytes are no whole number of {}-byte numbers", bytes.len(), self.n_bytes());
            return fault(array.place(), problem, DAMAGED);
        }
        let word = |bytes: &[u8]| bytes.iter().fold(0, |word, &byte| (word << 8) | u64::from(byte));
        let word_reversed = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, &byte| (word << 8) | u64::from(byte));
        let words = bytes.chunks_exact(self.n_bytes());
        let numbers: Option<Vec<T>> =
            words.map(|bytes| number(if is_big_endian { word(bytes) } else { word_reversed(bytes) })).collect();
        match numbers {
            Some(numbers) => Ok(numbers),
            None => fault(array.place(), "holds numbers that are not whole numbers from 0", DAMAGED),
        }
    }
}

/// Numbers written as words.
pub(super) fn text_numbers<T: FromStr>(array: &Array<'_, '_>) -> Result<Vec<T>, Fault> {
    let parse = |(i, word): (usize, &str)| {
        word.parse().or_else(|_| {
            let shown: String = word.chars().take(40).collect();
            fault(array.place(), format!("entry {i} is `{shown}`, not a number of the kind expected"), DAMAGED)
        })
    };
    array.text().split_ascii_whitespace().enumerate().map(parse).collect()
}
