//! VTK unstructured grid (XML) of a hexahedral mesh with fields at its nodes: ParaView opens it.

use std::path::Path;

use nalgebra::{Point3, Vector3};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataSet, UnstructuredGridPiece, Version, VertexNumbers,
};
use vtkio::{IOBuffer, Vtk};

use super::{ExportError, write_file};
use crate::hex_mesh::HexMesh;

/// A named field with one value per node.
#[derive(Clone, Copy, Debug)]
pub enum PointField<'a> {
    /// Numbers `[n_nodes]`.
    Scalars(&'a str, &'a [f64]),
    /// Vectors `[n_nodes]`.
    Vectors(&'a str, &'a [Vector3<f64>]),
}

impl PointField<'_> {
    fn name(&self) -> &str {
        match self {
            Self::Scalars(name, _) | Self::Vectors(name, _) => name,
        }
    }

    fn n_values(&self) -> usize {
        match self {
            Self::Scalars(_, values) => values.len(),
            Self::Vectors(_, values) => values.len(),
        }
    }

    fn to_attribute(self) -> Attribute {
        match self {
            Self::Scalars(name, values) => Attribute::scalars(name, 1).with_data(values.to_vec()),
            Self::Vectors(name, values) => {
                let flat: Vec<f64> = values.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
                Attribute::vectors(name).with_data(flat)
            }
        }
    }
}

/// Writes `mesh` at its rest positions \[m\] with `fields` to `path` (`.vtu`); the file is little-endian, `f64`.
///
/// # Errors
/// [`ExportError`]: a field of another length than the mesh's nodes, or a file that cannot be written.
pub fn write_vtu(path: &Path, mesh: &HexMesh, fields: &[PointField<'_>]) -> Result<(), ExportError> {
    let n_nodes = mesh.n_nodes();
    if let Some(field) = fields.iter().find(|field| field.n_values() != n_nodes) {
        let (name, n_values) = (field.name().to_owned(), field.n_values());
        return Err(ExportError::FieldLength { name, n_values, n_nodes });
    }
    let piece = UnstructuredGridPiece {
        points: flat_points(mesh.nodes()),
        cells: cells(mesh),
        data: Attributes { point: fields.iter().map(|field| field.to_attribute()).collect(), cell: Vec::new() },
    };
    let vtk = Vtk {
        version: Version::new((1, 0)),
        title: "Plica".to_owned(),
        byte_order: ByteOrder::LittleEndian,
        data: DataSet::inline(piece),
        file_path: None,
    };
    let mut bytes = Vec::new();
    vtk.write_xml(&mut bytes).map_err(|error| ExportError::Vtk(error.to_string()))?;
    write_file(path, &bytes)
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
