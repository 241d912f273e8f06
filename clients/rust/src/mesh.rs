//! Rest positions in world coordinates and triangles, from the mesh reply.

use gltf::Gltf;
use thiserror::Error;

/// Why a GLB is not a mesh of the protocol.
#[derive(Debug, Error)]
pub enum MeshError {
    /// Not a GLB file; the field is the text of the library that read it.
    #[error("not a GLB file of this project, or one cut short")]
    Gltf(String),
    /// No triangles with positions.
    #[error("the GLB has no mesh with positions")]
    Empty,
}

/// An object at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct RestMesh {
    /// Rest positions, as [`rest_positions`] returns them.
    pub positions_m: Vec<[f32; 3]>,
    /// Vertices of each triangle, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Rest positions `[n][3]` in metres, world frame (z up), in the order of the skin frames.
///
/// The root node of the GLB turns them to glTF's y up; its transform is not applied here.
pub fn rest_positions(glb: &[u8]) -> Result<Vec<[f32; 3]>, MeshError> {
    rest_mesh(glb).map(|mesh| mesh.positions_m)
}

/// Rest positions and triangles.
pub fn rest_mesh(glb: &[u8]) -> Result<RestMesh, MeshError> {
    let gltf = Gltf::from_slice(glb).map_err(|error| MeshError::Gltf(error.to_string()))?;
    let primitive = gltf.meshes().flat_map(|mesh| mesh.primitives()).next().ok_or(MeshError::Empty)?;
    let reader = primitive.reader(|_| gltf.blob.as_deref());
    let positions_m: Vec<_> = reader.read_positions().ok_or(MeshError::Empty)?.collect();
    let indices: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0..positions_m.len() as u32).collect(),
    };
    Ok(RestMesh { positions_m, triangles: indices.as_chunks().0.to_vec() })
}
