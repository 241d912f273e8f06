//! Conditions along directions other than the axes.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{distance, material, moved, rest, sides, solve};
use nalgebra::{Point3, Rotation3, Unit, Vector3};
use plica_accurate::{Constraints, Energy, Info, MaterialModel, Params, Pressure, Solid, reactions};
use plica_geometry::HexMesh;
use plica_geometry::shapes::block;

const SIZE: [f64; 3] = [0.03, 0.02, 0.02];

/// A block on three rollers with its far end moved by a quarter of its length, all turned by `turn`; positions turned back, and the
/// forces too.
fn squeezed(turn: &Rotation3<f64>) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>, Info) {
    let straight = block(SIZE, [3, 2, 2]);
    let mesh: HexMesh = moved(&straight, |x| Point3::from(turn * x.coords));
    let solid = Solid::uniform(&mesh, material(MaterialModel::StableNeoHookean, 3e4, 0.4)).unwrap();
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in straight.nodes().iter().enumerate() {
        for (axis, [least, greatest]) in sides(x, SIZE).into_iter().enumerate() {
            let normal = turn * Vector3::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 });
            if least {
                assert_eq!(constraints.give_along(node, &normal, 0.0), None);
            } else if axis == 0 && greatest {
                assert_eq!(constraints.give_along(node, &normal, 0.75 * SIZE[0]), None);
            }
        }
    }
    let side = straight
        .boundary_quads()
        .into_iter()
        .filter(|quad| quad.iter().all(|node| sides(&straight.nodes()[node.index()], SIZE)[1][1]));
    let water = Pressure::new(side.collect(), 500.0);
    let mut x = rest(&mesh);
    let energies: [&dyn Energy; 2] = [&solid, &water];
    let info = solve(&energies, &constraints, &Params::default(), &mut x).unwrap();
    let back = |v: &Vector3<f64>| turn.inverse() * v;
    (x.iter().map(back).collect(), reactions(&energies, &x).iter().map(back).collect(), info)
}

#[test]
fn rollers_at_any_angle_give_the_turned_solution() {
    let (straight, forces, info) = squeezed(&Rotation3::identity());
    for axis in [Vector3::new(1.0, 0.0, 0.0), Vector3::new(1.0, 2.0, -3.0)] {
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(axis), 0.7);
        let (x, turned_forces, turned) = squeezed(&turn);
        assert!(distance(&x, &straight) <= 1e-10 * SIZE[0], "{}", distance(&x, &straight));
        assert!(distance(&forces, &turned_forces) <= 1e-8 * forces.iter().map(Vector3::norm).fold(0.0, f64::max));
        assert_eq!(info.iterations, turned.iterations);
    }
}

#[test]
fn what_earlier_conditions_determine_is_told() {
    let mut constraints = Constraints::none(1);
    let slope = Vector3::new(3.0, 4.0, 0.0) / 5.0;
    constraints.give(0, 0, 1.0);
    assert_eq!(constraints.give_along(0, &slope, 1.0), None);
    assert_eq!(constraints.is_given(0), [true, true, false]);
    // x = 1 and 3 x + 4 y = 5: y = 1/2.
    let off = constraints.give_along(0, &Vector3::y(), 0.75).unwrap();
    assert!((off - 0.25).abs() < 1e-12, "{off}");
    assert!(constraints.give_along(0, &Vector3::y(), 0.5).unwrap() < 1e-12);
    assert_eq!(constraints.give_along(0, &Vector3::z(), 2.0), None);
    assert_eq!(constraints.is_given(0), [true; 3]);
}
