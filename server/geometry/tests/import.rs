//! Mesh files: files of Gmsh and VTK are read with their groups; other volumes and damaged files are refused by name.
//!
//! The files in `tests/data` come from `make.py` there.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::path::{Path, PathBuf};

use common::{Random, centre, default_wedge};
use nalgebra::Point3;
use plica_geometry::export::{Field, write_vtu};
use plica_geometry::import::{ImportError, NamedMesh, ReadOptions, parse_mesh, read_mesh};
use plica_geometry::{ElementIdx, NodeIdx, VolumeMesh};

const MILLIMETRES: f64 = 1e-3;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// Files of `tests/data` with a matching name, in alphabetical order.
fn files(begin: &str, end: &str) -> Vec<String> {
    let names = std::fs::read_dir(data("")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.filter(|name| name.starts_with(begin) && name.ends_with(end)).collect();
    names.sort();
    names
}

fn refusal(name: &str) -> String {
    let error = read_mesh(&data(name), ReadOptions::unit(MILLIMETRES)).unwrap_err();
    assert_eq!(error.path, data(name));
    error.to_string()
}

fn parse(text: &str) -> Result<NamedMesh, ImportError> {
    parse_mesh(Path::new("a.mesh"), text.as_bytes(), ReadOptions::unit(1.0))
}

/// Nodes as whole millimetres, in increasing order.
fn rounded(mesh: &NamedMesh, nodes: &[NodeIdx]) -> Vec<[i32; 3]> {
    let whole =
        |node: &NodeIdx| mesh.mesh.nodes()[node.index()].coords.map(|c| (c / MILLIMETRES).round() as i32).into();
    let mut all: Vec<[i32; 3]> = nodes.iter().map(whole).collect();
    all.sort_unstable();
    all
}

fn check_boxes(read: &NamedMesh) {
    assert_eq!((read.mesh.n_elements(), read.mesh.n_nodes()), (16, 45));
    assert!((read.mesh.volume() - 2e-6).abs() < 1e-17, "{}", read.mesh.volume());
}

fn nodes_where(read: &NamedMesh, keep: impl Fn(&Point3<f64>) -> bool) -> Vec<NodeIdx> {
    let nodes = read.mesh.nodes().iter().enumerate().filter(|(_, x)| keep(x));
    nodes.map(|(node, _)| NodeIdx::from_index(node)).collect()
}

fn hexes_where(read: &NamedMesh, keep: impl Fn(Point3<f64>) -> bool) -> Vec<ElementIdx> {
    read.mesh.elements().filter(|&element| keep(read.mesh.centre_of(element))).collect()
}

#[test]
fn gmsh_files_of_every_kind_give_the_same_mesh_and_groups() {
    let names = files("boxes", ".msh");
    assert_eq!(names.len(), 5, "{names:?}");
    for name in names {
        let read = read_mesh(&data(&name), ReadOptions::unit(MILLIMETRES)).unwrap();
        check_boxes(&read);
        let groups = &read.groups;
        assert_eq!(groups.volume("soft").unwrap().elements, hexes_where(&read, |c| c.x < 0.01), "{name}");
        assert_eq!(groups.volume("stiff").unwrap().elements, hexes_where(&read, |c| c.x > 0.01), "{name}");
        assert_eq!(groups.surface("bottom").unwrap().nodes, nodes_where(&read, |x| x.z.abs() < 1e-9), "{name}");
        assert_eq!(groups.surface("bottom").unwrap().faces.len(), 8, "{name}");
        assert_eq!(groups.surface("end").unwrap().nodes, nodes_where(&read, |x| x.x > 0.02 - 1e-9), "{name}");
        assert_eq!(groups.surface("77").unwrap().faces.len(), 8, "{name}");
        assert_eq!(groups.nodes("edge").unwrap().nodes.len(), 5, "{name}");
        assert_eq!(rounded(&read, &groups.nodes("corner").unwrap().nodes), [[0, 0, 0]], "{name}");
        assert_eq!(groups.iter().count(), 7, "{name}");
        assert!(groups.volume("bottom").is_none() && groups.surface("soft").is_none());
        assert_eq!(groups.nodes("soft").unwrap().nodes, nodes_where(&read, |x| x.x < 0.01 + 1e-9));
    }
}

#[test]
fn faces_of_a_surface_are_boundary_quads() {
    let read = read_mesh(&data("boxes-4.1-ascii.msh"), ReadOptions::unit(MILLIMETRES)).unwrap();
    let boundary: Vec<_> = read.mesh.boundary_faces().iter().map(|face| face.sorted_corners()).collect();
    for name in ["bottom", "end", "77"] {
        assert!(read.groups.surface(name).unwrap().faces.iter().all(|face| boundary.contains(face)), "{name}");
    }
}

#[test]
fn vtu_files_of_every_kind_give_the_same_mesh_and_groups() {
    let names = files("boxes-a", ".vtu").into_iter().chain(files("boxes-b", ".vtu")).collect::<Vec<_>>();
    assert_eq!(names.len(), 7, "{names:?}");
    for name in names {
        let read = read_mesh(&data(&name), ReadOptions::unit(MILLIMETRES)).unwrap_or_else(|e| panic!("{e}"));
        check_boxes(&read);
        let groups = &read.groups;
        assert_eq!(groups.volume("material=1").unwrap().elements, hexes_where(&read, |c| c.x < 0.01), "{name}");
        assert_eq!(groups.volume("stiffness=1").unwrap().elements, hexes_where(&read, |c| c.x > 0.01), "{name}");
        assert_eq!(groups.surface("material=3").unwrap().faces.len(), 8, "{name}");
        assert_eq!(groups.nodes("fixed=1").unwrap().nodes, nodes_where(&read, |x| x.z == 0.0), "{name}");
        assert!(groups.iter().all(|group| !group.name.starts_with("position")), "{name}");
    }
}

#[test]
fn what_is_written_is_read_back() {
    let mesh = default_wedge();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wedge.vtu");
    let region: Vec<f64> = mesh.hex_indices().map(|hex| f64::from(u8::from(centre(&mesh, hex).x > 0.06))).collect();
    write_vtu(&path, &mesh, &[], &[Field::Scalars("region", &region)]).unwrap();
    let read = read_mesh(&path, ReadOptions::unit(1.0)).unwrap();
    assert_eq!(read.mesh, VolumeMesh::from(mesh));
    assert_eq!(read.groups.volume("region=1").unwrap().elements, hexes_where(&read, |c| c.x > 0.06));
}

#[test]
fn other_elements_are_refused_by_name() {
    for (name, parts) in [
        ("second-order.msh", &["27-node hexahedra (second order)", "Mesh.ElementOrder = 1"][..]),
        ("boxes-lzma.vtu", &["compressor", "vtkLZMADataCompressor", "save it with ZLib"]),
        ("make.py", &["neither", "meshio convert"]),
        ("none.msh", &["cannot be read", "check the path"]),
    ] {
        let message = refusal(name);
        assert!(!message.contains('\n') && message.contains(name), "{message}");
        parts.iter().for_each(|part| assert!(message.contains(part), "`{part}` in: {message}"));
    }
}

#[test]
fn a_surface_is_told_to_be_one() {
    let liver = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/meshes/liver.obj");
    if liver.exists() {
        let message = read_mesh(&liver, ReadOptions::unit(1.0)).unwrap_err().to_string();
        assert!(message.contains("neither a Gmsh (.msh) nor a VTU"), "{message}");
    } else {
        println!("skipped in part: no test meshes beside the repository");
    }
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n\
                $Elements\n1\n1 2 2 0 1 1 2 3\n$EndElements\n";
    let message = parse(text).unwrap_err().to_string();
    assert!(message.contains("1 triangles or quads and no hexahedra or tetrahedra: it is a surface"), "{message}");
}

/// Errors in text files carry the line.
#[test]
fn faults_in_text_name_their_line() {
    let msh = std::fs::read_to_string(data("boxes-4.1-ascii.msh")).unwrap();
    let vtu = std::fs::read_to_string(data("boxes-ascii.vtu")).unwrap();
    let line = |text: &str, part: &str| 1 + text[..text.find(part).unwrap()].matches('\n').count();
    for (text, from, to, parts) in [
        (&msh, "4.1 0 8", "4.0 0 8", &["MSH version 4.0", "Mesh.MshFileVersion = 4.1"][..]),
        (&msh, "4.1 0 8", "4.1 2 8", &["mode 2"]),
        (&msh, "\n$Entities\n12 20", "\n$Entities\n12 x", &["`x` is not a whole number"]),
        (&msh, "\n3 1 \"soft\"", "\n3 1 soft", &["`3 1 soft`", "name"]),
        (&msh, "$EndElements", "$EndElement", &["where $EndElements is expected"]),
        (&vtu, "type=\"UnstructuredGrid\"", "type=\"PolyData\"", &["PolyData", "not an unstructured grid"]),
        (&vtu, "NumberOfPoints=\"45\"", "NumberOfPoints=\"-4\"", &["NumberOfPoints", "`-4`"]),
        (&vtu, "NumberOfPoints=\"45\"", "NumberOfPoints=\"46\"", &["135 numbers, 138 are expected"]),
        (&vtu, "Name=\"offsets\"", "Name=\"offset\"", &["no DataArray `offsets`"]),
        (&vtu, "format=\"ascii\"", "format=\"asci\"", &["format `asci`"]),
        (&vtu, "</Points>", "</Point>", &["not well-formed XML"]),
    ] {
        assert!(text.contains(from), "{from}");
        let bad = text.replacen(from, to, 1);
        let message = parse(&bad).unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(message.contains(part), "`{part}` in: {message}"));
        let named: usize =
            message.split(':').nth(1).unwrap_or("").parse().unwrap_or_else(|_| panic!("a line in: {message}"));
        let expected = line(&bad, to.trim_start());
        // Arrays are named by the line of their tag, which may precede the fault.
        assert!(
            (expected..=expected + 1).contains(&named)
                || ["numbers,", "no DataArray"].iter().any(|part| message.contains(part)),
            "{expected}: {message}"
        );
    }
}

