//! Faces of volume elements.

use crate::index::NodeIdx;

/// Face of an element, outward: counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Face {
    /// Bilinear quadrilateral.
    Quad([NodeIdx; 4]),
    /// Plane triangle.
    Triangle([NodeIdx; 3]),
    /// Quadratic triangle: corners `a`, `b`, `c`, then the nodes on the edges `ab`, `bc`, `ca`.
    CurvedTriangle([NodeIdx; 6]),
}

/// Corners of a face in increasing order: equal for the two elements that share it, whatever their order of nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FaceCorners([NodeIdx; 4]);

/// Place of the fourth corner of a triangle.
const NO_CORNER: NodeIdx = NodeIdx(u32::MAX);

impl Face {
    /// All nodes, the corners first.
    pub fn nodes(&self) -> &[NodeIdx] {
        match self {
            Self::Quad(nodes) => nodes,
            Self::Triangle(nodes) => nodes,
            Self::CurvedTriangle(nodes) => nodes,
        }
    }

    /// Corners.
    pub fn corners(&self) -> &[NodeIdx] {
        match self {
            Self::Quad(nodes) => nodes,
            Self::Triangle(nodes) => nodes,
            Self::CurvedTriangle(nodes) => &nodes[..3],
        }
    }

    /// Corners, comparable.
    pub fn sorted_corners(&self) -> FaceCorners {
        FaceCorners::new(self.corners())
    }
}

impl From<[NodeIdx; 4]> for Face {
    fn from(nodes: [NodeIdx; 4]) -> Self {
        Self::Quad(nodes)
    }
}

impl FaceCorners {
    /// From three or four corners in any order.
    ///
    /// # Panics
    /// If there are more than four.
    pub fn new(corners: &[NodeIdx]) -> Self {
        let mut sorted = [NO_CORNER; 4];
        sorted[..corners.len()].copy_from_slice(corners);
        sorted.sort_unstable();
        Self(sorted)
    }

    /// The corners in increasing order.
    pub fn nodes(&self) -> &[NodeIdx] {
        let n = if self.0[3] == NO_CORNER { 3 } else { 4 };
        &self.0[..n]
    }
}
