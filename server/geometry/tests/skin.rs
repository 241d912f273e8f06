//! Skins: closed, on the object's boundary; errors of malformed input.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{SPACING_M, default_skin, default_wedge};
use nalgebra::{Point3, Vector3};
use plica_geometry::shapes::{Wedge, block, block_skin, wedge_skin};
use plica_geometry::{Skin, SkinError, TriangleIdx, VertexIdx, locate};

fn tetrahedron() -> (Vec<Point3<f64>>, Vec<[VertexIdx; 3]>) {
    let positions =
        vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0), Point3::new(0.0, 0.0, 1.0)];
    let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
    (positions, triangles.map(|t| t.map(VertexIdx)).to_vec())
}

#[test]
fn the_wedge_skin_has_the_size_of_the_scene() {
    let skin = default_skin();
    println!("wedge skin: {} vertices, {} triangles", skin.n_vertices(), skin.n_triangles());
    assert!((6_700..=7_100).contains(&skin.n_vertices()), "{}", skin.n_vertices());
}

#[test]
fn generated_skins_are_closed_spheres_with_the_mesh_volume() {
    let wedge = default_skin();
    let steep = wedge_skin(&Wedge { length_m: 0.05, width_m: 0.2, thick_height_m: 0.01, thin_height_m: 0.03 }, 0.004);
    let slab = block_skin([0.1, 0.02, 0.03], 0.005);
    let coarsest = block_skin([0.1, 0.1, 0.1], 1.0);
    let volumes = [0.12 * 0.06 * 0.025, 0.05 * 0.2 * 0.02, 0.1 * 0.02 * 0.03, 1e-3];
    for (skin, volume) in [wedge, steep, slab, coarsest].iter().zip(volumes) {
        let n_edges = skin.edges().len();
        let euler = skin.n_vertices() as i64 - n_edges as i64 + skin.n_triangles() as i64;
        assert_eq!((euler, skin.euler_characteristic()), (2, 2));
        assert!((skin.volume() / volume - 1.0).abs() < 1e-12, "{:e} against {volume:e}", skin.volume());
    }
}

#[test]
fn mesh_and_skin_enclose_the_same_volume() {
    let ratio = default_skin().volume() / default_wedge().volume();
    assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
}

/// Every vertex is in the mesh, and on one of the wedge's six faces.
#[test]
fn skin_vertices_lie_on_the_boundary_of_the_mesh() {
    let (mesh, wedge) = (default_wedge(), Wedge::default());
    for x in default_skin().positions() {
        assert!(locate(&mesh, x, 1e-15).is_some(), "{x} is outside");
        let to_faces = [x.x, wedge.length_m - x.x, x.y, wedge.width_m - x.y, x.z, wedge.height_m(x.x) - x.z];
        assert!(to_faces.iter().any(|distance| distance.abs() < 1e-16), "{x} is inside");
    }
}

#[test]
fn the_top_is_a_regular_grid_of_the_spacing() {
    let skin = default_skin();
    let wedge = Wedge::default();
    let top: Vec<_> = skin.positions().iter().filter(|x| x.z == wedge.height_m(x.x)).collect();
    assert_eq!(top.len(), 99 * 50);
    let step = (top[1] - top[0]).xy().norm();
    assert!((step / SPACING_M - 1.0).abs() < 0.02, "{step}");
}

#[test]
fn diagonals_of_the_top_favour_no_direction() {
    let skin = default_skin();
    let on_top = |t: &[VertexIdx; 3]| t.iter().all(|v| skin.positions()[v.index()].z >= 0.0099);
    let mut rising = 0_i64;
    for t in skin.triangles().iter().filter(|t| on_top(t)) {
        for k in 0..3 {
            let along = skin.positions()[t[(k + 1) % 3].index()] - skin.positions()[t[k].index()];
            if along.x.abs() > 1e-6 && along.y.abs() > 1e-6 {
                rising += (along.x * along.y).signum() as i64;
            }
        }
    }
    assert!(rising.abs() <= 2, "{rising} more diagonals one way than the other");
}

#[test]
fn normals_are_unit_and_outward() {
    let skin = block_skin([0.04, 0.04, 0.04], 0.01);
    let centre = Point3::new(0.02, 0.02, 0.02);
    for (x, n) in skin.positions().iter().zip(skin.vertex_normals()) {
        assert!((n.norm() - 1.0).abs() < 1e-14);
        assert!(n.dot(&(x - centre)) > 0.0, "{n} at {x}");
    }
    let diagonal = Vector3::new(1.0, 1.0, 1.0).normalize();
    let corner = skin.positions().iter().position(|x| *x == Point3::new(0.04, 0.04, 0.04)).unwrap();
    assert!((skin.vertex_normals()[corner] - diagonal).norm() < 1e-14, "however its faces are cut");
}

