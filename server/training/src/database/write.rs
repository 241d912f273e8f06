//! Examples to bytes.

use std::collections::HashMap;
use std::path::Path;

use safetensors::tensor::{Metadata as Header, TensorInfo};

use super::tensors::{NO_CHECKSUM, Tensors, checksum, f32s, f64s};
use super::{Database, FORMAT, FORMAT_VERSION, METADATA_KEY, Metadata};
use crate::atomic_file::write_atomically;
use crate::canonical;
use crate::database_error::DatabaseError;
use crate::example::Example;

impl Database {
    /// Writes the file atomically. The same examples give the same bytes.
    ///
    /// # Errors
    /// [`DatabaseError::Io`], and [`DatabaseError::Inconsistent`] if examples differ in size or in what they hold.
    pub fn write(&self, path: &Path) -> Result<(), DatabaseError> {
        let inconsistent = |problem| DatabaseError::Inconsistent { path: path.to_owned(), problem };
        let bytes = self.to_bytes().map_err(inconsistent)?;
        write_atomically(path, &bytes).map_err(|error| DatabaseError::Io { path: path.to_owned(), error })
    }

    /// The bytes of the file; the error says which example does not fit the first one.
    fn to_bytes(&self) -> Result<Vec<u8>, String> {
        let tensors = tensors(&self.examples)?;
        let mut metadata = Metadata {
            format: FORMAT.to_owned(),
            format_version: FORMAT_VERSION,
            about: self.about.clone(),
            examples: self.examples.iter().map(|e| e.record.clone()).collect(),
            rejected: self.rejected.clone(),
            sha256: NO_CHECKSUM.to_owned(),
        };
        let views = tensors.iter().map(|(name, t)| (name.as_str(), t.dtype, t.shape.as_slice(), t.bytes.as_slice()));
        metadata.sha256 = checksum(&canonical::to_text(&metadata), views);
        pack(&canonical::to_text(&metadata), &tensors)
    }
}

/// Header and data of a safetensors file, tensors in the order of names.
fn pack(metadata: &str, tensors: &Tensors) -> Result<Vec<u8>, String> {
    let mut end = 0;
    let infos = tensors.iter().map(|(name, tensor)| {
        let start = end;
        end += tensor.bytes.len();
        let (dtype, shape) = (tensor.dtype, tensor.shape.clone());
        (name.clone(), TensorInfo { dtype, shape, data_offsets: (start, end) })
    });
    let about = HashMap::from([(METADATA_KEY.to_owned(), metadata.to_owned())]);
    let header = Header::new(Some(about), infos.collect()).map_err(|e| e.to_string())?;
    // The library writes its maps in an order of its own: the same examples shall give the same bytes.
    let mut text = canonical::to_text(&header).into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let mut bytes = Vec::with_capacity(8 + text.len() + end);
    bytes.extend((text.len() as u64).to_le_bytes());
    bytes.extend(text);
    tensors.values().for_each(|tensor| bytes.extend(&tensor.bytes));
    Ok(bytes)
}

fn tensors(examples: &[Example]) -> Result<Tensors, String> {
    let first = examples.first().ok_or("there is no example in it")?;
    let (n, n_nodes, n_skin) = (examples.len(), first.displacements.len(), first.detail.len());
    let sizes = |e: &Example| (e.displacements.len(), e.detail.len(), e.independent_detail.as_ref().map(Vec::len));
    if let Some(other) = examples.iter().find(|e| sizes(e) != sizes(first)) {
        return Err(format!("example {} has other sizes than example {}", other.record.index, first.record.index));
    }
    let mut tensors = Tensors::new();
    let mut add = |name: &str, tensor| drop(tensors.insert(name.to_owned(), tensor));
    add("u", f32s(&[n, n_nodes, 3], examples.iter().flat_map(|e| e.displacements.iter().flatten())));
    add("d", f32s(&[n, n_skin, 3], examples.iter().flat_map(|e| e.detail.iter().flatten())));
    add("contact_point", f64s(&[n, 3], examples.iter().flat_map(|e| &e.contact_point)));
    add("contact_frame", f64s(&[n, 3, 3], examples.iter().flat_map(|e| e.contact_frame.iter().flatten())));
    add("tool_pose", f64s(&[n, 7], examples.iter().flat_map(|e| &e.tool_pose)));
    add("force_coarse", f64s(&[n, 3], examples.iter().flat_map(|e| &e.coarse_force)));
    add("force_tied", f64s(&[n, 3], examples.iter().flat_map(|e| &e.tied_force)));
    if first.independent_detail.is_some() {
        let details = examples.iter().filter_map(|e| e.independent_detail.as_ref());
        add("d_independent", f32s(&[n, n_skin, 3], details.flatten().flatten()));
        let forces = examples.iter().filter_map(|e| e.independent_force.as_ref());
        add("force_independent", f64s(&[n, 3], forces.flatten()));
    }
    Ok(tensors)
}
