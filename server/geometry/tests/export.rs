//! Mesh files, read back by third-party readers.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{default_skin, default_wedge};
use nalgebra::{Matrix3, Vector3};
use plica_geometry::Skin;
use plica_geometry::export::{ExportError, Field, glb_bytes, write_glb, write_vtu};
use vtkio::model::{Attribute, CellType, DataSet, Piece};

fn as_f32(x: [f64; 3]) -> [f32; 3] {
    x.map(|c| c as f32)
}

fn skin_arrays(skin: &Skin) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let positions = skin.positions().iter().map(|x| as_f32(x.coords.into())).collect();
    (positions, skin.vertex_normals().iter().map(|n| as_f32((*n).into())).collect())
}

#[test]
fn the_glb_is_read_back_vertex_by_vertex() {
    let skin = default_skin().clustered();
    let (positions, normals) = skin_arrays(&skin);
    let file = gltf::Gltf::from_slice(&glb_bytes(&positions, &normals, skin.triangles())).unwrap();
    let binary = file.blob.as_ref().unwrap();
    let mesh = file.meshes().next().unwrap();
    let primitive = mesh.primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(binary));
    assert_eq!(reader.read_positions().unwrap().collect::<Vec<_>>(), positions);
    assert_eq!(reader.read_normals().unwrap().collect::<Vec<_>>(), normals);
    let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    assert_eq!(indices, skin.triangles().iter().flatten().map(|v| v.0).collect::<Vec<_>>());
    let bounds = primitive.bounding_box();
    assert_eq!((bounds.min, bounds.max), ([0.0; 3], [0.12, 0.06, 0.04]));
}

/// World z becomes glTF's y, by the root node alone.
#[test]
fn the_glb_root_turns_z_up_to_y_up() {
    let skin = default_skin();
    let (positions, normals) = skin_arrays(&skin);
    let file = gltf::Gltf::from_slice(&glb_bytes(&positions, &normals, skin.triangles())).unwrap();
    let root = file.default_scene().unwrap().nodes().next().unwrap();
    let (translation, rotation, scale) = root.transform().decomposed();
    assert_eq!((translation, scale), ([0.0; 3], [1.0; 3]));
    let [x, y, z, w] = rotation;
    let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    assert!((turn * Vector3::z() - Vector3::y()).norm() < 1e-6);
    assert!((turn * Vector3::x() - Vector3::x()).norm() < 1e-6);
    assert!((turn * Vector3::y() + Vector3::z()).norm() < 1e-6);
    assert!(root.children().next().unwrap().mesh().is_some());
}

#[test]
fn the_vtu_is_read_back_with_its_fields() {
    let mesh = default_wedge();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wedge.vtu");
    let heights: Vec<f64> = mesh.nodes().iter().map(|x| x.z).collect();
    let shifts: Vec<_> = mesh.nodes().iter().map(|x| 0.5 * x.coords).collect();
    let stress: Vec<_> =
        (0..128).map(|i| Matrix3::from_fn(|r, c| f64::from(100 * i + 10 * r as i32 + c as i32))).collect();
    let volumes: Vec<f64> = (0..128).map(f64::from).collect();
    let fields = [Field::Scalars("height_m", &heights), Field::Vectors("displacement_m", &shifts)];
    let cell_fields = [Field::Scalars("number", &volumes), Field::Tensors("stress_pa", &stress)];
    write_vtu(&path, &mesh, &fields, &cell_fields).unwrap();

    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("type=\"Int64\" Name=\"connectivity\"") && text.contains("type=\"Int64\" Name=\"offsets\""));
    let read = vtkio::Vtk::import(&path).unwrap();
    let DataSet::UnstructuredGrid { pieces, .. } = read.data else { panic!("another kind of grid") };
    let Piece::Inline(piece) = &pieces[0] else { panic!("no inline piece") };
    let flat: Vec<f64> = mesh.nodes().iter().flat_map(|x| [x.x, x.y, x.z]).collect();
    assert_eq!(piece.points.clone().into_vec::<f64>().unwrap(), flat);
    assert_eq!(piece.cells.types, vec![CellType::Hexahedron; 128]);
    let (connectivity, offsets) = piece.cells.cell_verts.clone().into_xml();
    assert_eq!(connectivity, mesh.hexes().iter().flatten().map(|n| u64::from(n.0)).collect::<Vec<_>>());
    assert_eq!(offsets.last(), Some(&1024));
    let field = |attribute: &Attribute| match attribute {
        Attribute::DataArray(array) => (array.name.clone(), array.data.clone().into_vec::<f64>().unwrap()),
        Attribute::Field { .. } => panic!("a legacy field"),
    };
    assert_eq!(field(&piece.data.point[0]), ("height_m".to_owned(), heights));
    assert_eq!(field(&piece.data.point[1]), ("displacement_m".to_owned(), flat.iter().map(|x| 0.5 * x).collect()));
    assert_eq!(field(&piece.data.cell[0]), ("number".to_owned(), volumes));
    let (name, rows) = field(&piece.data.cell[1]);
    assert_eq!((name.as_str(), rows.len()), ("stress_pa", 9 * 128));
    assert_eq!(rows[9..18], [100.0, 101.0, 102.0, 110.0, 111.0, 112.0, 120.0, 121.0, 122.0], "row by row");
}

#[test]
fn a_field_of_the_wrong_length_is_refused() {
    let path = std::path::Path::new("never-written.vtu");
    let field = [Field::Scalars("height_m", &[1.0, 2.0])];
    let error = write_vtu(path, &default_wedge(), &field, &[]).unwrap_err();
    assert_eq!(error.to_string(), "field `height_m` holds 2 values for 225 nodes");
    let error = write_vtu(path, &default_wedge(), &[], &field).unwrap_err();
    assert_eq!(error.to_string(), "field `height_m` holds 2 values for 128 hexahedra");
    assert!(!path.exists());
}

#[test]
fn a_file_that_cannot_be_written_is_named() {
    let path = std::path::Path::new("no/such/folder/skin.glb");
    let error = write_glb(path, &[], &[], &[]).unwrap_err();
    assert!(matches!(error, ExportError::Write { .. }));
    assert!(error.to_string().starts_with("cannot write no/such/folder/skin.glb: "), "{error}");
}
