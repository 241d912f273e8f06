//! Convex polytopes: faces, surface and distances of hulls.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use nalgebra::{Point3, Vector3};
use plica_geometry::{ConvexPolytope, HullError};

/// Vertices of an icosahedron, its triangles divided into four `n_divisions` times, on a sphere.
fn geodesic_ball(n_divisions: usize, radius_m: f64) -> Vec<Point3<f64>> {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let rectangle = [[1.0, golden], [1.0, -golden], [-1.0, golden], [-1.0, -golden]];
    let icosahedron = rectangle.iter().flat_map(|&[a, b]| [[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    let mut vertices: Vec<Vector3<f64>> = icosahedron.map(Vector3::from).map(|v| v.normalize()).collect();
    let points = |vertices: &[Vector3<f64>]| vertices.iter().map(|v| Point3::from(v * radius_m)).collect();
    for _ in 0..n_divisions {
        let ball = ConvexPolytope::hull(points(&vertices)).unwrap();
        let directions: Vec<_> = ball.vertices().iter().map(|v| v.coords.normalize()).collect();
        let edges = ball.triangles().iter().flat_map(|t| edges_of(*t)).filter(|[a, b]| a < b);
        let middles: Vec<_> = edges.map(|[a, b]| (directions[a] + directions[b]).normalize()).collect();
        vertices.extend(middles);
    }
    points(&vertices)
}

fn edges_of([a, b, c]: [usize; 3]) -> [[usize; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

fn cuboid_corners(half: [f64; 3]) -> Vec<Point3<f64>> {
    let side = |i: usize, axis: usize| if i >> axis & 1 == 0 { -half[axis] } else { half[axis] };
    (0..8).map(|i| Point3::new(side(i, 0), side(i, 1), side(i, 2))).collect()
}

/// Closed, outward, Euler's formula, no point above a face.
fn check(polytope: &ConvexPolytope) {
    let (vertices, triangles) = (polytope.vertices(), polytope.triangles());
    assert_eq!(triangles.len(), 2 * vertices.len() - 4, "Euler's formula");
    let mut edges: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    triangles.iter().flat_map(|t| edges_of(*t)).for_each(|edge| *edges.entry(edge).or_default() += 1);
    assert!(edges.iter().all(|([a, b], n)| *n == 1 && edges.get(&[*b, *a]) == Some(&1)), "closed and oriented");
    for plane in polytope.planes() {
        let [a, b, c] = polytope.triangles()[plane.triangle].map(|v| vertices[v]);
        assert!((b - a).cross(&(c - a)).normalize().dot(&plane.normal) > 1.0 - 1e-12, "outward");
        assert!((plane.normal.dot(&a.coords) - plane.offset_m).abs() < 1e-12);
        assert!(polytope.points().iter().all(|p| plane.normal.dot(&p.coords) <= plane.offset_m));
    }
}

#[test]
fn a_ball_of_2562_vertices_is_made_in_well_under_a_second() {
    let points = geodesic_ball(4, 0.01);
    assert_eq!(points.len(), 2562);
    let start = Instant::now();
    let ball = ConvexPolytope::hull(points).unwrap();
    let elapsed = start.elapsed();
    println!("2,562 vertices: {:.1} ms", 1e3 * elapsed.as_secs_f64());
    assert!(elapsed < Duration::from_secs(1), "{elapsed:?}");
    check(&ball);
    assert_eq!((ball.vertices().len(), ball.planes().len()), (2562, 5120));
    assert!(ball.points().iter().all(|p| ball.distance(p).distance_m.abs() < 1e-12));
}

#[test]
fn coplanar_triangles_share_a_plane() {
    let half = [4e-3, 5e-3, 6e-3];
    let cuboid = ConvexPolytope::cuboid(half).unwrap();
    check(&cuboid);
    assert_eq!((cuboid.planes().len(), cuboid.triangles().len()), (6, 12));
    assert_eq!(cuboid, ConvexPolytope::hull(cuboid_corners(half)).unwrap());
    let outside = cuboid.distance(&Point3::new(0.0, 1e-3, -9e-3));
    assert!((outside.distance_m - 3e-3).abs() < 1e-15 && outside.normal == -Vector3::z(), "{outside:?}");
    assert_eq!(cuboid.distance(&Point3::new(3e-3, 0.0, 0.0)).distance_m, -1e-3);
}

#[test]
fn points_inside_are_kept_but_are_no_vertices() {
    let mut points = cuboid_corners([1.0, 2.0, 3.0]);
    points.insert(3, Point3::new(0.5, 0.5, 0.5));
    let polytope = ConvexPolytope::hull(points.clone()).unwrap();
    check(&polytope);
    assert_eq!(polytope.points(), points);
    assert_eq!(polytope.vertices().len(), 8);
}

/// A thin plate is a solid: 1 m by 1 m by 1 mm.
#[test]
fn a_thin_plate_has_its_thickness() {
    let plate = ConvexPolytope::cuboid([0.5, 0.5, 5e-4]).unwrap();
    check(&plate);
    assert_eq!(plate.distance(&Point3::origin()).distance_m, -5e-4);
}

#[test]
fn points_without_a_volume_are_refused() {
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]].map(Point3::from);
    assert_eq!(ConvexPolytope::hull(square.to_vec()), Err(HullError { n_points: 4 }));
    assert_eq!(ConvexPolytope::hull(Vec::new()), Err(HullError { n_points: 0 }));
    assert_eq!(ConvexPolytope::hull(vec![Point3::origin(); 5]), Err(HullError { n_points: 5 }));
    assert!(ConvexPolytope::cuboid([1.0, f64::NAN, 1.0]).is_err());
    assert!(ConvexPolytope::cuboid([1.0, 0.0, 1.0]).is_err());
}
