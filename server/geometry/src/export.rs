//! Mesh files: GLB for viewers, VTU for analysis.

mod glb;
mod vtu;

pub use glb::{glb_bytes, write_glb};
pub use vtu::{Field, write_volume_vtu, write_vtu};

use std::path::{Path, PathBuf};

/// Error of writing a mesh file.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file cannot be created or written.
    #[error("cannot write {}: {cause}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Cause.
        cause: std::io::Error,
    },
    /// A field does not hold one value per node or element.
    #[error("field `{name}` holds {n_values} values for {n_expected} {of}")]
    FieldLength {
        /// The field.
        name: String,
        /// Its number of values.
        n_values: usize,
        /// Number of values needed.
        n_expected: usize,
        /// Nodes or elements.
        of: &'static str,
    },
    /// The VTK writer refused the data.
    #[error("cannot encode VTU: {0}")]
    Vtk(String),
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    std::fs::write(path, bytes).map_err(|cause| ExportError::Write { path: path.to_owned(), cause })
}
