//! From the nodes, cells and labels of a file to a checked mesh with groups.

use std::collections::{BTreeMap, HashMap};

use nalgebra::Point3;

use super::error::{DAMAGED, Fault, Place, fault};
use super::groups::{Group, Groups};
use super::named_mesh::{CellVectors, NamedMesh};
use crate::face::FaceCorners;
use crate::hex_mesh::{HexMesh, MeshError};
use crate::index::{ElementIdx, NodeIdx};
use crate::isoparametric;
use crate::tet_mesh::{TetMesh, TetMeshError, Tets};
use crate::volume_mesh::VolumeMesh;

/// Content of a mesh file, independent of its format.
#[derive(Debug, Default)]
pub(super) struct Content {
    /// Positions in the unit of the file.
    pub(super) points: Vec<Point3<f64>>,
    pub(super) cells: Vec<Cell>,
    /// Labels of cells: name, dimension, cells.
    pub(super) cell_labels: Vec<(String, u8, Vec<usize>)>,
    /// Labels of points.
    pub(super) point_labels: Vec<(String, Vec<usize>)>,
    /// Where the points of each piece of the file begin; empty for a file of one piece.
    pub(super) pieces: Vec<usize>,
    /// Arrays of one vector per cell.
    pub(super) cell_vectors: Vec<CellVectors>,
}

/// Volumes that are read.
pub(super) const READ: &str = "8-node hexahedra, 4-node and 10-node tetrahedra";

/// Most nodes of a cell.
pub(super) const MAX_NODES: usize = 10;

/// A cell by its nodes, which index `points`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) shape: Shape,
    pub(super) nodes: [u32; MAX_NODES],
    /// Name in the file.
    pub(super) number: u64,
}

/// Supported shapes. Of second-order cells of less than three dimensions those are read with the nodes on their edges that are
/// faces and edges of tetrahedra, the others by their corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Point,
    Line,
    CurvedLine,
    Triangle,
    CurvedTriangle,
    Quad,
    Hexahedron,
    Tetrahedron,
    QuadraticTetrahedron,
}

impl Shape {
    pub(super) fn n_nodes(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line => 2,
            Self::CurvedLine | Self::Triangle => 3,
            Self::Quad | Self::Tetrahedron => 4,
            Self::CurvedTriangle => 6,
            Self::Hexahedron => 8,
            Self::QuadraticTetrahedron => 10,
        }
    }

    /// Corners of a face; `None` of other shapes.
    fn n_face_corners(self) -> Option<usize> {
        match self {
            Self::Triangle | Self::CurvedTriangle => Some(3),
            Self::Quad => Some(4),
            _ => None,
        }
    }

    /// Name of several such volumes.
    pub(super) fn plural(self) -> &'static str {
        match self {
            Self::Tetrahedron => "4-node tetrahedra",
            Self::QuadraticTetrahedron => "10-node tetrahedra",
            _ => "hexahedra",
        }
    }

    /// Name of one such volume.
    pub(super) fn singular(self) -> &'static str {
        if self == Self::Hexahedron { "hexahedron" } else { "tetrahedron" }
    }

    pub(super) fn dimension(self) -> u8 {
        match self {
            Self::Point => 0,
            Self::Line | Self::CurvedLine => 1,
            Self::Triangle | Self::CurvedTriangle | Self::Quad => 2,
            Self::Hexahedron | Self::Tetrahedron | Self::QuadraticTetrahedron => 3,
        }
    }
}

impl Cell {
    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes[..self.shape.n_nodes()]
    }

    fn is_volume(&self) -> bool {
        self.shape.dimension() == 3
    }

    fn sorted_nodes(&self) -> [u32; MAX_NODES] {
        let mut nodes = self.nodes;
        nodes[..self.shape.n_nodes()].sort_unstable();
        nodes
    }
}

/// Mesh indices of the points and cells of a file.
struct Places {
    node_of_point: Vec<Option<NodeIdx>>,
    /// Volumes only; a volume given twice (once per physical group in MSH 2.2) is one.
    element_of_cell: HashMap<usize, ElementIdx>,
}

