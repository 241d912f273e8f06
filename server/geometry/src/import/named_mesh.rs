//! A mesh as it was read.

use super::groups::Groups;
use crate::hex_mesh::HexMesh;

/// Mesh with the named groups of its file.
#[derive(Clone, Debug)]
pub struct NamedMesh {
    /// Nodes \[m\] and hexahedra, in the order of the file; nodes that no hexahedron uses are left out.
    pub mesh: HexMesh,
    /// Named parts.
    pub groups: Groups,
    /// Sentences about the mesh that its user should read: nodes that were merged, parts that are not joined.
    pub remarks: Vec<String>,
}
