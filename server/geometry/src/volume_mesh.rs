//! A mesh of one kind of volume elements.

use nalgebra::{Point3, Vector3};

use crate::face::Face;
use crate::hex_mesh::HexMesh;
use crate::index::{ElementIdx, HexIdx, NodeIdx};
use crate::isoparametric;
use crate::locate::locate;
use crate::tet_mesh::{TetMesh, Tets};
use crate::tetrahedron;

/// Hexahedra or tetrahedra.
#[derive(Clone, Debug, PartialEq)]
pub enum VolumeMesh {
    /// 8-node hexahedra.
    Hexahedra(HexMesh),
    /// Tetrahedra of 4 or of 10 nodes.
    Tetrahedra(TetMesh),
}

/// Kinds of elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementKind {
    /// 8-node hexahedron.
    Hexahedron,
    /// 4-node tetrahedron.
    LinearTetrahedron,
    /// 10-node tetrahedron.
    QuadraticTetrahedron,
}

/// A point of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElementPoint {
    /// The element.
    pub element: ElementIdx,
    /// Reference coordinates in it.
    pub xi: [f64; 3],
}

impl ElementKind {
    /// Name of several such elements.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Hexahedron => "hexahedra",
            Self::LinearTetrahedron => "4-node tetrahedra",
            Self::QuadraticTetrahedron => "10-node tetrahedra",
        }
    }
}

impl From<HexMesh> for VolumeMesh {
    fn from(mesh: HexMesh) -> Self {
        Self::Hexahedra(mesh)
    }
}

impl From<TetMesh> for VolumeMesh {
    fn from(mesh: TetMesh) -> Self {
        Self::Tetrahedra(mesh)
    }
}

impl VolumeMesh {
    /// The hexahedra, if these are the elements.
    pub fn hexahedra(&self) -> Option<&HexMesh> {
        match self {
            Self::Hexahedra(mesh) => Some(mesh),
            Self::Tetrahedra(_) => None,
        }
    }

    /// Kind of all elements.
    pub fn kind(&self) -> ElementKind {
        match self {
            Self::Hexahedra(_) => ElementKind::Hexahedron,
            Self::Tetrahedra(mesh) => match mesh.tets() {
                Tets::Linear(_) => ElementKind::LinearTetrahedron,
                Tets::Quadratic(_) => ElementKind::QuadraticTetrahedron,
            },
        }
    }

    /// Rest positions \[m\], `[n_nodes]`.
    pub fn nodes(&self) -> &[Point3<f64>] {
        match self {
            Self::Hexahedra(mesh) => mesh.nodes(),
            Self::Tetrahedra(mesh) => mesh.nodes(),
        }
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.nodes().len()
    }

    /// Number of elements.
    pub fn n_elements(&self) -> usize {
        match self {
            Self::Hexahedra(mesh) => mesh.n_hexes(),
            Self::Tetrahedra(mesh) => mesh.n_tets(),
        }
    }

    /// All elements by index.
    pub fn elements(&self) -> impl Iterator<Item = ElementIdx> + use<> {
        (0..self.n_elements()).map(ElementIdx::from_index)
    }

    /// Nodes of an element, corners first.
    pub fn nodes_of(&self, element: ElementIdx) -> &[NodeIdx] {
        match self {
            Self::Hexahedra(mesh) => &mesh.hexes()[element.index()],
            Self::Tetrahedra(mesh) => mesh.nodes_of(element),
        }
    }

    /// Positions of the corners of an element \[m\].
    pub fn corners_of(&self, element: ElementIdx) -> Vec<Point3<f64>> {
        let n_corners = if matches!(self, Self::Hexahedra(_)) { 8 } else { 4 };
        self.nodes_of(element)[..n_corners].iter().map(|node| self.nodes()[node.index()]).collect()
    }

    /// Mean of the corners of an element \[m\].
    pub fn centre_of(&self, element: ElementIdx) -> Point3<f64> {
        let corners = self.corners_of(element);
        Point3::from(corners.iter().map(|x| x.coords).sum::<Vector3<f64>>() / corners.len() as f64)
    }

    /// Volume \[m^3\].
    pub fn volume(&self) -> f64 {
        match self {
            Self::Hexahedra(mesh) => mesh.volume(),
            Self::Tetrahedra(mesh) => self.elements().map(|tet| tetrahedron::volume(&mesh.positions_of(tet))).sum(),
        }
    }

