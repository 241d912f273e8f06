//! Tensors of a database, their names and their checksum.

use std::collections::BTreeMap;

use safetensors::Dtype;
use sha2::{Digest, Sha256};

use crate::canonical::hexadecimal;

/// Digits that stand in for the checksum while it is computed.
pub(super) const NO_CHECKSUM: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// A tensor as bytes, little-endian.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tensor {
    pub(super) dtype: Dtype,
    pub(super) shape: Vec<usize>,
    pub(super) bytes: Vec<u8>,
}

/// Tensors by name.
pub(super) type Tensors = BTreeMap<String, Tensor>;

/// SHA-256 of the metadata text with its own digits set to 0, then, tensor by tensor in the order of names, a line `name
/// type [shape]` and the bytes.
pub(super) fn checksum<'a>(
    metadata: &str,
    tensors: impl IntoIterator<Item = (&'a str, Dtype, &'a [usize], &'a [u8])>,
) -> String {
    let mut sum = Sha256::new();
    sum.update(metadata);
    for (name, dtype, shape, bytes) in tensors {
        let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
        sum.update(format!("{name} {dtype} [{}]\n", shape.join(",")));
        sum.update(bytes);
    }
    hexadecimal(&sum.finalize())
}

pub(super) fn f32s<'a>(shape: &[usize], values: impl Iterator<Item = &'a f32>) -> Tensor {
    Tensor { dtype: Dtype::F32, shape: shape.to_vec(), bytes: values.flat_map(|x| x.to_le_bytes()).collect() }
}

pub(super) fn f64s<'a>(shape: &[usize], values: impl Iterator<Item = &'a f64>) -> Tensor {
    Tensor { dtype: Dtype::F64, shape: shape.to_vec(), bytes: values.flat_map(|x| x.to_le_bytes()).collect() }
}
