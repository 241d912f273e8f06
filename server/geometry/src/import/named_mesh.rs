//! A mesh as it was read.

use nalgebra::Vector3;

use super::groups::Groups;
use crate::volume_mesh::VolumeMesh;

/// Mesh with the named groups of its file.
#[derive(Clone, Debug)]
pub struct NamedMesh {
    /// Nodes \[m\] and elements, in the order of the file; nodes that no element uses are left out.
    pub mesh: VolumeMesh,
    /// Named parts.
    pub groups: Groups,
    /// Sentences about the mesh that its user should read: nodes that were merged, parts that are not joined.
    pub remarks: Vec<String>,
    /// Arrays of one vector per element.
    pub vectors: Vec<CellVectors>,
}

/// A named array of one vector per element, in the unit of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellVectors {
    /// Name in the file.
    pub name: String,
    /// Vectors, `[n_elements]`.
    pub values: Vec<Vector3<f64>>,
}
