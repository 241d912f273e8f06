//! Meshes whose parts touch without sharing nodes: refused with number and place, or merged.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::path::Path;

use common::vtu::{Bar, vtu};
use plica_geometry::HexMesh;
use plica_geometry::import::{NamedMesh, ReadOptions, parse_mesh};
use plica_geometry::joints::Joints;

const MILLIMETRES: f64 = 1e-3;

fn read(bars: &[Bar], merge_tolerance_m: Option<f64>) -> Result<NamedMesh, String> {
    let options = ReadOptions { metres_per_unit: MILLIMETRES, merge_tolerance_m };
    parse_mesh(Path::new("a.vtu"), vtu(bars).as_bytes(), options).map_err(|error| error.to_string())
}

fn bar(lower: [f64; 3], upper: [f64; 3], divisions: [usize; 3]) -> Bar {
    Bar { lower, upper, divisions }
}

/// Bar of 40 x 20 x 20 mm.
fn halves(left: [usize; 3], right: [usize; 3]) -> [Bar; 2] {
    [bar([0.0; 3], [20.0, 20.0, 20.0], left), bar([20.0, 0.0, 0.0], [40.0, 20.0, 20.0], right)]
}

#[test]
fn parts_that_touch_without_sharing_nodes_are_refused_with_number_and_place() {
    let cube = |x: f64, y: f64, z: f64| bar([x, y, z], [x + 10.0, y + 10.0, z + 10.0], [1; 3]);
    let shifted = bar([10.0, 0.0, 0.0], [20.0, 10.02, 10.0], [1; 3]);
    let near_coincident = bar([20.005, 0.0, 0.0], [40.0, 20.0, 20.0], [2; 3]);
    let cases: [(&str, Vec<Bar>, &[&str]); 9] = [
        (
            "two halves, each with its own nodes",
            halves([2; 3], [2; 3]).into(),
            &[
                "at 9 points several nodes",
                "the first at (20, 0, 0)",
                "(20, 0, 0) to (20, 20, 20)",
                "merge_tolerance_m = ",
            ],
        ),
        (
            "two halves a hair apart",
            vec![halves([2; 3], [2; 3])[0], near_coincident],
            &["at 9 points several nodes", "merge_tolerance_m = 1.0e-5"],
        ),
        (
            "twice as fine on one side",
            halves([2; 3], [4; 3]).into(),
            &["at 9 points several nodes", "elsewhere their faces do not match", "mesh the body anew"],
        ),
        (
            "2 against 3 on a side",
            halves([2; 3], [2, 3, 3]).into(),
            &["at 4 points several nodes", "elsewhere their faces do not match"],
        ),
        (
            "no node in common",
            vec![bar([0.0; 3], [20.0; 3], [1; 3]), bar([20.0, 5.0, 5.0], [30.0, 15.0, 15.0], [1; 3])],
            &["4 nodes lie on a face of another", "the first at (20, 5, 5)", "(20, 15, 15)", "mesh the body anew"],
        ),
        (
            "faces that cross",
            vec![
                bar([0.0, 0.0, 0.0], [30.0, 10.0, 10.0], [1; 3]),
                bar([10.0, -10.0, 10.0], [20.0, 20.0, 20.0], [1; 3]),
            ],
            &["2 faces overlap", "(15, 5, 10)"],
        ),
        ("an edge, own nodes", vec![cube(0.0, 0.0, 0.0), cube(10.0, 10.0, 0.0)], &["at 2 points several nodes"]),
        ("a corner, own nodes", vec![cube(0.0, 0.0, 0.0), cube(10.0, 10.0, 10.0)], &["at 1 point several nodes"]),
        ("a width that is a little off", vec![cube(0.0, 0.0, 0.0), shifted], &["at 4 points several nodes"]),
    ];
    for (name, bars, fragments) in cases {
        let message = read(&bars, None).expect_err(name);
        println!("{name}: {message}");
        for fragment in fragments {
            assert!(message.contains(fragment), "{name}: `{fragment}` is missing in: {message}");
        }
        let kept = read(&bars, Some(0.0)).unwrap();
        assert!(!kept.remarks.is_empty(), "{name}: kept apart in silence");
    }
}

