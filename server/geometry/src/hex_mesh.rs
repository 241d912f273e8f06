//! A hexahedral mesh, checked once on construction.

use std::collections::HashMap;

use nalgebra::Point3;

use crate::index::{HexIdx, NodeIdx};
use crate::isoparametric;

/// The six faces of a hexahedron as corner numbers, counter-clockwise seen from outside.
pub const HEX_FACES: [[usize; 4]; 6] =
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

/// A corner's `det J` must exceed this share of `longest_edge^3`: below it, rounding hides whether the element is flat.
const MIN_RELATIVE_DETERMINANT: f64 = 1e-9;

/// Nodes and hexahedra; indices are valid, corners are not inverted, every node is used.
#[derive(Clone, Debug, PartialEq)]
pub struct HexMesh {
    nodes: Vec<Point3<f64>>,
    hexes: Vec<[NodeIdx; 8]>,
}

/// Error of a mesh's nodes and hexahedra.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No hexahedron.
    #[error("the mesh has no hexahedra ({n_nodes} nodes)")]
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
    /// A hexahedron names a node that does not exist.
    #[error("hexahedron {hex} corner {corner} names node {node}, but there are {n_nodes} nodes")]
    NodeOutOfRange {
        /// The hexahedron.
        hex: HexIdx,
        /// Its corner, 0 to 7.
        corner: usize,
        /// The node named there.
        node: NodeIdx,
        /// Number of nodes.
        n_nodes: usize,
    },
    /// A hexahedron is inverted or flat at a corner (wrong corner order is the usual cause).
    #[error(
        "hexahedron {hex} corner {corner} has det J = {determinant:e} m^3, it must exceed {limit:e} m^3: inverted, \
         flat or not in VTK corner order"
    )]
    Inverted {
        /// The hexahedron.
        hex: HexIdx,
        /// Its corner, 0 to 7.
        corner: usize,
        /// `det J` there \[m^3\].
        determinant: f64,
        /// Lower bound \[m^3\].
        limit: f64,
    },
    /// A node belongs to no hexahedron.
    #[error("node {first} belongs to no hexahedron ({n_unused} such nodes of {n_nodes})")]
    UnusedNodes {
        /// The first such node.
        first: NodeIdx,
        /// Number of such nodes.
        n_unused: usize,
        /// Number of nodes.
        n_nodes: usize,
    },
    /// More than two hexahedra share a face.
    #[error("{n_hexes} hexahedra share the face with nodes {}, {}, {}, {} (two at most)", face[0], face[1], face[2], face[3])]
    CrowdedFace {
        /// The face's nodes in increasing order.
        face: [NodeIdx; 4],
        /// Number of hexahedra that share it.
        n_hexes: usize,
    },
}

impl HexMesh {
    /// Checks and takes `nodes` \[m\] and `hexes` (`VTK_HEXAHEDRON` corner order).
    ///
    /// # Errors
    /// See [`MeshError`]; the first fault found is named with its numbers.
    pub fn new(nodes: Vec<Point3<f64>>, hexes: Vec<[NodeIdx; 8]>) -> Result<Self, MeshError> {
        let mesh = Self { nodes, hexes };
        mesh.check_nodes()?;
        mesh.check_indices()?;
        mesh.check_jacobians()?;
        mesh.check_use()?;
        mesh.check_faces()?;
        Ok(mesh)
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Number of hexahedra.
    pub fn n_hexes(&self) -> usize {
        self.hexes.len()
    }

    /// Rest positions \[m\], `[n_nodes]`.
    pub fn nodes(&self) -> &[Point3<f64>] {
        &self.nodes
    }

    /// Corner nodes in `VTK_HEXAHEDRON` order, `[n_hexes]`.
    pub fn hexes(&self) -> &[[NodeIdx; 8]] {
        &self.hexes
    }

    /// Corner positions of one hexahedron \[m\].
    pub fn corner_positions(&self, hex: HexIdx) -> [Point3<f64>; 8] {
        self.hexes[hex.index()].map(|node| self.nodes[node.index()])
    }

    /// All hexahedra by index.
    pub fn hex_indices(&self) -> impl Iterator<Item = HexIdx> + use<> {
        (0..self.hexes.len()).map(HexIdx::from_index)
    }

    /// Volume \[m^3\].
    pub fn volume(&self) -> f64 {
        self.hex_indices().map(|hex| isoparametric::volume(&self.corner_positions(hex))).sum()
    }

    /// Lower and upper corner of the bounding box \[m\].
    pub fn bounds(&self) -> [Point3<f64>; 2] {
        let first = self.nodes[0];
        let lower = self.nodes.iter().fold(first, |a, x| a.inf(x));
        [lower, self.nodes.iter().fold(first, |a, x| a.sup(x))]
    }

    /// Area of a face \[m^2\]: the integral of `|dX/dxi x dX/deta|` by 2 x 2 Gauss points.
    pub fn quad_area(&self, quad: &[NodeIdx; 4]) -> f64 {
        isoparametric::quad_area(&quad.map(|node| self.nodes[node.index()]))
    }

    /// Mean over the hexahedra of the longest edge \[m\]: the mesh's cell size.
    pub fn mean_longest_edge(&self) -> f64 {
        let sum: f64 = self.hex_indices().map(|hex| isoparametric::longest_edge(&self.corner_positions(hex))).sum();
        sum / self.n_hexes() as f64
    }

    /// Faces that belong to one hexahedron only, outward (counter-clockwise seen from outside), in the order of
    /// the hexahedra.
    pub fn boundary_quads(&self) -> Vec<[NodeIdx; 4]> {
        let counts = self.face_counts();
        self.faces().filter(|face| counts[&sorted(*face)] == 1).collect()
    }

    /// Hexahedra around every node, in increasing order, `[n_nodes]`.
    pub fn hexes_around_nodes(&self) -> Vec<Vec<HexIdx>> {
        let mut around = vec![Vec::new(); self.n_nodes()];
        for (hex, corners) in self.hexes.iter().enumerate() {
            for node in corners {
                around[node.index()].push(HexIdx::from_index(hex));
            }
        }
        around
    }

    /// Other nodes of the hexahedra around every node, in increasing order, `[n_nodes]`.
    pub fn node_neighbours(&self) -> Vec<Vec<NodeIdx>> {
        let mut neighbours = vec![Vec::new(); self.n_nodes()];
        for corners in &self.hexes {
            for &node in corners {
                neighbours[node.index()].extend(corners.iter().copied().filter(|&other| other != node));
            }
        }
        for list in &mut neighbours {
            list.sort_unstable();
            list.dedup();
        }
        neighbours
    }

    /// Body of every node, `[n_nodes]`, and the number of bodies: hexahedra that share a node belong to one body.
    /// Bodies are numbered in the order of their first nodes.
    pub fn bodies(&self) -> (Vec<usize>, usize) {
        let neighbours = self.node_neighbours();
        let mut body_of_node = vec![usize::MAX; self.n_nodes()];
        let mut n_bodies = 0;
        for first in 0..self.n_nodes() {
            if body_of_node[first] != usize::MAX {
                continue;
            }
            body_of_node[first] = n_bodies;
            let mut waiting = vec![first];
            while let Some(node) = waiting.pop() {
                for next in neighbours[node].iter().map(|next| next.index()) {
                    if body_of_node[next] == usize::MAX {
                        body_of_node[next] = n_bodies;
                        waiting.push(next);
                    }
                }
            }
            n_bodies += 1;
        }
        (body_of_node, n_bodies)
    }

    fn faces(&self) -> impl Iterator<Item = [NodeIdx; 4]> + '_ {
        self.hexes.iter().flat_map(|corners| HEX_FACES.map(|face| face.map(|corner| corners[corner])))
    }

