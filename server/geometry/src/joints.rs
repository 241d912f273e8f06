//! Places where parts of a mesh touch without being joined: several nodes at one point, nodes on a face that does not have them
//! as corners, faces that overlap, and hexahedra that share an edge or a corner and no face.
//!
//! Displacements are continuous across shared nodes and nowhere else: at such a place the mesh opens, slides or turns like a
//! hinge, and a solution on it is that of another body.

mod faces;
mod grid;
mod hinges;

use nalgebra::Point3;

use crate::hex_mesh::HexMesh;
use crate::index::ElementIdx;
use crate::tet_mesh::TetMesh;
use crate::volume_mesh::VolumeMesh;
use faces::Boundary;

/// Points of a mesh of one kind of trouble.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sites {
    /// Number of points.
    pub n: usize,
    /// The first of them, in the order of the mesh \[m\].
    pub first: Point3<f64>,
    /// Lower corner of the box around all of them \[m\].
    pub lower: Point3<f64>,
    /// Upper corner of the box around all of them \[m\].
    pub upper: Point3<f64>,
}

/// Where hexahedra of a mesh touch without being joined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Joints {
    /// Points at which several nodes lie.
    pub coincident: Option<Sites>,
    /// Largest distance between two nodes at one point \[m\].
    pub widest_gap_m: f64,
    /// Nodes on a face of another hexahedron which does not have them as corners: hanging nodes, faces that do not match.
    pub hanging: Option<Sites>,
    /// Centres of faces that overlap another face without a node of one on the other.
    pub overlapping: Option<Sites>,
    /// Nodes before a face that they do not touch, closer than a tenth of an edge.
    pub near: Option<Sites>,
    /// Nodes by which parts hang together that share no face.
    pub hinged: Option<Sites>,
    /// Nodes at which hexahedra of one part meet without sharing a face there.
    pub pinched: Option<Sites>,
    /// Parts that share no face with each other.
    pub n_parts: usize,
    /// Shortest edge of the mesh \[m\].
    pub shortest_edge_m: f64,
}

impl Joints {
    /// Looks through a mesh of any elements: of tetrahedra for nodes at one place, of hexahedra for everything.
    pub fn of_volume(mesh: &VolumeMesh) -> Self {
        match mesh {
            VolumeMesh::Hexahedra(mesh) => Self::find(mesh),
            VolumeMesh::Tetrahedra(mesh) => {
                let sizes = shortest_distances(mesh);
                let twins = grid::coincident(mesh.nodes(), &sizes);
                let at_node = |node: &u32| mesh.nodes()[*node as usize];
                Self {
                    coincident: Sites::around(twins.firsts.iter().map(at_node)),
                    widest_gap_m: twins.widest_gap_m,
                    shortest_edge_m: sizes.iter().copied().fold(f64::INFINITY, f64::min),
                    n_parts: 1,
                    ..Self::default()
                }
            }
        }
    }

    /// Looks through a mesh; time and memory grow with the number of hexahedra, not with its square.
    ///
    /// Nodes at one point are reported, and count as one for everything else.
    pub fn find(mesh: &HexMesh) -> Self {
        let sizes = shortest_edges(mesh);
        let twins = grid::coincident(mesh.nodes(), &sizes);
        let boundary = Boundary::new(mesh, &sizes, &twins.first_of_node);
        let touching = boundary.touching();
        let is_matched = touching.hanging.is_empty() && touching.overlapping.is_empty();
        let at_node = |node: &u32| mesh.nodes()[*node as usize];
        let hinges = hinges::find(mesh, &twins.first_of_node);
        // Where faces do not match, the corners that they do share are not the trouble.
        let hinge = |nodes: &[u32]| if is_matched { Sites::around(nodes.iter().map(at_node)) } else { None };
        Self {
            coincident: Sites::around(twins.firsts.iter().map(at_node)),
            widest_gap_m: twins.widest_gap_m,
            hanging: Sites::around(touching.hanging.iter().map(at_node)),
            overlapping: Sites::around(touching.overlapping.iter().copied()),
            near: Sites::around(touching.near.iter().map(at_node)),
            hinged: hinge(&hinges.hinged),
            pinched: hinge(&hinges.pinched),
            n_parts: hinges.n_parts,
            shortest_edge_m: sizes.iter().copied().fold(f64::INFINITY, f64::min),
        }
    }
}

impl Sites {
    fn around(points: impl Iterator<Item = Point3<f64>>) -> Option<Self> {
        points.fold(None, |sites: Option<Self>, x| {
            let Self { n, first, lower, upper } = sites.unwrap_or(Self { n: 0, first: x, lower: x, upper: x });
            Some(Self { n: n + 1, first, lower: lower.inf(&x), upper: upper.sup(&x) })
        })
    }
}

/// Shortest distance between two nodes of the tetrahedra around each node \[m\].
fn shortest_distances(mesh: &TetMesh) -> Vec<f64> {
    let mut sizes = vec![f64::INFINITY; mesh.n_nodes()];
    for tet in (0..mesh.n_tets()).map(ElementIdx::from_index) {
        let x = mesh.positions_of(tet);
        let pairs = (1..x.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
        let shortest = pairs.map(|(a, b)| (x[a] - x[b]).norm()).fold(f64::INFINITY, f64::min);
        for node in mesh.nodes_of(tet) {
            let size = &mut sizes[node.index()];
            *size = size.min(shortest);
        }
    }
    sizes
}

/// Shortest edge of the hexahedra around each node \[m\].
fn shortest_edges(mesh: &HexMesh) -> Vec<f64> {
    const EDGES: [[usize; 2]; 12] =
        [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
    let mut sizes = vec![f64::INFINITY; mesh.n_nodes()];
    for (hex, corners) in mesh.hex_indices().zip(mesh.hexes()) {
        let x = mesh.corner_positions(hex);
        let shortest = EDGES.iter().map(|&[a, b]| (x[b] - x[a]).norm()).fold(f64::INFINITY, f64::min);
        for node in corners {
            let size = &mut sizes[node.index()];
            *size = size.min(shortest);
        }
    }
    sizes
}