#[test]
fn coincident_nodes_are_merged_where_that_is_asked_for() {
    let merged = read(&halves([2; 3], [2; 3]), Some(1e-6)).unwrap();
    assert_eq!((merged.mesh.n_nodes(), merged.mesh.n_elements()), (45, 16));
    assert!(merged.remarks[0].contains("9 nodes were merged"), "{:?}", merged.remarks);
    assert_eq!(merged.remarks.len(), 1);
    // 0.01 mm apart: a smaller tolerance leaves them, and says so.
    let gap = [halves([2; 3], [2; 3])[0], bar([20.01, 0.0, 0.0], [40.0, 20.0, 20.0], [2; 3])];
    assert!(read(&gap, Some(1e-6)).unwrap_err().contains("at 9 points several nodes"));
    assert_eq!(read(&gap, Some(2e-5)).unwrap().mesh.n_nodes(), 45);
    let too_much = read(&halves([2; 3], [2; 3]), Some(0.012)).unwrap_err();
    assert!(too_much.contains("two nodes of a hexahedron, which are 1e-2 m apart"), "{too_much}");
    // Every hexahedron with nodes of its own, as a discontinuous field is written.
    let cubes: Vec<Bar> = (0..27)
        .map(|i| [i % 3, i / 3 % 3, i / 9].map(f64::from))
        .map(|lower| bar(lower, lower.map(|c| c + 1.0), [1; 3]))
        .collect();
    assert!(read(&cubes, None).unwrap_err().contains("at 56 points several nodes"));
    assert_eq!(read(&cubes, Some(1e-6)).unwrap().mesh.n_nodes(), 64);
}

#[test]
fn what_merging_does_not_join_is_still_refused() {
    for (right, hanging) in [([4; 3], "16 nodes lie on a face"), ([2, 3, 3], "nodes lie on a face of another")] {
        let message = read(&halves([2; 3], right), Some(1e-6)).unwrap_err();
        assert!(message.contains(hanging) && message.contains("hanging nodes"), "{message}");
    }
    let cube = |x: f64, y: f64, z: f64| bar([x, y, z], [x + 10.0, y + 10.0, z + 10.0], [1; 3]);
    let edge = read(&[cube(0.0, 0.0, 0.0), cube(10.0, 10.0, 0.0)], Some(1e-6)).unwrap_err();
    assert!(edge.contains("2 parts share no face and hang together by 2 nodes"), "{edge}");
    let corner = read(&[cube(0.0, 0.0, 0.0), cube(10.0, 10.0, 10.0)], Some(1e-6)).unwrap_err();
    assert!(corner.contains("hang together by 1 node on edges or corners only, at (10, 10, 10)"), "{corner}");
}

#[test]
fn an_edge_within_one_part_and_a_narrow_gap_are_remarks() {
    let cube =
        |x: i32, y: i32| bar([f64::from(x), f64::from(y), 0.0], [f64::from(x) + 1.0, f64::from(y) + 1.0, 1.0], [1; 3]);
    // A ring of hexahedra that closes by an edge: 3 x 3 without the middle and one side.
    let ring = [cube(0, 0), cube(1, 0), cube(2, 0), cube(2, 1), cube(0, 1), cube(1, 2), cube(2, 2)];
    let pinched = read(&ring, Some(1e-6)).unwrap();
    assert!(pinched.remarks[1].contains("at 2 nodes hexahedra meet by an edge or a corner"), "{:?}", pinched.remarks);
    let apart = read(&[bar([0.0; 3], [1.0; 3], [1; 3]), bar([1.05, 0.0, 0.0], [2.0, 1.0, 1.0], [1; 3])], None).unwrap();
    assert!(apart.remarks[0].contains("there is a gap"), "{:?}", apart.remarks);
    let far = read(&[bar([0.0; 3], [1.0; 3], [1; 3]), bar([1.5, 0.0, 0.0], [2.0, 1.0, 1.0], [1; 3])], None).unwrap();
    assert!(far.remarks.is_empty(), "{:?}", far.remarks);
}

#[test]
fn sound_meshes_have_no_such_places() {
    let wedge =
        plica_geometry::shapes::Wedge { length_m: 0.12, width_m: 0.06, thick_height_m: 0.04, thin_height_m: 1e-4 };
    let meshes: [(&str, HexMesh); 3] = [
        ("thin wedge", plica_geometry::shapes::wedge(&wedge, [16, 8, 4])),
        ("plate", plica_geometry::shapes::block([1.0, 1.0, 1e-3], [10, 10, 1])),
        ("wide range of sizes", graded()),
    ];
    for (name, mesh) in meshes {
        let joints = Joints::find(&mesh);
        let sites = [joints.coincident, joints.hanging, joints.overlapping, joints.near, joints.hinged, joints.pinched];
        assert_eq!((sites, joints.n_parts), ([None; 6], 1), "{name}");
    }
}

/// Edges from 1 to 1000.
fn graded() -> HexMesh {
    let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
    let corners = corners.map(|c: [i32; 3]| c.map(f64::from).into());
    let shape = plica_geometry::shapes::Hexahedron { corners, divisions: [12, 12, 12], grading: [1000.0, 0.001, 1.0] };
    plica_geometry::shapes::hexahedron(&shape).unwrap()
}
