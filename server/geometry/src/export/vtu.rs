//! VTK unstructured grid (XML) of a mesh with fields at its nodes and in its cells: ParaView opens it.

use std::path::Path;

use nalgebra::{Matrix3, Point3, Vector3};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataSet, UnstructuredGridPiece, Version, VertexNumbers,
};
use vtkio::{IOBuffer, Vtk};

use super::{ExportError, write_file};
use crate::hex_mesh::HexMesh;
use crate::volume_mesh::{ElementKind, VolumeMesh};

/// A named field with one value per node or per element.
#[derive(Clone, Copy, Debug)]
pub enum Field<'a> {
    /// Numbers `[n]`.
    Scalars(&'a str, &'a [f64]),
    /// Vectors `[n]`.
    Vectors(&'a str, &'a [Vector3<f64>]),
    /// Tensors `[n]`; nine components, row by row.
    Tensors(&'a str, &'a [Matrix3<f64>]),
}

impl Field<'_> {
    fn name(&self) -> &str {
        match self {
            Self::Scalars(name, _) | Self::Vectors(name, _) | Self::Tensors(name, _) => name,
        }
    }

    fn n_values(&self) -> usize {
        match self {
            Self::Scalars(_, values) => values.len(),
            Self::Vectors(_, values) => values.len(),
            Self::Tensors(_, values) => values.len(),
        }
    }

    fn to_attribute(self) -> Attribute {
        match self {
            Self::Scalars(name, values) => Attribute::scalars(name, 1).with_data(values.to_vec()),
            Self::Vectors(name, values) => {
                let flat: Vec<f64> = values.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
                Attribute::vectors(name).with_data(flat)
            }
            Self::Tensors(name, values) => {
                // nalgebra keeps columns together: the transpose's columns are the rows.
                let flat: Vec<f64> = values.iter().flat_map(|t| t.transpose().data.0).flatten().collect();
                Attribute::tensors(name).with_data(flat)
            }
        }
    }
}

/// Writes `mesh` at its rest positions \[m\] to `path` (`.vtu`), with fields at the nodes and in the hexahedra; the file is
/// little-endian, `f64`. In ParaView "Warp By Vector" with a displacement field shows the deformed mesh.
///
/// # Errors
/// [`ExportError`]: a field of another length than nodes or hexahedra, or a file that cannot be written.
pub fn write_vtu(
    path: &Path,
    mesh: &HexMesh,
    point_fields: &[Field<'_>],
    cell_fields: &[Field<'_>],
) -> Result<(), ExportError> {
    write(path, &Grid { points: mesh.nodes(), cells: cells(mesh), of: "hexahedra" }, point_fields, cell_fields)
}

/// As [`write_vtu`], of any elements.
///
/// # Errors
/// As [`write_vtu`].
pub fn write_volume_vtu(
    path: &Path,
    mesh: &VolumeMesh,
    point_fields: &[Field<'_>],
    cell_fields: &[Field<'_>],
) -> Result<(), ExportError> {
    let cells = match mesh {
        VolumeMesh::Hexahedra(mesh) => cells(mesh),
        VolumeMesh::Tetrahedra(_) => tet_cells(mesh),
    };
    write(path, &Grid { points: mesh.nodes(), cells, of: mesh.kind().plural() }, point_fields, cell_fields)
}

/// Points and cells of a file.
struct Grid<'a> {
    points: &'a [Point3<f64>],
    cells: Cells,
    /// Name of the cells.
    of: &'static str,
}

fn write(
    path: &Path,
    grid: &Grid<'_>,
    point_fields: &[Field<'_>],
    cell_fields: &[Field<'_>],
) -> Result<(), ExportError> {
    check_lengths(point_fields, grid.points.len(), "nodes")?;
    check_lengths(cell_fields, grid.cells.types.len(), grid.of)?;
    let attributes = |fields: &[Field<'_>]| fields.iter().map(|field| field.to_attribute()).collect();
    let piece = UnstructuredGridPiece {
        points: flat_points(grid.points),
        cells: grid.cells.clone(),
        data: Attributes { point: attributes(point_fields), cell: attributes(cell_fields) },
    };
    let vtk = Vtk {
        version: Version::new_xml(1, 0),
        title: "Plica".to_owned(),
        byte_order: ByteOrder::LittleEndian,
        data: DataSet::inline(piece),
        file_path: None,
    };
    let mut bytes = Vec::new();
    vtk.write_xml(&mut bytes).map_err(|error| ExportError::Vtk(error.to_string()))?;
    let text = String::from_utf8(bytes).map_err(|error| ExportError::Vtk(error.to_string()))?;
    write_file(path, signed_indices(text).as_bytes())
}

/// Indices as signed integers, as VTK writes them; none reaches the sign bit. Readers based on numpy convert a mixture
/// of unsigned and signed integers to floating point.
fn signed_indices(text: String) -> String {
    let names = ["connectivity", "offsets"];
    names.iter().fold(text, |text, name| {
        text.replace(&format!("type=\"UInt64\" Name=\"{name}\""), &format!("type=\"Int64\" Name=\"{name}\""))
    })
}

fn check_lengths(fields: &[Field<'_>], n_expected: usize, of: &'static str) -> Result<(), ExportError> {
    match fields.iter().find(|field| field.n_values() != n_expected) {
        Some(field) => {
            let (name, n_values) = (field.name().to_owned(), field.n_values());
            Err(ExportError::FieldLength { name, n_values, n_expected, of })
        }
        None => Ok(()),
    }
}

fn flat_points(points: &[Point3<f64>]) -> IOBuffer {
    IOBuffer::F64(points.iter().flat_map(|x| [x.x, x.y, x.z]).collect())
}

fn cells(mesh: &HexMesh) -> Cells {
    let connectivity = mesh.hexes().iter().flatten().map(|node| u64::from(node.0)).collect();
    let offsets = (1..=mesh.n_hexes() as u64).map(|n| 8 * n).collect();
    Cells {
        cell_verts: VertexNumbers::XML { connectivity, offsets },
        types: vec![CellType::Hexahedron; mesh.n_hexes()],
    }
}

fn tet_cells(mesh: &VolumeMesh) -> Cells {
    let connectivity: Vec<u64> =
        mesh.elements().flat_map(|tet| mesh.nodes_of(tet).iter().map(|node| u64::from(node.0))).collect();
    let (n_nodes, cell_type) = match mesh.kind() {
        ElementKind::QuadraticTetrahedron => (10, CellType::QuadraticTetra),
        _ => (4, CellType::Tetra),
    };
    let offsets = (1..=mesh.n_elements() as u64).map(|n| n_nodes * n).collect();
    Cells { cell_verts: VertexNumbers::XML { connectivity, offsets }, types: vec![cell_type; mesh.n_elements()] }
}