impl Content {
    pub(super) fn assemble(self, metres_per_unit: f64) -> Result<NamedMesh, Fault> {
        let shape = self.volume_shape()?;
        let (numbers, places) = self.place();
        let used = self.points.iter().zip(&places.node_of_point).filter(|(_, node)| node.is_some());
        let nodes = used.map(|(x, _)| x * metres_per_unit).collect();
        let mesh = match shape {
            Shape::Tetrahedron => self.tets(nodes, &numbers, Tets::Linear(self.elements(&numbers, &places)))?.into(),
            Shape::QuadraticTetrahedron => {
                self.tets(nodes, &numbers, Tets::Quadratic(self.elements(&numbers, &places)))?.into()
            }
            _ => {
                let hexes = self.elements(&numbers, &places);
                VolumeMesh::from(HexMesh::new(nodes, hexes).map_err(|error| self.mesh_fault(&error, &numbers))?)
            }
        };
        let groups = self.groups(&places);
        let of_elements = |vectors: &CellVectors| CellVectors {
            name: vectors.name.clone(),
            values: numbers.iter().map(|&cell| vectors.values.get(cell).copied().unwrap_or_default()).collect(),
        };
        let vectors = self.cell_vectors.iter().map(of_elements).collect();
        Ok(NamedMesh { mesh, groups, remarks: Vec::new(), vectors })
    }

    /// The one shape of all volumes. Beside each other, faces of different shapes would not match.
    fn volume_shape(&self) -> Result<Shape, Fault> {
        let mut volumes = self.cells.iter().filter(|cell| cell.is_volume());
        let Some(first) = volumes.next() else { return self.no_volume() };
        if let Some(other) = volumes.find(|cell| cell.shape != first.shape) {
            let n = |shape: Shape| self.cells.iter().filter(|cell| cell.shape == shape).count();
            let [one, two] = [first.shape, other.shape].map(|shape| format!("{} {}", n(shape), shape.plural()));
            let advice =
                format!("mesh the whole body with one of {READ}: without the others the body would have holes");
            let place = Place::Field(format!("cell {}", other.number), None);
            return fault(place, format!("holds {two} beside {one}; one kind is read"), advice);
        }
        Ok(first.shape)
    }

    /// Volumes of the mesh, and mesh indices of all points and cells.
    fn place(&self) -> (Vec<usize>, Places) {
        let mut seen = HashMap::new();
        let mut element_of_cell = HashMap::new();
        let mut numbers = Vec::new();
        let mut is_used = vec![false; self.points.len()];
        for (i, cell) in self.cells.iter().enumerate().filter(|(_, cell)| cell.is_volume()) {
            let element = *seen.entry(cell.sorted_nodes()).or_insert_with(|| {
                numbers.push(i);
                ElementIdx::from_index(numbers.len() - 1)
            });
            element_of_cell.insert(i, element);
            cell.nodes().iter().for_each(|&point| is_used[point as usize] = true);
        }
        let mut nodes = (0..).map(NodeIdx);
        let node_of_point = is_used.into_iter().map(|used| if used { nodes.next() } else { None }).collect();
        (numbers, Places { node_of_point, element_of_cell })
    }

    fn no_volume<T>(&self) -> Result<T, Fault> {
        let n_surface = self.cells.iter().filter(|cell| cell.shape.dimension() == 2).count();
        if n_surface > 0 {
            let problem =
                format!("holds {n_surface} triangles or quads and no hexahedra or tetrahedra: it is a surface");
            return fault(Place::File, problem, "fill its inside with 8-node hexahedra or 10-node tetrahedra");
        }
        let problem =
            format!("holds no hexahedra or tetrahedra ({} points, {} cells)", self.points.len(), self.cells.len());
        fault(Place::File, problem, "save the volume mesh; in Gmsh: mesh in 3D, and put the volume in a physical group")
    }

    /// Nodes of volumes of `N` nodes.
    fn elements<const N: usize>(&self, numbers: &[usize], places: &Places) -> Vec<[NodeIdx; N]> {
        let node = |point: u32| places.node_of_point[point as usize].unwrap_or_default();
        numbers.iter().map(|&cell| std::array::from_fn(|k| node(self.cells[cell].nodes[k]))).collect()
    }