    /// Lower and upper corner of the bounding box of the nodes \[m\].
    pub fn bounds(&self) -> [Point3<f64>; 2] {
        let first = self.nodes()[0];
        let lower = self.nodes().iter().fold(first, |a, x| a.inf(x));
        [lower, self.nodes().iter().fold(first, |a, x| a.sup(x))]
    }

    /// Faces that belong to one element only, outward, in the order of the elements.
    pub fn boundary_faces(&self) -> Vec<Face> {
        match self {
            Self::Hexahedra(mesh) => mesh.boundary_quads().into_iter().map(Face::from).collect(),
            Self::Tetrahedra(mesh) => mesh.boundary_faces(),
        }
    }

    /// Body of every node, `[n_nodes]`, and the number of bodies: elements that share a node belong to one body. Bodies are
    /// numbered in the order of their first nodes.
    pub fn bodies(&self) -> (Vec<usize>, usize) {
        match self {
            Self::Hexahedra(mesh) => mesh.bodies(),
            Self::Tetrahedra(_) => self.bodies_by_elements(),
        }
    }

    /// Element that contains `x`, else the nearest one within `reach_m`; the point in it that is nearest.
    pub fn locate(&self, x: &Point3<f64>, reach_m: f64) -> Option<ElementPoint> {
        match self {
            Self::Hexahedra(mesh) => {
                let found = locate(mesh, x, reach_m)?;
                Some(ElementPoint { element: found.hex.into(), xi: found.xi.map(|c| c.clamp(-1.0, 1.0)) })
            }
            Self::Tetrahedra(mesh) => locate_in_tets(mesh, x, reach_m),
        }
    }

    /// Nodes with their shape functions at a point.
    pub fn weights_at(&self, point: &ElementPoint) -> Vec<(NodeIdx, f64)> {
        let nodes = self.nodes_of(point.element).iter().copied();
        match self {
            Self::Hexahedra(_) => nodes.zip(isoparametric::shape_functions(point.xi)).collect(),
            Self::Tetrahedra(_) => nodes.clone().zip(tetrahedron::shapes(nodes.len(), point.xi)).collect(),
        }
    }

    fn bodies_by_elements(&self) -> (Vec<usize>, usize) {
        let mut parent: Vec<usize> = (0..self.n_nodes()).collect();
        let root = |parent: &mut Vec<usize>, mut node: usize| {
            while parent[node] != node {
                parent[node] = parent[parent[node]];
                node = parent[node];
            }
            node
        };
        for element in self.elements() {
            let nodes = self.nodes_of(element);
            for pair in nodes.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|node| root(&mut parent, node.index()));
                // The least node is the root, so that bodies are numbered by their first nodes.
                parent[a.max(b)] = a.min(b);
            }
        }
        let mut number = vec![usize::MAX; self.n_nodes()];
        let mut n_bodies = 0;
        let body_of_node = (0..self.n_nodes()).map(|node| {
            let first = root(&mut parent, node);
            if number[first] == usize::MAX {
                number[first] = n_bodies;
                n_bodies += 1;
            }
            number[first]
        });
        let body_of_node = body_of_node.collect();
        (body_of_node, n_bodies)
    }
}

impl From<HexIdx> for ElementIdx {
    fn from(hex: HexIdx) -> Self {
        Self(hex.0)
    }
}

/// Rounding of barycentric coordinates.
const INSIDE_TOLERANCE: f64 = 1e-9;

fn locate_in_tets(mesh: &TetMesh, x: &Point3<f64>, reach_m: f64) -> Option<ElementPoint> {
    let mut nearest: Option<(f64, ElementPoint)> = None;
    for element in (0..mesh.n_tets()).map(ElementIdx::from_index) {
        let positions = mesh.positions_of(element);
        // Curved faces bulge beyond the box of the nodes by less than this.
        let slack = reach_m + 0.25 * tetrahedron::longest_edge(&positions);
        let is_near = (0..3).all(|k| {
            let along = positions.iter().map(|p| p[k]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c), h.max(c)));
            (low - slack..=high + slack).contains(&x[k])
        });
        let Some(xi) = is_near.then(|| tetrahedron::inverse_map(&positions, x)).flatten() else { continue };
        if tetrahedron::barycentric(xi).iter().all(|l| *l >= -INSIDE_TOLERANCE) {
            return Some(ElementPoint { element, xi: tetrahedron::clamped(xi) });
        }
        let xi = tetrahedron::clamped(xi);
        let distance = (tetrahedron::map(&positions, xi) - x).norm();
        if distance <= reach_m && nearest.is_none_or(|(least, _)| distance < least) {
            nearest = Some((distance, ElementPoint { element, xi }));
        }
    }
    nearest.map(|(_, point)| point)
}
