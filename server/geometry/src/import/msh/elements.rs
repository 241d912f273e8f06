//! Element types of MSH files.

use crate::import::assemble::Shape;

/// An element type.
#[derive(Debug)]
pub(super) struct Element {
    /// Its number in MSH files.
    pub(super) code: i32,
    pub(super) name: &'static str,
    pub(super) n_nodes: usize,
    pub(super) kind: Kind,
}

/// Place of Gmsh's node `k` in the order of VTK, which names the middles of the edges 1-3 and 2-3 of a tetrahedron the other way
/// round.
pub(super) fn place(shape: Shape, k: usize) -> usize {
    match (shape, k) {
        (Shape::QuadraticTetrahedron, 8) => 9,
        (Shape::QuadraticTetrahedron, 9) => 8,
        _ => k,
    }
}

/// Import of an element type.
#[derive(Debug)]
pub(super) enum Kind {
    /// Read by its first nodes, as many as the shape has.
    Supported(Shape),
    /// Another volume of first order.
    OtherVolume,
    /// A volume with nodes on its edges.
    HighOrder,
}

impl Element {
    pub(super) fn by_code(code: i32) -> Option<&'static Self> {
        ELEMENTS.iter().find(|element| element.code == code)
    }

    pub(super) fn advice(&self) -> &'static str {
        match self.kind {
            Kind::HighOrder => {
                "save hexahedra with first order (in Gmsh Mesh.ElementOrder = 1, Mesh > Set order 1), tetrahedra with second"
            }
            _ => {
                "mesh with tetrahedra only, of second order (in Gmsh Mesh.ElementOrder = 2), or with hexahedra only (transfinite \
                 volumes or an extrusion with Recombine, or Mesh.SubdivisionAlgorithm = 2)"
            }
        }
    }
}

const fn supported(code: i32, name: &'static str, n_nodes: usize, shape: Shape) -> Element {
    Element { code, name, n_nodes, kind: Kind::Supported(shape) }
}

const fn other(code: i32, name: &'static str, n_nodes: usize) -> Element {
    Element { code, name, n_nodes, kind: Kind::OtherVolume }
}

const fn high(code: i32, name: &'static str, n_nodes: usize) -> Element {
    Element { code, name, n_nodes, kind: Kind::HighOrder }
}

/// Types that Gmsh writes up to third order; corners come first in each.
const ELEMENTS: [Element; 30] = [
    supported(15, "points", 1, Shape::Point),
    supported(1, "2-node lines", 2, Shape::Line),
    supported(8, "3-node lines", 3, Shape::CurvedLine),
    supported(26, "4-node lines", 4, Shape::Line),
    supported(27, "5-node lines", 5, Shape::Line),
    supported(2, "3-node triangles", 3, Shape::Triangle),
    supported(9, "6-node triangles", 6, Shape::CurvedTriangle),
    supported(20, "9-node triangles", 9, Shape::Triangle),
    supported(21, "10-node triangles", 10, Shape::Triangle),
    supported(3, "4-node quads", 4, Shape::Quad),
    supported(10, "9-node quads", 9, Shape::Quad),
    supported(16, "8-node quads", 8, Shape::Quad),
    supported(36, "16-node quads", 16, Shape::Quad),
    supported(5, "8-node hexahedra", 8, Shape::Hexahedron),
    supported(4, "4-node tetrahedra", 4, Shape::Tetrahedron),
    supported(11, "10-node tetrahedra", 10, Shape::QuadraticTetrahedron),
    other(6, "6-node prisms", 6),
    other(7, "5-node pyramids", 5),
    high(12, "27-node hexahedra (second order)", 27),
    high(13, "18-node prisms (second order)", 18),
    high(14, "14-node pyramids (second order)", 14),
    high(17, "20-node hexahedra (second order)", 20),
    high(18, "15-node prisms (second order)", 15),
    high(19, "13-node pyramids (second order)", 13),
    high(29, "20-node tetrahedra (third order)", 20),
    high(30, "35-node tetrahedra (fourth order)", 35),
    high(90, "40-node prisms (third order)", 40),
    high(92, "64-node hexahedra (third order)", 64),
    high(93, "125-node hexahedra (fourth order)", 125),
    high(118, "30-node pyramids (third order)", 30),
];
