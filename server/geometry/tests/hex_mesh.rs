//! Hexahedral meshes: counts, volumes, boundaries, errors of malformed input.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{centre, default_wedge, distorted_block, u_shape};
use nalgebra::{Point3, Vector3};
use plica_geometry::shapes::block;
use plica_geometry::{HexIdx, HexMesh, MeshError, NodeIdx};

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs())
}

#[test]
fn the_wedge_has_the_counts_and_the_volume_of_the_scene() {
    let mesh = default_wedge();
    assert_eq!((mesh.n_hexes(), mesh.n_nodes()), (128, 225));
    assert!(close(mesh.volume(), 0.12 * 0.06 * 0.025, 1e-14), "{}", mesh.volume());
    let fixed = mesh.nodes().iter().filter(|x| x.z == 0.0).count();
    assert_eq!(fixed, 45, "nodes of the bottom");
}

#[test]
fn a_block_fills_its_size() {
    let mesh = block([0.3, 0.2, 0.1], [3, 2, 1]);
    assert_eq!((mesh.n_hexes(), mesh.n_nodes()), (6, 24));
    assert!(close(mesh.volume(), 0.006, 1e-14));
    assert_eq!(mesh.nodes()[0], Point3::origin());
    assert_eq!(mesh.nodes()[23], Point3::new(0.3, 0.2, 0.1));
    assert!(close(mesh.mean_longest_edge(), 0.1, 1e-14));
}

/// `V = 1/3 sum over boundary quads of the flux of x`: closes only if every quad is there and faces outward.
fn volume_by_boundary(mesh: &HexMesh) -> f64 {
    let position = |node: NodeIdx| mesh.nodes()[node.index()].coords;
    let tetrahedron = |a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>| a.dot(&b.cross(&c)) / 6.0;
    let quads = mesh.boundary_quads().into_iter().map(|quad| quad.map(position));
    // A bilinear quad's flux is the mean over its two cuts into triangles.
    let flux = |[a, b, c, d]: [Vector3<f64>; 4]| {
        let one = tetrahedron(a, b, c) + tetrahedron(a, c, d);
        0.5 * (one + tetrahedron(a, b, d) + tetrahedron(b, c, d))
    };
    quads.map(flux).sum()
}

#[test]
fn boundary_quads_are_outward_and_closed() {
    for mesh in [default_wedge(), distorted_block(), u_shape()] {
        let (inside, boundary) = (mesh.volume(), volume_by_boundary(&mesh));
        assert!(close(inside, boundary, 1e-12), "{inside:e} against {boundary:e}");
    }
    assert_eq!(block([1.0; 3], [3, 2, 4]).boundary_quads().len(), 2 * (6 + 12 + 8));
}

#[test]
fn neighbourhoods_count_as_they_should() {
    let mesh = block([1.0; 3], [3, 3, 3]);
    let (hexes, nodes) = (mesh.hexes_around_nodes(), mesh.node_neighbours());
    let inner = 1 + 4 * (1 + 4);
    assert_eq!((hexes[0].len(), nodes[0].len()), (1, 7));
    assert_eq!((hexes[inner].len(), nodes[inner].len()), (8, 26));
    assert_eq!(hexes.iter().map(Vec::len).sum::<usize>(), 8 * mesh.n_hexes());
}

fn parts_of(mesh: &HexMesh) -> (Vec<Point3<f64>>, Vec<[NodeIdx; 8]>) {
    (mesh.nodes().to_vec(), mesh.hexes().to_vec())
}

#[test]
fn an_index_out_of_range_is_refused() {
    let (nodes, mut hexes) = parts_of(&default_wedge());
    hexes[17][3] = NodeIdx(225);
    let expected = MeshError::NodeOutOfRange { hex: HexIdx(17), corner: 3, node: NodeIdx(225), n_nodes: 225 };
    assert_eq!(HexMesh::new(nodes, hexes), Err(expected));
}

#[test]
fn an_inverted_hexahedron_is_refused() {
    let (nodes, mut hexes) = parts_of(&default_wedge());
    hexes[5].swap(0, 6);
    let error = HexMesh::new(nodes, hexes).unwrap_err();
    assert!(matches!(error, MeshError::Inverted { hex: HexIdx(5), determinant, .. } if determinant < 0.0), "{error}");
}

#[test]
fn a_flat_hexahedron_is_refused() {
    let (mut nodes, hexes) = parts_of(&block([0.1; 3], [1, 1, 1]));
    nodes.iter_mut().for_each(|x| x.z *= 1e-12);
    let error = HexMesh::new(nodes, hexes).unwrap_err();
    assert!(matches!(error, MeshError::Inverted { limit, .. } if limit > 0.0), "{error}");
}

#[test]
fn an_unused_node_is_refused() {
    let (mut nodes, hexes) = parts_of(&default_wedge());
    nodes.push(Point3::new(1.0, 2.0, 3.0));
    let expected = MeshError::UnusedNodes { first: NodeIdx(225), n_unused: 1, n_nodes: 226 };
    assert_eq!(HexMesh::new(nodes, hexes), Err(expected));
}

#[test]
fn a_position_that_is_not_a_number_is_refused() {
    let (mut nodes, hexes) = parts_of(&default_wedge());
    nodes[9].y = f64::NAN;
    let error = HexMesh::new(nodes, hexes).unwrap_err();
    assert!(error.to_string().starts_with("node 9 has the non-finite position [0, NaN, 0]"), "{error}");
}

#[test]
fn a_hexahedron_given_twice_is_refused() {
    let (nodes, mut hexes) = parts_of(&block([0.1; 3], [2, 1, 1]));
    hexes.push(hexes[1]);
    let error = HexMesh::new(nodes, hexes).unwrap_err();
    assert!(matches!(error, MeshError::CrowdedFace { n_hexes: 3, .. }), "{error}");
}

#[test]
fn no_hexahedra_are_refused() {
    assert_eq!(HexMesh::new(vec![], vec![]), Err(MeshError::Empty { n_nodes: 0 }));
}

#[test]
fn the_u_shape_of_these_tests_has_its_gap() {
    let mesh = u_shape();
    assert_eq!(mesh.n_hexes(), 60 - 10);
    let in_gap = |x: Point3<f64>| x.x > 0.02 && x.x < 0.03 && x.z > 0.01;
    assert!(!mesh.hex_indices().any(|hex| in_gap(centre(&mesh, hex))));
}

#[test]
fn bodies_that_share_no_node_are_apart() {
    let (mut nodes, mut hexes) = parts_of(&block([0.1; 3], [2, 1, 1]));
    assert_eq!(HexMesh::new(nodes.clone(), hexes.clone()).unwrap().bodies(), (vec![0; 12], 1));
    let n = nodes.len() as u32;
    nodes.extend(nodes.clone().iter().map(|x| x + Vector3::new(1.0, 0.0, 0.0)));
    hexes.extend(hexes.clone().iter().map(|hex| hex.map(|node| NodeIdx(node.0 + n))));
    let (bodies, n_bodies) = HexMesh::new(nodes, hexes).unwrap().bodies();
    assert_eq!((n_bodies, &bodies[..12], &bodies[12..]), (2, &[0; 12][..], &[1; 12][..]));
}
