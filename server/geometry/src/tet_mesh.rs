//! A mesh of tetrahedra, all of 4 or all of 10 nodes, checked once on construction.

use std::collections::HashMap;

use nalgebra::Point3;

use crate::face::{Face, FaceCorners};
use crate::index::{ElementIdx, NodeIdx};
use crate::tetrahedron::{self, EDGES, FACES};

/// `det J` at a node must exceed this share of `longest_edge^3`.
const MIN_RELATIVE_DETERMINANT: f64 = 1e-9;

/// Nodes and tetrahedra; indices are valid, no node of an element sees it inverted, every node is used.
#[derive(Clone, Debug, PartialEq)]
pub struct TetMesh {
    nodes: Vec<Point3<f64>>,
    tets: Tets,
}

/// Tetrahedra by their nodes, in the order of [`crate::tetrahedron`].
#[derive(Clone, Debug, PartialEq)]
pub enum Tets {
    /// 4 nodes each.
    Linear(Vec<[NodeIdx; 4]>),
    /// 10 nodes each.
    Quadratic(Vec<[NodeIdx; 10]>),
}

/// Error of a mesh's nodes and tetrahedra.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TetMeshError {
    /// No tetrahedron.
    #[error("the mesh has no tetrahedra ({n_nodes} nodes)")]
    Empty {
        /// Number of nodes.
        n_nodes: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("node {node} has the non-finite position [{}, {}, {}]", position[0], position[1], position[2])]
    NonFinite {
        /// The node.
        node: NodeIdx,
        /// Its position \[m\].
        position: [f64; 3],
    },
    /// A tetrahedron names a node that does not exist.
    #[error("tetrahedron {tet} names node {node}, but there are {n_nodes} nodes")]
    NodeOutOfRange {
        /// The tetrahedron.
        tet: ElementIdx,
        /// The node named.
        node: NodeIdx,
        /// Number of nodes.
        n_nodes: usize,
    },
    /// A tetrahedron is inverted or flat at a node; a curved edge may do it.
    #[error(
        "tetrahedron {tet} has det J = {determinant:e} m^3 at its node {node}, it must exceed {limit:e} m^3: inverted or flat"
    )]
    Inverted {
        /// The tetrahedron.
        tet: ElementIdx,
        /// Its node, 0 to 9.
        node: usize,
        /// `det J` there \[m^3\].
        determinant: f64,
        /// Lower bound \[m^3\].
        limit: f64,
    },
    /// A node belongs to no tetrahedron.
    #[error("node {first} belongs to no tetrahedron")]
    UnusedNode {
        /// The first such node.
        first: NodeIdx,
    },
    /// More than two tetrahedra share a face.
    #[error("{n_tets} tetrahedra share the face with corners {}, {}, {} (two at most)", corners[0], corners[1], corners[2])]
    CrowdedFace {
        /// Its corners in increasing order.
        corners: [NodeIdx; 3],
        /// Number of tetrahedra that share it.
        n_tets: usize,
    },
}

impl Tets {
    fn len(&self) -> usize {
        match self {
            Self::Linear(tets) => tets.len(),
            Self::Quadratic(tets) => tets.len(),
        }
    }

    fn get(&self, tet: usize) -> &[NodeIdx] {
        match self {
            Self::Linear(tets) => &tets[tet],
            Self::Quadratic(tets) => &tets[tet],
        }
    }
}

