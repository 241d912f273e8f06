//! Binary glTF 2.0 of a triangle surface: one file that any viewer opens.

use std::f32::consts::FRAC_1_SQRT_2;
use std::path::Path;

use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::buffer::{Buffer, Target, View};
use gltf_json::mesh::{Mesh, Mode, Primitive, Semantic};
use gltf_json::scene::{Node, Scene, UnitQuaternion};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Accessor, Index, Root, Value};

use super::{ExportError, write_file};
use crate::index::VertexIdx;

/// A quarter turn about x that takes z up to glTF's y up: `(x, y, z) -> (x, z, -y)`, as `xyzw`.
const Y_UP_FROM_Z_UP: [f32; 4] = [-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2];

/// The surface as the bytes of a `.glb` file.
///
/// `positions` \[m\] (world coordinates, z up) and unit `normals` keep their order and number, `[n_vertices, 3]`;
/// `triangles` are counter-clockwise seen from outside. They are stored as `f32` and `u32`, untouched, in a mesh node
/// `skin` under a root node `world_z_up` that is turned to glTF's y up.
///
/// # Panics
/// If `normals` and `positions` differ in number, or the file would exceed 4 GiB.
pub fn glb_bytes(positions: &[[f32; 3]], normals: &[[f32; 3]], triangles: &[[VertexIdx; 3]]) -> Vec<u8> {
    assert_eq!(positions.len(), normals.len(), "one normal per vertex");
    let mut binary = Vec::new();
    let mut root = Root::default();
    root.asset.generator = Some("Plica".to_owned());
    let position_view = push_view(&mut root, &mut binary, floats(positions), Target::ArrayBuffer);
    let normal_view = push_view(&mut root, &mut binary, floats(normals), Target::ArrayBuffer);
    let index_bytes = triangles.iter().flatten().flat_map(|v| v.0.to_le_bytes());
    let index_view = push_view(&mut root, &mut binary, index_bytes, Target::ElementArrayBuffer);

    let [min, max] = bounds(positions);
    let position = root.push(Accessor {
        min: Some(Value::from(min)),
        max: Some(Value::from(max)),
        ..accessor(position_view, positions.len(), ComponentType::F32, Type::Vec3)
    });
    let normal = root.push(accessor(normal_view, normals.len(), ComponentType::F32, Type::Vec3));
    let indices = root.push(accessor(index_view, 3 * triangles.len(), ComponentType::U32, Type::Scalar));
    push_scene(&mut root, position, normal, indices);
    root.push(buffer(binary.len()));
    let json = root.to_vec().expect("a document of numbers and names can always be written as JSON");
    container(json, binary)
}

/// Writes [`glb_bytes`] to `path`.
///
/// # Errors
/// [`ExportError::Write`] if the file cannot be written.
pub fn write_glb(
    path: &Path,
    positions: &[[f32; 3]],
    normals: &[[f32; 3]],
    triangles: &[[VertexIdx; 3]],
) -> Result<(), ExportError> {
    write_file(path, &glb_bytes(positions, normals, triangles))
}

fn floats(vectors: &[[f32; 3]]) -> impl Iterator<Item = u8> + '_ {
    vectors.iter().flatten().flat_map(|x| x.to_le_bytes())
}

/// Appends bytes to the binary part, as one buffer view. All values have 4 bytes, so views stay aligned.
fn push_view(root: &mut Root, binary: &mut Vec<u8>, bytes: impl Iterator<Item = u8>, target: Target) -> Index<View> {
    let byte_offset = binary.len();
    binary.extend(bytes);
    root.push(View {
        buffer: Index::new(0),
        byte_length: (binary.len() - byte_offset).into(),
        byte_offset: Some(byte_offset.into()),
        byte_stride: None,
        name: None,
        target: Some(Valid(target)),
        extensions: None,
        extras: Default::default(),
    })
}

fn accessor(view: Index<View>, count: usize, component: ComponentType, type_: Type) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: count.into(),
        component_type: Valid(GenericComponentType(component)),
        extensions: None,
        extras: Default::default(),
        type_: Valid(type_),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}

fn buffer(byte_length: usize) -> Buffer {
    Buffer { byte_length: byte_length.into(), name: None, uri: None, extensions: None, extras: Default::default() }
}

/// Least and greatest coordinates; both zero for no vertices.
fn bounds(positions: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let first = positions.first().copied().unwrap_or_default();
    let fold = |pick: fn(f32, f32) -> f32| {
        positions.iter().fold(first, |bound, x| [pick(bound[0], x[0]), pick(bound[1], x[1]), pick(bound[2], x[2])])
    };
    [fold(f32::min), fold(f32::max)]
}

/// Scene -> `world_z_up` (turned) -> `skin` (the mesh).
fn push_scene(root: &mut Root, position: Index<Accessor>, normal: Index<Accessor>, indices: Index<Accessor>) {
    let attributes = [(Valid(Semantic::Positions), position), (Valid(Semantic::Normals), normal)];
    let primitive = Primitive {
        attributes: attributes.into(),
        extensions: None,
        extras: Default::default(),
        indices: Some(indices),
        material: None,
        mode: Valid(Mode::Triangles),
        targets: None,
    };
    let name = Some("skin".to_owned());
    let mesh = Mesh {
        extensions: None,
        extras: Default::default(),
        name: name.clone(),
        primitives: vec![primitive],
        weights: None,
    };
    let mesh = root.push(mesh);
    let skin = root.push(Node { mesh: Some(mesh), name, ..Node::default() });
    let world = root.push(Node {
        children: Some(vec![skin]),
        rotation: Some(UnitQuaternion(Y_UP_FROM_Z_UP)),
        name: Some("world_z_up".to_owned()),
        ..Node::default()
    });
    let scene = Scene { extensions: None, extras: Default::default(), name: None, nodes: vec![world] };
    root.scene = Some(root.push(scene));
}

/// Header, JSON chunk (padded with spaces), binary chunk: [glTF 2.0, section 4.4](https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#glb-file-format-specification).
fn container(mut json: Vec<u8>, binary: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + json.len() + 8 + binary.len();
    let mut bytes = Vec::with_capacity(length);
    bytes.extend(b"glTF");
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend(chunk_length(length));
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", binary)] {
        bytes.extend(chunk_length(chunk.len()));
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

fn chunk_length(length: usize) -> [u8; 4] {
    u32::try_from(length).expect("a GLB file holds at most 4 GiB").to_le_bytes()
}