#[test]
fn a_missing_node_and_a_twisted_hexahedron_are_named() {
    let cube = |hexahedron: &str| {
        let nodes = "1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1\n";
        format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n{nodes}$EndNodes\n$Elements\n1\n{hexahedron}\n$EndElements\n"
        )
    };
    let read = parse(&cube("31 5 2 4 1 1 2 3 4 5 6 7 8")).unwrap();
    assert!((read.mesh.volume() - 1.0).abs() < 1e-15);
    assert_eq!(read.groups.volume("4").unwrap().elements, [ElementIdx(0)]);
    let message = parse(&cube("31 5 2 4 1 1 2 3 4 5 6 7 9")).unwrap_err().to_string();
    assert!(message.contains("a.mesh:17: element 31 names node 9"), "{message}");
    let message = parse(&cube("31 5 2 4 1 5 6 7 8 1 2 3 4")).unwrap_err().to_string();
    assert!(
        message.contains("cell 31") && message.contains("det J") && message.contains("(1 of 1 hexahedra); untangle"),
        "{message}"
    );
}

/// MSH 2.2 lists a hexahedron of two physical groups twice.
#[test]
fn a_hexahedron_of_two_groups_is_one() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n9\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n\
                8 0 1 1\n99 5 5 5\n$EndNodes\n$Elements\n2\n1 5 2 1 1 1 2 3 4 5 6 7 8\n2 5 2 2 1 1 2 3 4 5 6 7 8\n$EndElements\n";
    let read = parse(text).unwrap();
    assert_eq!((read.mesh.n_elements(), read.mesh.n_nodes()), (1, 8), "and the node of no hexahedron is left out");
    assert_eq!(read.groups.volume("1").unwrap().elements, read.groups.volume("2").unwrap().elements);
}

