//! Selection by conditions in words.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::path::Path;

use common::default_wedge;
use nalgebra::Point3;
use plica_geometry::import::{Groups, NamedMesh, ReadOptions, read_mesh};
use plica_geometry::predicate::Predicate;
use plica_geometry::select::{SelectError, Selector, Side};
use plica_geometry::shapes::{Hexahedron, block, hexahedron, wedge};
use plica_geometry::{ElementIdx, VolumeMesh};
use proptest::prelude::*;

fn holds(text: &str, x: [f64; 3]) -> bool {
    Predicate::parse(text).unwrap_or_else(|e| panic!("{text}: {e}")).holds(&x.into())
}

#[test]
fn conditions_mean_what_they_say() {
    let x = [0.6e-3, 0.7e-3, 0.0];
    for (text, expected) in [
        ("z < 1e-6", true),
        ("x > 0.5e-3 && y > 0.5e-3", true),
        ("x > 0.5e-3 && y > 0.75e-3", false),
        ("x > 1 || y > 1 || z == 0", true),
        ("x > 1 || y > 1 && z == 0", false),
        ("!(x > 1) && z != 1", true),
        ("x + y * 2 - 1e-3 > 0.9e-3", true),
        ("(x + y) * 2 >= 2.6e-3", true),
        ("1 - 1 - 1 == -1", true),
        ("8 / 2 / 2 == 2", true),
        ("--1 == 1", true),
        ("-x < 0", true),
        ("sqrt(x * x + y * y) <= 0.95e-3", true),
        ("abs(z - 1) < 1.5 && ((x < y))", true),
        ("sqrt(-1) < 2", false),
        ("1E+1==10", true),
        (".5 < 1.", true),
    ] {
        assert_eq!(holds(text, x), expected, "{text}");
    }
}

#[test]
fn what_is_no_condition_is_told_with_its_column() {
    for (text, column, part) in [
        ("", 1, "ends"),
        ("x >", 4, "ends"),
        ("x > 0.5 mm", 9, "`mm` does not continue"),
        ("x = 1", 3, "equal is =="),
        ("x < 1 & y < 1", 7, "and is &&"),
        ("x | y", 3, "or is ||"),
        ("r < 1", 1, "`r` is unknown; there are x, y, z"),
        ("x", 1, "a number, not a condition"),
        ("x + y", 1, "a number, not a condition"),
        ("0 < x < 1", 7, "write `0 < x && x < 1`"),
        ("x && y < 1", 1, "a condition is expected"),
        ("!x", 2, "a condition is expected"),
        ("-(x < 1)", 3, "a number is expected"),
        ("(x < 1", 7, "not closed"),
        ("x < 1)", 6, "`)` does not continue"),
        ("(x < 1 y", 8, "where `)` is expected"),
        ("sqrt x", 1, "needs its argument"),
        ("1e99999 < x", 1, "is not a number"),
        ("1.2.3 < x", 1, "is not a number"),
        ("x ≤ 1", 3, "`≤` has no meaning"),
        ("é", 1, "no meaning"),
    ] {
        let error = Predicate::parse(text).expect_err(text);
        assert!(error.column == column && error.problem.contains(part), "{text}: {error}");
    }
    let deep = format!("{}x < 1{}", "(".repeat(100_000), ")".repeat(100_000));
    assert!(Predicate::parse(&deep).unwrap_err().problem.contains("50 parentheses"));
    assert!(Predicate::parse(&"!".repeat(100_000)).is_err());
}

const WORDS: [&str; 20] =
    ["x", "y", "1.5", "e", "(", ")", "<", ">", "=", "!", "&", "|", "+", "-", "*", "/", " ", "abs", "&&", "< 1"];

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    /// No text causes a panic.
    #[test]
    fn any_text_has_an_answer(words in prop::collection::vec(prop::sample::select(&WORDS[..]), 0..12)) {
        if let Ok(condition) = Predicate::parse(&words.concat()) {
            condition.holds(&Point3::new(0.1, 0.2, 0.3));
        }
    }
}

fn side(axis: usize, upper: bool) -> Selector {
    Selector { side: Some(Side { axis, upper }), ..Selector::default() }
}

