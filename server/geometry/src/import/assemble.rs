//! From the nodes, cells and labels of a file to a checked mesh with groups.

use std::collections::{BTreeMap, HashMap};

use nalgebra::Point3;

use super::error::{DAMAGED, Fault, Place, fault};
use super::groups::{Group, Groups};
use super::named_mesh::NamedMesh;
use crate::hex_mesh::{HexMesh, MeshError};
use crate::index::{HexIdx, NodeIdx};
use crate::isoparametric;

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
}

/// A cell by its corners, which index `points`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) shape: Shape,
    pub(super) corners: [u32; 8],
    /// Name in the file.
    pub(super) number: u64,
}

/// Supported shapes. Second-order cells of less than three dimensions are read by their corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Point,
    Line,
    Triangle,
    Quad,
    Hexahedron,
}

impl Shape {
    pub(super) fn n_corners(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line => 2,
            Self::Triangle => 3,
            Self::Quad => 4,
            Self::Hexahedron => 8,
        }
    }

    pub(super) fn dimension(self) -> u8 {
        match self {
            Self::Point => 0,
            Self::Line => 1,
            Self::Triangle | Self::Quad => 2,
            Self::Hexahedron => 3,
        }
    }
}

impl Cell {
    pub(super) fn corners(&self) -> &[u32] {
        &self.corners[..self.shape.n_corners()]
    }

    fn sorted_corners(&self) -> [u32; 8] {
        let mut corners = self.corners;
        corners[..self.shape.n_corners()].sort_unstable();
        corners
    }
}

/// Mesh indices of the points and cells of a file.
struct Places {
    node_of_point: Vec<Option<NodeIdx>>,
    /// Hexahedra only; a hexahedron given twice (once per physical group in MSH 2.2) is one.
    hex_of_cell: HashMap<usize, HexIdx>,
}

impl Content {
    pub(super) fn assemble(self, metres_per_unit: f64) -> Result<NamedMesh, Fault> {
        let (numbers, places) = self.place()?;
        let hexes: Vec<_> = numbers.iter().map(|&cell| self.nodes_of(cell, &places)).collect();
        let used = self.points.iter().zip(&places.node_of_point).filter(|(_, node)| node.is_some());
        let nodes = used.map(|(x, _)| x * metres_per_unit).collect();
        let mesh = HexMesh::new(nodes, hexes).map_err(|error| self.mesh_fault(&error, &numbers))?;
        let groups = self.groups(&places);
        Ok(NamedMesh { mesh, groups, remarks: Vec::new() })
    }

    /// Hexahedra of the mesh, and mesh indices of all points and cells.
    fn place(&self) -> Result<(Vec<usize>, Places), Fault> {
        let mut seen = HashMap::new();
        let mut hex_of_cell = HashMap::new();
        let mut numbers = Vec::new();
        let mut is_used = vec![false; self.points.len()];
        for (i, cell) in self.cells.iter().enumerate().filter(|(_, cell)| cell.shape == Shape::Hexahedron) {
            let hex = *seen.entry(cell.sorted_corners()).or_insert_with(|| {
                numbers.push(i);
                HexIdx::from_index(numbers.len() - 1)
            });
            hex_of_cell.insert(i, hex);
            cell.corners().iter().for_each(|&point| is_used[point as usize] = true);
        }
        if numbers.is_empty() {
            return self.no_hexahedra();
        }
        let mut nodes = (0..).map(NodeIdx);
        let node_of_point = is_used.into_iter().map(|used| if used { nodes.next() } else { None }).collect();
        Ok((numbers, Places { node_of_point, hex_of_cell }))
    }

    fn no_hexahedra<T>(&self) -> Result<T, Fault> {
        let n_surface = self.cells.iter().filter(|cell| cell.shape.dimension() == 2).count();
        if n_surface > 0 {
            let problem = format!("holds {n_surface} triangles or quads and no hexahedra: it is a surface");
            return fault(Place::File, problem, "fill its inside with 8-node hexahedra");
        }
        let problem = format!("holds no hexahedra ({} points, {} cells)", self.points.len(), self.cells.len());
        fault(Place::File, problem, "save the volume mesh; in Gmsh: mesh in 3D, and put the volume in a physical group")
    }

    /// Nodes of a hexahedral cell.
    fn nodes_of(&self, cell: usize, places: &Places) -> [NodeIdx; 8] {
        self.cells[cell].corners.map(|point| places.node_of_point[point as usize].unwrap_or_default())
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
            let corners = self.cells[cell].corners.map(|point| self.points[point as usize]);
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
        let nodes = self.cells[cell].corners().iter().map(|&point| places.node_of_point[point as usize]);
        group.nodes.extend(nodes.clone().flatten());
        group.hexes.extend(places.hex_of_cell.get(&cell));
        if self.cells[cell].shape == Shape::Quad
            && let Ok(mut face) = <[NodeIdx; 4]>::try_from(nodes.flatten().collect::<Vec<_>>())
        {
            face.sort_unstable();
            group.faces.push(face);
        }
    }
}

fn tidy(mut group: Group) -> Group {
    group.nodes.sort_unstable();
    group.nodes.dedup();
    group.hexes.sort_unstable();
    group.hexes.dedup();
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