    fn tets(&self, nodes: Vec<Point3<f64>>, numbers: &[usize], tets: Tets) -> Result<TetMesh, Fault> {
        TetMesh::new(nodes, tets).map_err(|error| match &error {
            TetMeshError::Inverted { tet, .. } => {
                let cell = format!("cell {}", self.cells[numbers[tet.index()]].number);
                let advice = "turn mirrored tetrahedra round; where a curved edge turns one over, refine there or optimise the \
                              mesh (in Gmsh Mesh.HighOrderOptimize = 2)";
                Fault::new(Place::Field(cell, None), error.to_string(), advice)
            }
            TetMeshError::NonFinite { .. } => Fault::new(Place::File, error.to_string(), DAMAGED),
            _ => Fault::new(Place::File, error.to_string(), "mend the mesh: every face belongs to one or two tetrahedra"),
        })
    }

    fn mesh_fault(&self, error: &MeshError, numbers: &[usize]) -> Fault {
        let advice = match error {
            MeshError::Inverted { .. } => "untangle the mesh, or turn mirrored hexahedra round",
            MeshError::NonFinite { .. } => DAMAGED,
            _ => "mend the mesh: every face belongs to one or two hexahedra",
        };
        let (place, count) = match error {
            MeshError::Inverted { hex, .. } => {
                let cell = format!("cell {}", self.cells[numbers[hex.index()]].number);
                (
                    Place::Field(cell, None),
                    format!(" ({} of {} hexahedra)", self.count_inverted(numbers), numbers.len()),
                )
            }
            _ => (Place::File, String::new()),
        };
        Fault::new(place, format!("{error}{count}"), advice)
    }

    /// Number of hexahedra with an inverted corner.
    fn count_inverted(&self, numbers: &[usize]) -> usize {
        let is_inverted = |&&cell: &&usize| {
            let corners = std::array::from_fn(|k| self.points[self.cells[cell].nodes[k] as usize]);
            isoparametric::CORNERS.iter().any(|&xi| isoparametric::jacobian(&corners, xi).determinant() <= 0.0)
        };
        numbers.iter().filter(is_inverted).count()
    }
    fn groups(&self, places: &Places) -> Groups {
        let cells = self.cell_labels.iter().map(|(name, dimension, cells)| {
            let mut group = Group { name: name.clone(), dimension: *dimension, ..Group::default() };
            cells.iter().for_each(|&cell| self.add(&mut group, cell, places));
            group
        });
        let points = self.point_labels.iter().map(|(name, points)| Group {
            name: name.clone(),
            nodes: points.iter().filter_map(|&point| places.node_of_point[point]).collect(),
            ..Group::default()
        });
        Groups::new(cells.chain(points).map(tidy).filter(|group| !group.nodes.is_empty()).collect())
    }

    fn add(&self, group: &mut Group, cell: usize, places: &Places) {
        let nodes = self.cells[cell].nodes().iter().map(|&point| places.node_of_point[point as usize]);
        group.nodes.extend(nodes.clone().flatten());
        group.elements.extend(places.element_of_cell.get(&cell));
        if let Some(n_corners) = self.cells[cell].shape.n_face_corners()
            && let Some(corners) = nodes.take(n_corners).collect::<Option<Vec<_>>>()
        {
            group.faces.push(FaceCorners::new(&corners));
        }
    }
}

fn tidy(mut group: Group) -> Group {
    group.nodes.sort_unstable();
    group.nodes.dedup();
    group.elements.sort_unstable();
    group.elements.dedup();
    group.faces.sort_unstable();
    group.faces.dedup();
    group
}

/// Collects cells by name, names in the order of first use.
#[derive(Debug, Default)]
pub(super) struct Labels {
    labels: Vec<(String, u8, Vec<usize>)>,
    known: BTreeMap<(String, u8), usize>,
}

impl Labels {
    pub(super) fn add(&mut self, name: String, dimension: u8, cell: usize) {
        let next = self.labels.len();
        let label = *self.known.entry((name, dimension)).or_insert_with_key(|(name, _)| {
            self.labels.push((name.clone(), dimension, Vec::new()));
            next
        });
        self.labels[label].2.push(cell);
    }

    pub(super) fn into_vec(self) -> Vec<(String, u8, Vec<usize>)> {
        self.labels
    }
}
