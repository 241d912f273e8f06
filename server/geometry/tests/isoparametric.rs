//! The trilinear map: partition of unity, gradients against finite differences, inverse against the map.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{Random, distorted_block};
use nalgebra::Point3;
use plica_geometry::isoparametric::{CORNERS, inverse_map, jacobian, map, shape_functions, shape_gradients};
use plica_geometry::shapes::block;
use plica_geometry::{HEX_FACES, HexIdx, locate};

fn random_xi(random: &mut Random) -> [f64; 3] {
    random.vector().into()
}

#[test]
fn shape_functions_sum_to_one_and_gradients_to_zero() {
    let mut random = Random(1);
    for _ in 0..100 {
        let xi = random_xi(&mut random);
        assert!((shape_functions(xi).iter().sum::<f64>() - 1.0).abs() < 1e-15);
        for k in 0..3 {
            assert!(shape_gradients(xi).iter().map(|g| g[k]).sum::<f64>().abs() < 1e-15);
        }
    }
}

#[test]
fn shape_functions_are_one_at_their_own_corner_only() {
    for (a, xi) in CORNERS.into_iter().enumerate() {
        let values = shape_functions(xi);
        assert!((0..8).all(|b| values[b] == f64::from(u8::from(a == b))), "{values:?}");
    }
}

#[test]
fn gradients_agree_with_central_differences() {
    const STEP: f64 = 1e-5;
    let mut random = Random(2);
    for _ in 0..50 {
        let xi = random_xi(&mut random);
        for k in 0..3 {
            let moved = |by: f64| {
                let mut xi = xi;
                xi[k] += by;
                shape_functions(xi)
            };
            let (after, before) = (moved(STEP), moved(-STEP));
            for a in 0..8 {
                let difference = (after[a] - before[a]) / (2.0 * STEP);
                assert!((difference - shape_gradients(xi)[a][k]).abs() < 1e-10);
            }
        }
    }
}

#[test]
fn corners_are_in_vtk_order() {
    let mesh = block([2.0; 3], [1, 1, 1]);
    let from_reference = mesh.corner_positions(HexIdx(0)).map(|x| [x.x - 1.0, x.y - 1.0, x.z - 1.0]);
    assert_eq!(from_reference, CORNERS);
    let centre = Point3::new(1.0, 1.0, 1.0);
    for face in HEX_FACES {
        let [a, b, c, _] = face.map(|corner| mesh.corner_positions(HexIdx(0))[corner]);
        assert!((b - a).cross(&(c - b)).dot(&(a - centre)) > 0.0, "face {face:?} is outward");
    }
}

#[test]
fn the_inverse_map_undoes_the_map_inside_and_a_little_outside() {
    let mesh = distorted_block();
    let mut random = Random(3);
    for hex in mesh.hex_indices() {
        let corners = mesh.corner_positions(hex);
        for _ in 0..20 {
            let xi = random_xi(&mut random).map(|c| 1.3 * c);
            let found = inverse_map(&corners, &map(&corners, xi)).unwrap();
            assert!((0..3).all(|k| (found[k] - xi[k]).abs() < 1e-11), "{found:?} for {xi:?} in {hex}");
            assert!(jacobian(&corners, xi.map(|c| c.clamp(-1.0, 1.0))).determinant() > 0.0);
        }
    }
}

#[test]
fn points_are_found_in_their_hexahedron() {
    let mesh = distorted_block();
    let mut random = Random(4);
    for hex in mesh.hex_indices() {
        let corners = mesh.corner_positions(hex);
        let found = locate(&mesh, &map(&corners, random_xi(&mut random)), 0.0).unwrap();
        assert_eq!((found.hex, found.distance_m), (hex, 0.0));
    }
}

#[test]
fn a_point_outside_is_given_the_nearest_hexahedron_and_its_distance() {
    let mesh = block([0.1; 3], [5, 5, 5]);
    let above = Point3::new(0.05, 0.05, 0.103);
    let found = locate(&mesh, &above, 0.01).unwrap();
    assert_eq!(found.hex, HexIdx(2 + 5 * (2 + 5 * 4)));
    assert!((found.distance_m - 0.003).abs() < 1e-15);
    assert!(locate(&mesh, &above, 0.002).is_none());
}
