//! Tetrahedra of 4 and 10 nodes: shape functions, faces, checks, location, files of Gmsh and VTK.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use plica_geometry::export::{Field, write_volume_vtu};
use plica_geometry::import::{Groups, NamedMesh, ReadOptions, parse_mesh, read_mesh};
use plica_geometry::select::{Selector, Side};
use plica_geometry::tetrahedron::{EDGES, NODES, barycentric, quadratic_gradients, quadratic_shapes};
use plica_geometry::{ElementKind, Face, NodeIdx, TetMesh, TetMeshError, Tets, VolumeMesh};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn read(name: &str) -> NamedMesh {
    read_mesh(&data(name), ReadOptions::unit(1e-3)).unwrap_or_else(|e| panic!("{e}"))
}

/// Files of the box of 20 x 10 x 10 mm in 10-node tetrahedra.
const QUADRATIC: [&str; 3] = ["tet10-4.1.msh", "tet10-2.2.msh", "tet10.vtu"];

#[test]
fn shape_functions_are_1_at_their_node_and_their_gradients_are_derivatives() {
    for (a, &xi) in NODES.iter().enumerate() {
        let shapes = quadratic_shapes(xi);
        assert!((0..10).all(|b| (shapes[b] - f64::from(u8::from(a == b))).abs() < 1e-15), "{a}: {shapes:?}");
    }
    let xi = [0.2, 0.13, 0.41];
    assert!((quadratic_shapes(xi).iter().sum::<f64>() - 1.0).abs() < 1e-15);
    assert!((barycentric(xi).iter().sum::<f64>() - 1.0).abs() < 1e-15);
    for k in 0..3 {
        let at = |step: f64| {
            let mut moved = xi;
            moved[k] += step;
            quadratic_shapes(moved)
        };
        for a in 0..10 {
            let slope = (at(1e-5)[a] - at(-1e-5)[a]) / 2e-5;
            assert!((slope - quadratic_gradients(xi)[a][k]).abs() < 1e-9, "{a} {k}");
        }
    }
}

/// The nodes on edges lie in the middle of the edges of VTK's order, whatever the order of the file.
#[test]
fn files_of_gmsh_and_vtk_give_the_same_tetrahedra() {
    for name in QUADRATIC {
        let NamedMesh { mesh, groups, .. } = read(name);
        assert_eq!(mesh.kind(), ElementKind::QuadraticTetrahedron, "{name}");
        assert!((mesh.volume() - 2e-6).abs() < 1e-17, "{name}: {}", mesh.volume());
        for tet in mesh.elements() {
            let x: Vec<_> = mesh.nodes_of(tet).iter().map(|node| mesh.nodes()[node.index()]).collect();
            for (edge, &[a, b]) in EDGES.iter().enumerate() {
                let miss = (x[4 + edge] - nalgebra::center(&x[a], &x[b])).norm();
                assert!(miss < 1e-9, "{name}, tetrahedron {tet}, edge {edge}: {miss}");
            }
        }
        let end = mesh
            .boundary_faces()
            .into_iter()
            .filter(|face| face.nodes().iter().all(|node| (mesh.nodes()[node.index()].x - 0.02).abs() < 1e-9));
        let end: Vec<Face> = end.collect();
        let side = Selector { side: Some(Side { axis: 0, upper: true }), ..Selector::default() };
        assert_eq!(side.faces(&mesh, &groups).unwrap(), end, "{name}");
        if name != "tet10.vtu" {
            let group = Selector { group: Some("end".into()), ..Selector::default() };
            assert_eq!(group.faces(&mesh, &groups).unwrap(), end, "{name}");
            assert_eq!(group.nodes(&mesh, &groups).unwrap(), side.nodes(&mesh, &groups).unwrap(), "{name}");
            assert_eq!(groups.volume("body").unwrap().elements.len(), mesh.n_elements(), "{name}");
        }
    }
    let linear = read("tetrahedra.msh");
    assert_eq!(linear.mesh.kind(), ElementKind::LinearTetrahedron);
}

/// Flux of `x` through the boundary, three times the volume: every face is there once and outward.
#[test]
fn boundary_faces_close_outward() {
    for name in ["tetrahedra.msh", QUADRATIC[0]] {
        let mesh = read(name).mesh;
        let corner = |node: NodeIdx| mesh.nodes()[node.index()].coords;
        let flux = |face: &Face| {
            let [a, b, c] = face.corners() else { panic!("a triangle has three corners") };
            corner(*a).dot(&corner(*b).cross(&corner(*c))) / 2.0
        };
        let volume: f64 = mesh.boundary_faces().iter().map(flux).sum::<f64>() / 3.0;
        assert!((volume - mesh.volume()).abs() < 1e-12 * volume, "{name}: {volume}");
        assert_eq!(mesh.bodies().1, 1);
    }
}

