//! Tetrahedra of 4 and 10 nodes as elements of a solid.

use plica_geometry::tetrahedron::{
    CENTROID, QUADRATURE, barycentric, linear_gradients, quadratic_gradients, quadratic_shapes,
};
use plica_geometry::{ElementIdx, TetMesh};

use super::element::{Element, Reference};
use crate::material::Law;

/// Volume of the reference simplex.
const SIMPLEX: f64 = 1.0 / 6.0;

/// One Gauss point: the strain is constant.
const LINEAR: Reference<4, 1> = Reference {
    points: [CENTROID],
    weight: SIMPLEX,
    shapes: barycentric,
    shape_gradients: linear_gradients,
    centre: CENTROID,
};

/// Four Gauss points: as many as a linear strain needs.
const QUADRATIC: Reference<10, 4> = Reference {
    points: QUADRATURE,
    weight: SIMPLEX / 4.0,
    shapes: quadratic_shapes,
    shape_gradients: quadratic_gradients,
    centre: CENTROID,
};

impl Element<4, 1> {
    /// A tetrahedron of a mesh of 4-node ones.
    pub(super) fn linear(mesh: &TetMesh, tet: ElementIdx, law: Law) -> Self {
        let nodes = mesh.nodes_of(tet);
        let nodes = std::array::from_fn(|a| nodes[a]);
        Self::new(&LINEAR, nodes, nodes.map(|node| mesh.nodes()[node.index()].coords), law)
    }
}

impl Element<10, 4> {
    /// A tetrahedron of a mesh of 10-node ones.
    pub(super) fn quadratic(mesh: &TetMesh, tet: ElementIdx, law: Law) -> Self {
        let nodes = mesh.nodes_of(tet);
        let nodes = std::array::from_fn(|a| nodes[a]);
        Self::new(&QUADRATIC, nodes, nodes.map(|node| mesh.nodes()[node.index()].coords), law)
    }
}