#[test]
fn units_must_be_a_length() {
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let message = read_mesh(&data("boxes-ascii.vtu"), ReadOptions::unit(unit)).unwrap_err().to_string();
        assert!(message.contains("metres per unit"), "{message}");
    }
}

/// A truncated file gives an error or, if only its end is missing, the mesh.
#[test]
fn truncated_files_end_in_an_error() {
    for name in files("", ".msh").into_iter().chain(files("", ".vtu")) {
        let bytes = std::fs::read(data(&name)).unwrap();
        let n_read = (0..bytes.len())
            .filter(|&n| parse_mesh(Path::new(&name), &bytes[..n], ReadOptions::unit(1.0)).is_ok())
            .count();
        assert!(n_read < 40, "{name}: {n_read} truncated files were read");
    }
}

/// No bytes cause a panic.
#[test]
fn damaged_files_end_in_an_answer() {
    let mut random = Random(21);
    let mut below = |n: usize| ((0.5 + 0.5 * random.number()) * n as f64) as usize;
    for name in files("", ".msh").into_iter().chain(files("", ".vtu")) {
        let good = std::fs::read(data(&name)).unwrap();
        for _ in 0..300 {
            let mut bytes = good.clone();
            for _ in 0..1 + below(4) {
                let at = below(bytes.len());
                match below(4) {
                    0 => bytes[at] = below(256) as u8,
                    1 => bytes[at] = b"0123456789-.e $<>=\"_"[below(20)],
                    2 => drop(bytes.drain(at..(at + below(20)).min(good.len()).min(bytes.len()).max(at))),
                    _ => bytes.insert(at, b'9'),
                }
            }
            let _ = parse_mesh(Path::new(&name), &bytes, ReadOptions::unit(1.0));
        }
    }
    for length in 0..300 {
        let begin = ["$MeshFormat\n2.2 1 8\n", "$MeshFormat\n4.1 1 8\n", "<VTKFile", ""][length % 4];
        let bytes: Vec<u8> = begin.bytes().chain((0..length).map(|_| below(256) as u8)).collect();
        assert!(parse_mesh(Path::new("noise"), &bytes, ReadOptions::unit(1.0)).is_err());
    }
}

