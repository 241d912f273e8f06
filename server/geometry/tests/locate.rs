//! Point location: the tree of boxes agrees with a test of every hexahedron, and distances are exact.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::time::Instant;

use common::{Random, default_skin, default_wedge, distorted_block, u_shape};
use nalgebra::{Point3, Vector3};
use plica_geometry::isoparametric::{closest_point, inverse_map, map};
use plica_geometry::shapes::{Wedge, block, wedge};
use plica_geometry::{Embedding, EmbeddingKind, HexIdx, HexMesh, Locator, NodeIdx, locate};

/// First hexahedron whose inverse map lands inside, with the reference coordinates.
fn first_containing(mesh: &HexMesh, x: &Point3<f64>) -> Option<(HexIdx, [f64; 3])> {
    mesh.hex_indices().find_map(|hex| {
        let xi = inverse_map(&mesh.corner_positions(hex), x)?;
        xi.iter().all(|c| c.abs() <= 1.0 + 1e-9).then_some((hex, xi))
    })
}

/// Points in and around a mesh: its box enlarged by a third.
fn points_around(mesh: &HexMesh, n: usize) -> Vec<Point3<f64>> {
    let lower = mesh.nodes().iter().fold(mesh.nodes()[0], |a, x| a.inf(x));
    let size = mesh.nodes().iter().fold(lower, |a, x| a.sup(x)) - lower;
    let mut random = Random(11);
    (0..n).map(|_| lower + size.component_mul(&(0.67 * random.vector() + Vector3::repeat(0.5)))).collect()
}

#[test]
fn the_tree_finds_bit_for_bit_what_asking_every_hexahedron_finds() {
    for mesh in [default_wedge(), distorted_block(), u_shape()] {
        let locator = Locator::new(&mesh);
        let mut n_outside = 0;
        for x in points_around(&mesh, 2000) {
            for reach in [0.0, 0.3 * mesh.mean_longest_edge(), f64::INFINITY] {
                let found = locator.locate(&x, reach);
                assert_eq!(found, locate(&mesh, &x, reach), "{x} within {reach}");
                n_outside += usize::from(found.is_some_and(|f| f.distance_m > 0.0));
            }
            let inside = locator.locate(&x, 0.0).map(|f| (f.hex, f.xi));
            assert_eq!(inside, first_containing(&mesh, &x), "{x}");
        }
        assert!(n_outside > 500, "{n_outside} points outside were tried");
    }
}

#[test]
fn every_skin_vertex_of_the_wedge_is_found_in_the_first_hexahedron_that_holds_it() {
    let (mesh, skin) = (default_wedge(), default_skin());
    let locator = Locator::new(&mesh);
    for x in skin.positions() {
        assert_eq!(locator.locate(x, 0.01).map(|f| (f.hex, f.xi)), first_containing(&mesh, x));
    }
}

/// Least distance of `x` to a regular grid of points of the element.
fn sampled_distance(corners: &[Point3<f64>; 8], x: &Point3<f64>) -> f64 {
    let grid = |i: usize| -1.0 + 2.0 * i as f64 / 20.0;
    let points = (0..21 * 21 * 21).map(|i| map(corners, [grid(i % 21), grid(i / 21 % 21), grid(i / 441)]));
    points.map(|p| (p - x).norm()).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_closest_point_is_at_least_as_near_as_any_sampled_one() {
    let mesh = distorted_block();
    let mut random = Random(12);
    let spacing = 0.1 * mesh.mean_longest_edge();
    for hex in mesh.hex_indices() {
        let corners = mesh.corner_positions(hex);
        let centre = map(&corners, [0.0; 3]);
        let x = centre + 0.03 * random.vector();
        let (distance, sampled) =
            ((map(&corners, closest_point(&corners, &x, [0.0; 3])) - x).norm(), sampled_distance(&corners, &x));
        assert!(distance <= sampled + 1e-12, "{distance} against {sampled} in {hex}");
        assert!(distance >= sampled - spacing, "{distance} against {sampled} in {hex}");
    }
}

/// A hexahedron that leans over: clamping the reference coordinates of a point above its top lands at the far end.
fn leaning() -> HexMesh {
    let mesh = block([0.01; 3], [1, 1, 1]);
    let leaned = mesh.nodes().iter().map(|x| Point3::new(x.x + 4.0 * x.z, x.y, x.z));
    HexMesh::new(leaned.collect(), mesh.hexes().to_vec()).unwrap()
}

#[test]
fn a_point_above_a_leaning_hexahedron_is_as_far_as_it_looks() {
    let mesh = leaning();
    let above = Point3::new(0.0425, 0.005, 0.0125);
    let found = locate(&mesh, &above, 0.0026).unwrap();
    assert!((found.distance_m - 0.0025).abs() < 1e-15, "{}", found.distance_m);
    let clamped = map(&mesh.corner_positions(HexIdx(0)), found.xi.map(|c| c.clamp(-1.0, 1.0)));
    assert!((clamped - above).norm() > 0.0035, "clamping overestimates: {}", (clamped - above).norm());
    Embedding::new(&mesh, &[above], EmbeddingKind::Trilinear).unwrap();
}

#[test]
fn coordinates_far_from_the_origin_cost_no_point() {
    let mesh = distorted_block();
    let shift = Vector3::new(0.7, -1.3, 2.1);
    let far = HexMesh::new(mesh.nodes().iter().map(|x| x + shift).collect(), mesh.hexes().to_vec()).unwrap();
    let locator = Locator::new(&far);
    for x in points_around(&mesh, 2000) {
        let (here, there) = (locate(&mesh, &x, 0.0), locator.locate(&(x + shift), 0.0));
        assert_eq!(here.map(|f| f.hex), there.map(|f| f.hex), "{x}");
    }
}

#[test]
fn no_place_is_no_place() {
    let mesh = block([0.1; 3], [2, 2, 2]);
    let locator = Locator::new(&mesh);
    assert_eq!(locator.locate(&Point3::new(f64::NAN, 0.0, 0.0), f64::INFINITY), None);
    assert_eq!(locator.locate(&Point3::new(0.2, 0.0, 0.0), 0.05), None);
    assert_eq!(locator.locate(&Point3::new(0.2, 0.0, 0.0), f64::NAN), None);
}

/// Hexahedra that share a node all contain it: the first one is returned.
#[test]
fn a_shared_node_belongs_to_the_first_hexahedron() {
    let mesh = distorted_block();
    let locator = Locator::new(&mesh);
    for (node, around) in mesh.hexes_around_nodes().iter().enumerate() {
        let x = mesh.nodes()[NodeIdx::from_index(node).index()];
        assert_eq!(locator.locate(&x, 0.0).map(|f| f.hex), around.first().copied());
    }
}

/// Speed of the tree. Prints the time; run with `--nocapture`.
#[test]
fn thousands_of_points_in_thousands_of_hexahedra() {
    let (mesh, skin) = (wedge(&Wedge::default(), [50, 30, 20]), default_skin());
    let begin = Instant::now();
    let locator = Locator::new(&mesh);
    let n_found = skin.positions().iter().filter(|x| locator.locate(x, 1e-3).is_some()).count();
    println!("{} of {} points in {} hexahedra: {:?}", n_found, skin.n_vertices(), mesh.n_hexes(), begin.elapsed());
    assert_eq!(n_found, skin.n_vertices());
}