#[test]
fn areas_add_up() {
    let skin = block_skin([0.1, 0.02, 0.03], 0.003);
    let expected = 2.0 * (0.1 * 0.02 + 0.1 * 0.03 + 0.02 * 0.03);
    for total in [skin.triangle_areas().iter().sum::<f64>(), skin.vertex_areas().iter().sum()] {
        assert!((total / expected - 1.0).abs() < 1e-12, "{total}");
    }
}

#[test]
fn triangle_edges_name_the_edges_between_their_corners() {
    let skin = default_skin();
    let edges = skin.edges();
    assert_eq!(edges.len(), 3 * skin.n_triangles() / 2);
    for (t, named) in skin.triangles().iter().zip(skin.triangle_edges()) {
        for k in 0..3 {
            let mut corners = [t[k], t[(k + 1) % 3]];
            corners.sort_unstable();
            assert_eq!(edges[named[k] as usize], corners);
        }
    }
}

#[test]
fn a_good_tetrahedron_is_taken() {
    let (positions, triangles) = tetrahedron();
    let skin = Skin::new(positions, triangles).unwrap();
    assert!((skin.volume() - 1.0 / 6.0).abs() < 1e-15);
}

#[test]
fn an_open_skin_is_refused() {
    let (positions, mut triangles) = tetrahedron();
    triangles.pop();
    let error = Skin::new(positions, triangles).unwrap_err();
    assert!(matches!(error, SkinError::Edge { n_forward: 1, n_backward: 0, .. }), "{error}");
}

#[test]
fn a_turned_triangle_is_refused() {
    let (positions, mut triangles) = tetrahedron();
    triangles[2].swap(0, 1);
    let error = Skin::new(positions, triangles).unwrap_err();
    assert!(matches!(error, SkinError::Edge { n_forward: 2, n_backward: 0, .. }), "{error}");
}

#[test]
fn an_inward_skin_is_refused() {
    let (positions, mut triangles) = tetrahedron();
    triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let error = Skin::new(positions, triangles).unwrap_err();
    assert!(matches!(error, SkinError::Inward { volume } if (volume + 1.0 / 6.0).abs() < 1e-15), "{error}");
}

#[test]
fn a_triangle_without_area_is_refused() {
    let (mut positions, triangles) = tetrahedron();
    positions[2] = Point3::new(2.0, 0.0, 0.0);
    let expected = SkinError::Degenerate { triangle: TriangleIdx(0), area: 0.0 };
    assert_eq!(Skin::new(positions, triangles), Err(expected));
}

#[test]
fn an_index_out_of_range_and_an_unused_vertex_are_refused() {
    let (positions, mut triangles) = tetrahedron();
    triangles[1][2] = VertexIdx(4);
    let expected = SkinError::VertexOutOfRange { triangle: TriangleIdx(1), vertex: VertexIdx(4), n_vertices: 4 };
    assert_eq!(Skin::new(positions, triangles), Err(expected));

    let (mut positions, triangles) = tetrahedron();
    positions.push(Point3::origin());
    let expected = SkinError::Vertex { vertex: VertexIdx(4), n_triangles: 0, n_in_fan: 0 };
    assert_eq!(Skin::new(positions, triangles), Err(expected));
}

/// Two tetrahedra that share one vertex: every edge is manifold, the vertex is not.
#[test]
fn surfaces_that_touch_in_a_point_are_refused() {
    let (mut positions, mut triangles) = tetrahedron();
    positions.extend([Point3::new(-1.0, 0.0, 0.0), Point3::new(0.0, -1.0, 0.0), Point3::new(0.0, 0.0, -1.0)]);
    // A point reflection turns the triangles inside out, hence the swapped corners.
    triangles.extend([[0, 4, 5], [0, 6, 4], [4, 6, 5], [0, 5, 6]].map(|t| t.map(VertexIdx)));
    let expected = SkinError::Vertex { vertex: VertexIdx(0), n_triangles: 6, n_in_fan: 3 };
    assert_eq!(Skin::new(positions, triangles), Err(expected));
}

#[test]
fn infinite_positions_and_no_triangles_are_refused() {
    let (mut positions, triangles) = tetrahedron();
    positions[3].z = f64::INFINITY;
    let error = Skin::new(positions, triangles).unwrap_err();
    assert_eq!(error.to_string(), "vertex 3 has the non-finite position [0, 0, inf]");
    assert_eq!(Skin::new(vec![], vec![]), Err(SkinError::Empty { n_vertices: 0 }));
}

#[test]
#[should_panic(expected = "sizes of a shape must be positive")]
fn a_block_without_height_is_refused() {
    block([1.0, 1.0, 0.0], [1, 1, 1]);
}