    fn face_counts(&self) -> HashMap<[NodeIdx; 4], usize> {
        let mut counts = HashMap::with_capacity(3 * self.hexes.len());
        for face in self.faces() {
            *counts.entry(sorted(face)).or_insert(0) += 1;
        }
        counts
    }

    fn check_nodes(&self) -> Result<(), MeshError> {
        if self.hexes.is_empty() {
            return Err(MeshError::Empty { n_nodes: self.n_nodes() });
        }
        match self.nodes.iter().position(|x| x.iter().any(|c| !c.is_finite())) {
            Some(i) => {
                Err(MeshError::NonFinite { node: NodeIdx::from_index(i), position: self.nodes[i].coords.into() })
            }
            None => Ok(()),
        }
    }

    fn check_indices(&self) -> Result<(), MeshError> {
        let n_nodes = self.n_nodes();
        for (hex, corners) in self.hexes.iter().enumerate() {
            if let Some(corner) = corners.iter().position(|node| node.index() >= n_nodes) {
                let (hex, node) = (HexIdx::from_index(hex), corners[corner]);
                return Err(MeshError::NodeOutOfRange { hex, corner, node, n_nodes });
            }
        }
        Ok(())
    }

    fn check_jacobians(&self) -> Result<(), MeshError> {
        for hex in self.hex_indices() {
            let positions = self.corner_positions(hex);
            let limit = MIN_RELATIVE_DETERMINANT * isoparametric::longest_edge(&positions).powi(3);
            for (corner, xi) in isoparametric::CORNERS.into_iter().enumerate() {
                let determinant = isoparametric::jacobian(&positions, xi).determinant();
                let is_upright = determinant > limit;
                if !is_upright {
                    return Err(MeshError::Inverted { hex, corner, determinant, limit });
                }
            }
        }
        Ok(())
    }

    fn check_use(&self) -> Result<(), MeshError> {
        let n_nodes = self.n_nodes();
        let mut used = vec![false; n_nodes];
        self.hexes.iter().flatten().for_each(|node| used[node.index()] = true);
        match used.iter().position(|&u| !u) {
            Some(first) => Err(MeshError::UnusedNodes {
                first: NodeIdx::from_index(first),
                n_unused: used.iter().filter(|&&u| !u).count(),
                n_nodes,
            }),
            None => Ok(()),
        }
    }

    fn check_faces(&self) -> Result<(), MeshError> {
        match self.face_counts().into_iter().filter(|&(_, count)| count > 2).min() {
            Some((face, n_hexes)) => Err(MeshError::CrowdedFace { face, n_hexes }),
            None => Ok(()),
        }
    }
}

fn sorted(mut face: [NodeIdx; 4]) -> [NodeIdx; 4] {
    face.sort_unstable();
    face
}