impl TetMesh {
    /// Checks and takes `nodes` \[m\] and tetrahedra.
    ///
    /// # Errors
    /// See [`TetMeshError`]; the first fault found is named with its numbers.
    pub fn new(nodes: Vec<Point3<f64>>, tets: Tets) -> Result<Self, TetMeshError> {
        let mesh = Self { nodes, tets };
        mesh.check_nodes()?;
        mesh.check_indices()?;
        mesh.check_jacobians()?;
        mesh.check_faces()?;
        Ok(mesh)
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Number of tetrahedra.
    pub fn n_tets(&self) -> usize {
        self.tets.len()
    }

    /// Rest positions \[m\], `[n_nodes]`.
    pub fn nodes(&self) -> &[Point3<f64>] {
        &self.nodes
    }

    /// All tetrahedra.
    pub fn tets(&self) -> &Tets {
        &self.tets
    }

    /// Nodes of one tetrahedron, 4 or 10.
    pub fn nodes_of(&self, tet: ElementIdx) -> &[NodeIdx] {
        self.tets.get(tet.index())
    }

    /// Positions of the nodes of one tetrahedron \[m\], 4 or 10.
    pub fn positions_of(&self, tet: ElementIdx) -> Vec<Point3<f64>> {
        self.nodes_of(tet).iter().map(|node| self.nodes[node.index()]).collect()
    }

    /// Faces that belong to one tetrahedron only, outward, in the order of the tetrahedra.
    pub fn boundary_faces(&self) -> Vec<Face> {
        let counts = self.face_counts();
        self.faces().filter(|face| counts[&face.sorted_corners()] == 1).collect()
    }

    fn indices(&self) -> impl Iterator<Item = ElementIdx> + use<> {
        (0..self.n_tets()).map(ElementIdx::from_index)
    }

    fn faces(&self) -> impl Iterator<Item = Face> + '_ {
        self.indices().flat_map(|tet| FACES.map(|corners| face(self.nodes_of(tet), corners)))
    }

    fn face_counts(&self) -> HashMap<FaceCorners, usize> {
        let mut counts = HashMap::with_capacity(2 * self.n_tets());
        self.faces().for_each(|face| *counts.entry(face.sorted_corners()).or_insert(0) += 1);
        counts
    }

    fn check_nodes(&self) -> Result<(), TetMeshError> {
        if self.n_tets() == 0 {
            return Err(TetMeshError::Empty { n_nodes: self.n_nodes() });
        }
        match self.nodes.iter().position(|x| x.iter().any(|c| !c.is_finite())) {
            Some(i) => {
                Err(TetMeshError::NonFinite { node: NodeIdx::from_index(i), position: self.nodes[i].coords.into() })
            }
            None => Ok(()),
        }
    }

    fn check_indices(&self) -> Result<(), TetMeshError> {
        let n_nodes = self.n_nodes();
        let mut is_used = vec![false; n_nodes];
        for tet in self.indices() {
            for &node in self.nodes_of(tet) {
                match is_used.get_mut(node.index()) {
                    Some(used) => *used = true,
                    None => return Err(TetMeshError::NodeOutOfRange { tet, node, n_nodes }),
                }
            }
        }
        let unused = is_used.iter().position(|used| !used).map(NodeIdx::from_index);
        unused.map_or(Ok(()), |first| Err(TetMeshError::UnusedNode { first }))
    }

    fn check_jacobians(&self) -> Result<(), TetMeshError> {
        for tet in self.indices() {
            let positions = self.positions_of(tet);
            let limit = MIN_RELATIVE_DETERMINANT * tetrahedron::longest_edge(&positions).powi(3);
            for (node, &xi) in tetrahedron::NODES[..positions.len()].iter().enumerate() {
                let determinant = tetrahedron::jacobian(&positions, xi).determinant();
                let is_upright = determinant > limit;
                if !is_upright {
                    return Err(TetMeshError::Inverted { tet, node, determinant, limit });
                }
            }
        }
        Ok(())
    }

    fn check_faces(&self) -> Result<(), TetMeshError> {
        let crowded = self.face_counts().into_iter().filter(|&(_, count)| count > 2).min();
        crowded.map_or(Ok(()), |(face, n_tets)| {
            let corners = face.nodes();
            Err(TetMeshError::CrowdedFace { corners: [corners[0], corners[1], corners[2]], n_tets })
        })
    }
}

/// The face of a tetrahedron with the given corners.
fn face(nodes: &[NodeIdx], corners: [usize; 3]) -> Face {
    let at = corners.map(|corner| nodes[corner]);
    if nodes.len() == 4 {
        return Face::Triangle(at);
    }
    let middle = |a: usize, b: usize| {
        let edge = EDGES.iter().position(|edge| *edge == [a, b] || *edge == [b, a]);
        nodes[4 + edge.unwrap_or_default()]
    };
    let [a, b, c] = corners;
    Face::CurvedTriangle([at[0], at[1], at[2], middle(a, b), middle(b, c), middle(c, a)])
}
