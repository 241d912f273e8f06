//! Mesh files of hexahedra or tetrahedra with their named groups: VTU as ParaView and meshio write it, Gmsh's MSH 4.1 and 2.2.
//!
//! Both readers are written here: the crates for these formats either know no physical names and no MSH 2.2, or no raw
//! appended VTU data, and end the program on a truncated file. A file of any bytes gives a mesh or an [`ImportError`].

mod assemble;
mod check;
mod error;
mod groups;
mod merge;
mod msh;
mod named_mesh;
mod obj;
mod options;
mod text;
mod vtu;

use std::path::Path;

pub use error::{ImportError, Place};
pub use groups::{Group, Groups};
pub use named_mesh::{CellVectors, NamedMesh};
pub use obj::{ObjPart, parse_obj_parts};
pub use options::ReadOptions;

use error::{Fault, fault};

/// Reads a `.vtu` or `.msh` file of 8-node hexahedra, 4-node or 10-node tetrahedra.
///
/// Groups are the physical groups of Gmsh, by name or, without one, by number. In a VTU file a cell array with at most 256
/// different values makes a group `NAME=VALUE` of each, and so does a point array, of nodes. Cells of lower dimension (points,
/// lines, triangles, quads) lend their nodes to groups; those that are faces of elements are faces of the group too. Cell arrays
/// of three components are kept as vectors.
///
/// # Errors
/// [`ImportError`]: a file that cannot be read, is damaged, holds other or several kinds of volumes, or has parts that touch
/// without sharing nodes.
pub fn read_mesh(path: &Path, options: ReadOptions) -> Result<NamedMesh, ImportError> {
    let bytes = std::fs::read(path).map_err(|e| {
        let problem = format!("cannot be read: {e}");
        ImportError::new(path, Fault::new(Place::File, problem, "check the path of the mesh file"))
    })?;
    parse_mesh(path, &bytes, options)
}

/// [`read_mesh`] on the bytes of a file; `path` appears in messages only.
///
/// # Errors
/// As [`read_mesh`].
pub fn parse_mesh(path: &Path, bytes: &[u8], options: ReadOptions) -> Result<NamedMesh, ImportError> {
    parse(bytes, &options).map_err(|fault| ImportError::new(path, fault))
}

fn parse(bytes: &[u8], options: &ReadOptions) -> Result<NamedMesh, Fault> {
    let unit = options.metres_per_unit;
    if !(unit.is_finite() && unit > 0.0) {
        return fault(Place::File, format!("{unit} metres per unit"), "give a positive number: 1e-3 for mm");
    }
    let bytes = text::without_mark(bytes);
    let content = match bytes.trim_ascii_start() {
        text if text.starts_with(b"<") => vtu::parse(&bytes)?,
        text if msh::is_msh(text) => msh::parse(&bytes)?,
        _ => return fault(Place::File, "is neither a Gmsh (.msh) nor a VTU (.vtu) file", error::CONVERT),
    };
    let (content, merged) = merge::merge(content, options)?;
    let mut named = content.assemble(unit)?;
    named.remarks = merged;
    check::joints(&mut named, options)?;
    Ok(named)
}