#[test]
fn sides_boxes_and_conditions_select_together() {
    let (mesh, none) = (VolumeMesh::from(block([4.0, 3.0, 2.0], [4, 3, 2])), Groups::default());
    assert_eq!(side(2, true).nodes(&mesh, &none).unwrap().len(), 20);
    assert_eq!(side(2, true).faces(&mesh, &none).unwrap().len(), 12);
    assert_eq!(side(0, false).elements(&mesh, &none).unwrap().len(), 6);
    let quarter = Selector { condition: Some(Predicate::parse("x > 2 && y > 2").unwrap()), ..side(2, true) };
    assert_eq!(quarter.faces(&mesh, &none).unwrap().len(), 2, "by centres");
    assert_eq!(quarter.nodes(&mesh, &none).unwrap().len(), 2, "by positions, the border excluded");
    let corners = [Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 1.0, 1.0)];
    let corner = Selector { within: Some(corners), ..Selector::default() };
    assert_eq!(corner.nodes(&mesh, &none).unwrap().len(), 8, "the border belongs to a box");
    assert_eq!(corner.elements(&mesh, &none).unwrap(), [ElementIdx(0)]);
    assert_eq!(corner.faces(&mesh, &none).unwrap().len(), 3);
    let nothing = Selector { within: Some(corners), ..side(2, true) };
    assert_eq!(nothing.nodes(&mesh, &none), Err(SelectError::Empty { n: 60, of: "nodes" }));
    for axis in 0..3 {
        let outward = side(axis, true).faces(&mesh, &none).unwrap();
        let x = |node: plica_geometry::NodeIdx| mesh.nodes()[node.index()];
        assert!(outward.iter().all(|face| {
            let [a, b, c, _] = face.nodes() else { return false };
            (x(*b) - x(*a)).cross(&(x(*c) - x(*b)))[axis] > 0.0
        }));
    }
}

fn boxes(file: &str) -> NamedMesh {
    read_mesh(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file), ReadOptions::unit(1e-3)).unwrap()
}

fn group(name: &str) -> Selector {
    Selector { group: Some(name.to_owned()), ..Selector::default() }
}

#[test]
fn groups_select_nodes_faces_and_hexahedra() {
    let NamedMesh { mesh, groups, .. } = boxes("boxes-4.1-ascii.msh");
    assert_eq!(group("bottom").nodes(&mesh, &groups).unwrap().len(), 15);
    assert_eq!(group("bottom").faces(&mesh, &groups).unwrap().len(), 8);
    assert_eq!(group("soft").elements(&mesh, &groups).unwrap().len(), 8);
    assert_eq!(group("soft").faces(&mesh, &groups).unwrap().len(), 5 * 4, "its boundary, less the common face");
    let both = Selector { group: Some("bottom".to_owned()), ..side(0, false) };
    assert_eq!(both.nodes(&mesh, &groups).unwrap().len(), 3);
    let error = group("top").nodes(&mesh, &groups).unwrap_err().to_string();
    assert_eq!(error, "no group `top`; the mesh has `corner`, `edge`, `bottom`, `77`, `end`, `soft`, `stiff`");
    let error = group("bottom").elements(&mesh, &groups).unwrap_err().to_string();
    assert_eq!(error, "group `bottom` has no hexahedra: it is a group of faces");
    assert_eq!(group("edge").faces(&mesh, &groups), Err(SelectError::Empty { n: 40, of: "boundary faces" }));
    let NamedMesh { mesh, groups, .. } = boxes("boxes-appended-raw.vtu");
    assert_eq!(group("fixed=1").faces(&mesh, &groups).unwrap().len(), 8, "faces with all corners in a group of points");
}

#[test]
fn a_hexahedron_is_divided_as_asked() {
    let wedge_shape = plica_geometry::shapes::Wedge::default();
    let corner = |x: f64, y: f64, top: bool| Point3::new(x, y, if top { wedge_shape.height_m(x) } else { 0.0 });
    let ring = |top| [corner(0.0, 0.0, top), corner(0.12, 0.0, top), corner(0.12, 0.06, top), corner(0.0, 0.06, top)];
    let ([a, b, c, d], [e, f, g, h]) = (ring(false), ring(true));
    let shape = Hexahedron { corners: [a, b, c, d, e, f, g, h], divisions: [8, 4, 4], grading: [1.0; 3] };
    let mesh = hexahedron(&shape).unwrap();
    let same = wedge(&wedge_shape, [8, 4, 4]);
    assert_eq!(mesh.hexes(), default_wedge().hexes());
    let apart = mesh.nodes().iter().zip(same.nodes()).map(|(x, y)| (x - y).norm()).fold(0.0, f64::max);
    assert!(apart < 1e-16, "{apart}");

    let graded = hexahedron(&Hexahedron { grading: [4.0, 0.25, 1.0], ..shape }).unwrap();
    let lengths: Vec<f64> = (0..8).map(|i| graded.nodes()[i + 1].x - graded.nodes()[i].x).collect();
    assert!((lengths[7] / lengths[0] - 4.0).abs() < 1e-12, "{lengths:?}");
    assert!(lengths.windows(2).all(|pair| (pair[1] / pair[0] - 4.0_f64.powf(1.0 / 7.0)).abs() < 1e-12));
    assert!((graded.nodes()[8].x - 0.12).abs() < 1e-16);
    assert!(hexahedron(&Hexahedron { corners: [e, f, g, h, a, b, c, d], ..shape }).is_err(), "inside out");
}

#[test]
fn areas_of_faces_add_up() {
    let mesh = block([4.0, 3.0, 2.0], [4, 3, 2]);
    let area: f64 = mesh.boundary_quads().iter().map(|quad| mesh.quad_area(quad)).sum();
    assert!((area - 2.0 * (12.0 + 8.0 + 6.0)).abs() < 1e-12, "{area}");
}
