//! Named parts of a mesh.

use crate::face::FaceCorners;
use crate::index::{ElementIdx, NodeIdx};

/// Name of a part of the mesh in its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Group {
    /// Name; of an unnamed physical group of Gmsh, its number.
    pub name: String,
    /// 3 for volumes, 2 for surfaces, 1 for curves, 0 for points.
    pub dimension: u8,
    /// Nodes of its cells that belong to elements of the mesh, in increasing order.
    pub nodes: Vec<NodeIdx>,
    /// Its quads and triangles by their corners, in increasing order; for surfaces.
    pub faces: Vec<FaceCorners>,
    /// Its elements in increasing order; for volumes.
    pub elements: Vec<ElementIdx>,
}

/// All groups of a file, in file order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Groups {
    groups: Vec<Group>,
}

impl Groups {
    pub(super) fn new(groups: Vec<Group>) -> Self {
        Self { groups }
    }

    /// All groups.
    pub fn iter(&self) -> impl Iterator<Item = &Group> {
        self.groups.iter()
    }

    /// Group of volumes with that name.
    pub fn volume(&self, name: &str) -> Option<&Group> {
        self.iter().find(|group| group.name == name && group.dimension == 3)
    }

    /// Group of faces with that name.
    pub fn surface(&self, name: &str) -> Option<&Group> {
        self.iter().find(|group| group.name == name && group.dimension == 2)
    }

    /// Group with that name and the highest dimension below 3, else the volume: the group of a support or a probe.
    pub fn nodes(&self, name: &str) -> Option<&Group> {
        let named = self.iter().filter(|group| group.name == name);
        named.max_by_key(|group| if group.dimension == 3 { -1 } else { i32::from(group.dimension) })
    }
}
