//! Mesh files of hexahedra with their named groups: VTU as ParaView and meshio write it, Gmsh's MSH 4.1 and 2.2.
//!
//! Both readers are written here: the crates for these formats either know no physical names and no MSH 2.2, or no raw
//! appended VTU data, and end the program on a truncated file. A file of any bytes gives a mesh or an [`ImportError`].

mod assemble;
mod error;
mod groups;
mod msh;
mod obj;
mod vtu;

use std::path::Path;

use crate::hex_mesh::HexMesh;
pub use error::{ImportError, Place};
pub use groups::{Group, Groups};
pub use obj::parse_obj_parts;

use error::{Fault, fault};

/// Mesh with the named groups of its file.
#[derive(Clone, Debug)]
pub struct NamedMesh {
    /// Nodes \[m\] and hexahedra, in the order of the file; nodes that no hexahedron uses are left out.
    pub mesh: HexMesh,
    /// Named parts.
    pub groups: Groups,
}

/// Reads a `.vtu` or `.msh` file of 8-node hexahedra whose unit of length is `metres_per_unit` \[m\].
///
/// Groups are the physical groups of Gmsh, by name or, without one, by number. In a VTU file a cell array with at most 256
/// different values makes a group `NAME=VALUE` of each, and so does a point array, of nodes. Cells of lower dimension (points,
/// lines, triangles, quads) lend their nodes to groups; quads that are faces of hexahedra are faces of the group too.
///
/// # Errors
/// [`ImportError`]: a file that cannot be read, is damaged, or holds other volumes than 8-node hexahedra.
pub fn read_mesh(path: &Path, metres_per_unit: f64) -> Result<NamedMesh, ImportError> {
    let bytes = std::fs::read(path).map_err(|e| {
        let problem = format!("cannot be read: {e}");
        ImportError::new(path, Fault::new(Place::File, problem, "check the path of the mesh file"))
    })?;
    parse_mesh(path, &bytes, metres_per_unit)
}

/// [`read_mesh`] on the bytes of a file; `path` appears in messages only.
///
/// # Errors
/// As [`read_mesh`].
pub fn parse_mesh(path: &Path, bytes: &[u8], metres_per_unit: f64) -> Result<NamedMesh, ImportError> {
    parse(bytes, metres_per_unit).map_err(|fault| ImportError::new(path, fault))
}

fn parse(bytes: &[u8], metres_per_unit: f64) -> Result<NamedMesh, Fault> {
    if !(metres_per_unit.is_finite() && metres_per_unit > 0.0) {
        return fault(Place::File, format!("{metres_per_unit} metres per unit"), "give a positive number: 1e-3 for mm");
    }
    let content = match bytes.trim_ascii_start() {
        text if text.starts_with(b"$") => msh::parse(bytes)?,
        text if text.starts_with(b"<") => vtu::parse(bytes)?,
        _ => return fault(Place::File, "is neither a Gmsh (.msh) nor a VTU (.vtu) file", error::CONVERT),
    };
    content.assemble(metres_per_unit)
}