#[test]
fn points_are_found_in_tetrahedra() {
    for name in ["tetrahedra.msh", QUADRATIC[0]] {
        let mesh = read(name).mesh;
        let [lower, upper] = mesh.bounds();
        for share in [[0.0, 0.0, 0.0], [0.3, 0.7, 0.2], [1.0, 0.5, 1.0], [0.11, 0.93, 0.48]] {
            let x = lower + (upper - lower).component_mul(&Vector3::from(share));
            let found = mesh.locate(&x, 1e-9).unwrap();
            let weights = mesh.weights_at(&found);
            let at: Vector3<f64> = weights.iter().map(|(node, w)| mesh.nodes()[node.index()].coords * *w).sum();
            assert!((at - x.coords).norm() < 1e-12, "{name} {share:?}");
        }
        assert!(mesh.locate(&(upper + Vector3::repeat(1e-3)), 1e-6).is_none());
    }
}

#[test]
fn what_is_written_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["tetrahedra.msh", QUADRATIC[0]] {
        let mesh = read(name).mesh;
        let path = folder.path().join("tets.vtu");
        let radial: Vec<Vector3<f64>> = mesh.elements().map(|tet| mesh.centre_of(tet).coords).collect();
        write_volume_vtu(&path, &mesh, &[], &[Field::Vectors("fibres", &radial)]).unwrap();
        let back = read_mesh(&path, ReadOptions::unit(1.0)).unwrap();
        assert_eq!(back.mesh, mesh);
        assert_eq!((back.vectors.len(), back.vectors[0].name.as_str()), (1, "fibres"));
        assert_eq!(back.vectors[0].values, radial);
    }
}

fn corner_tet() -> (Vec<Point3<f64>>, Vec<[NodeIdx; 10]>) {
    let nodes = NODES.map(Point3::from).to_vec();
    (nodes, vec![std::array::from_fn(NodeIdx::from_index)])
}

#[test]
fn inverted_tetrahedra_and_those_that_a_curved_edge_turns_over_are_refused() {
    let (nodes, tets) = corner_tet();
    assert!(TetMesh::new(nodes.clone(), Tets::Quadratic(tets.clone())).is_ok());
    let mirrored = nodes.iter().map(|x| Point3::new(x.x, x.y, -x.z)).collect();
    let refused = TetMesh::new(mirrored, Tets::Quadratic(tets.clone())).unwrap_err();
    assert!(matches!(refused, TetMeshError::Inverted { node: 0, .. }), "{refused}");
    let mut bent = nodes;
    bent[4].x = 0.2;
    let refused = TetMesh::new(bent, Tets::Quadratic(tets)).unwrap_err();
    assert!(matches!(refused, TetMeshError::Inverted { .. }), "{refused}");
}

/// Different volumes beside each other do not share whole faces.
#[test]
fn mixed_volumes_are_refused_with_their_numbers() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n9\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n6 1 0 1\n\
                7 1 1 1\n8 0 1 1\n9 2 0 0\n$EndNodes\n$Elements\n2\n1 5 2 1 1 1 2 3 4 5 6 7 8\n2 4 2 2 1 2 9 3 6\n$EndElements\n";
    let refused = parse_mesh(Path::new("a.msh"), text.as_bytes(), ReadOptions::unit(1.0)).unwrap_err().to_string();
    assert!(refused.contains("cell 2: holds 1 4-node tetrahedra beside 1 hexahedra; one kind is read"), "{refused}");
}

/// Groups of tetrahedra, and a side of the bounding box.
#[test]
fn sides_select_tetrahedra_with_a_face_there() {
    let mesh: VolumeMesh = read(QUADRATIC[0]).mesh;
    let side = Selector { side: Some(Side { axis: 2, upper: false }), ..Selector::default() };
    let elements = side.elements(&mesh, &Groups::default()).unwrap();
    let n_faces = side.faces(&mesh, &Groups::default()).unwrap().len();
    assert!(elements.len() <= n_faces && elements.len() * 2 > n_faces, "{} {n_faces}", elements.len());
}