/// Counts beyond the file's size allocate no memory.
#[test]
fn boasting_files_are_refused() {
    let huge = u64::MAX;
    let head = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
    for text in [
        format!("{head}$Nodes\n1 {huge} 1 {huge}\n3 1 0 {huge}\n"),
        format!("{head}$Nodes\n1 4000000000 1 1\n3 1 0 4000000000\n1\n"),
        format!("{head}$Entities\n{huge} 0 0 0\n1 0 0 0 {huge}\n"),
        format!("{head}$Elements\n{huge} 1 1 1\n3 1 5 {huge}\n"),
        format!("{head}$PhysicalNames\n{huge}\n"),
        format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{huge}\n"),
        format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Elements\n{huge}\n1 5 2000000000 1\n"),
    ] {
        let message = parse(&text).unwrap_err().to_string();
        assert!(message.starts_with("a.mesh:"), "{message}");
    }
    let vtu = std::fs::read_to_string(data("boxes-ascii.vtu")).unwrap();
    for n in ["99999999", "100000001", "18446744073709551615", "99999999999999999999999"] {
        let text = vtu.replace("NumberOfPoints=\"45\"", &format!("NumberOfPoints=\"{n}\""));
        assert!(parse(&text).is_err());
        let text = vtu.replace("NumberOfCells=\"24\"", &format!("NumberOfCells=\"{n}\""));
        assert!(parse(&text).is_err());
    }
    let deep = "<a>".repeat(100_000);
    assert!(parse(&format!("<VTKFile>{deep}")).is_err());
}
