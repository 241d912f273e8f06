//! Presses against a soft block: contact only pushes, balances the supports, obeys Coulomb's law, and ends on release.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod contact;

use std::ops::ControlFlow;

use contact::{BLOCK_M, Body, Tool, at, soft_block};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use plica_accurate::contact::{ContactError, ContactInfo, ContactState, Obstacle};
use plica_geometry::ConvexPolytope;

const TOP_M: f64 = BLOCK_M[2];
/// The middle of the top, off any symmetry of the mesh.
const MIDDLE_M: [f64; 2] = [0.0307, 0.0288];

/// Above the middle, with the tool's lowest point at `height_m`, `along_m` further along x.
fn over(lowest_m: f64, height_m: f64, along_m: f64) -> Isometry3<f64> {
    at(MIDDLE_M[0] + along_m, MIDDLE_M[1], height_m + lowest_m)
}

/// Tools and their extent below the origin \[m\].
fn tools(friction: f64) -> Vec<(&'static str, Tool, f64)> {
    let cuboid = [8e-3, 6e-3, 5e-3];
    let tip = [[0.0, 0.0, -9e-3], [9e-3, 0.0, 2e-3], [-6e-3, 8e-3, 2e-3], [-6e-3, -8e-3, 2e-3]].map(Into::into);
    let twins = |side: f64| Obstacle::Polytope(ConvexPolytope::hull(cuboid_corners(side)).unwrap());
    vec![
        ("ball", Tool::ball(7e-3, friction), 7e-3),
        ("capsule", Tool::capsule(friction), 7e-3),
        ("cuboid", Tool::cuboid(cuboid, friction), 5e-3),
        ("pyramid", Tool::new(Obstacle::Polytope(ConvexPolytope::hull(tip.to_vec()).unwrap()), friction), 9e-3),
        ("two feet", Tool::new(Obstacle::Union(vec![twins(-1.0), twins(1.0)]), friction), 5e-3),
    ]
}

fn cuboid_corners(side: f64) -> Vec<nalgebra::Point3<f64>> {
    let half = |bit: usize, h: f64| if bit == 0 { -h } else { h };
    (0..8).map(|i| [side * 0.01 + half(i & 1, 4e-3), half(i & 2, 5e-3), half(i & 4, 5e-3)].into()).collect()
}

fn pressed(body: &mut Body, tool: &Tool, lowest_m: f64, depth_m: f64, drag_m: f64) -> (ContactInfo, ContactState) {
    let path =
        [over(lowest_m, TOP_M, 0.0), over(lowest_m, TOP_M - depth_m, 0.0), over(lowest_m, TOP_M - depth_m, drag_m)];
    body.press(tool, &path)
}

/// Every shape, with friction: forces balance, points stay outside to within a small part of a face, tractions stay within
/// the bound, and the body returns to its shape after release.
#[test]
fn shapes_press_and_leave() {
    let mut body = soft_block([12, 12, 6]);
    for (name, tool, lowest_m) in tools(0.8) {
        let tool = tool.exactly();
        let (info, mut state) = pressed(&mut body, &tool, lowest_m, 4e-3, 1e-3);
        let face_m = BLOCK_M[0] / 12.0;
        println!(
            "{name:9} force {:.4} N, penetration {:.2} % and mean gap {:.2} % of a face, J {:.3}, {} Newton steps",
            info.force_n.z,
            100.0 * info.max_penetration_m / face_m,
            100.0 * info.mean_gap_m / face_m,
            info.smallest_jacobian.unwrap(),
            info.newton_iterations,
        );
        assert!(info.force_n.z > 0.2, "{name}");
        assert!(info.max_penetration_m < 0.05 * face_m, "{name}: {:e} m", info.max_penetration_m);
        assert!(info.mean_gap_m < 0.03 * face_m, "{name}: {:e} m", info.mean_gap_m);
        let (force, torque) = body.support(&state.pose().translation.vector);
        assert!((info.force_n - force).norm() < 1e-6 * force.norm(), "{name}: {} {force}", info.force_n);
        assert!((info.torque_nm - torque).norm() < 1e-6 * 0.02 * force.norm(), "{name}: {} {torque}", info.torque_nm);
        assert!(state.pressures_pa().iter().all(|p| *p >= 0.0), "{name}");
        assert!(info.friction_excess < 1e-3, "{name}: {:e}", info.friction_excess);
        let left = body.go_on(&tool, &[over(lowest_m, TOP_M + 5e-3, 1e-3)], &mut state).unwrap();
        assert_eq!((left.force_n.norm(), left.n_touching), (0.0, 0), "{name}");
        let moved = body.x.iter().zip(body.mesh.nodes()).map(|(x, rest)| (x - rest.coords).norm()).fold(0.0, f64::max);
        assert!(moved < 1e-8, "{name}: still {moved:e} m away from rest");
    }
}

/// `|t| <= mu p` at every point and in sum, whatever the friction; without friction there is no traction.
#[test]
fn tractions_keep_coulombs_law() {
    let mut body = soft_block([12, 12, 6]);
    for friction in [0.0, 0.2, 0.8] {
        let tool = Tool::ball(7e-3, friction).exactly();
        let (info, state) = pressed(&mut body, &tool, 7e-3, 4e-3, 3e-3);
        let largest = state.pressures_pa().iter().copied().fold(0.0, f64::max);
        let (mut normal, mut tangential) = (0.0, 0.0);
        for (point, (p, t)) in body.surface.points().iter().zip(state.pressures_pa().iter().zip(state.tractions_pa())) {
            assert!(t.norm() <= friction * p + 1e-3 * largest, "{t} under {p} Pa, friction {friction}");
            normal += point.area_m2 * p;
            tangential += point.area_m2 * t.norm();
        }
        println!(
            "friction {friction}: force {:.4} N along, {:.4} N across; tractions {:.3} of the bound",
            info.force_n.x,
            info.force_n.z,
            tangential / (friction * normal).max(f64::MIN_POSITIVE)
        );
        assert!(tangential <= friction * normal * (1.0 + 1e-3));
        assert_eq!(tangential > 0.0, friction > 0.0);
    }
}

/// A plate on the whole top slides, once dragged far, under exactly `mu N`; before, under less.
#[test]
fn a_plate_slides_under_mu_n() {
    let mut body = soft_block([8, 8, 4]);
    let tool = Tool::new(Obstacle::HalfSpace, 0.3).exactly();
    let plate = |depth_m: f64, drag_m: f64| {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        Isometry3::from_parts(at(drag_m, 0.0, TOP_M - depth_m).translation, turned)
    };
    let mut state = body.rest(&plate(0.0, 0.0));
    body.go_on(&tool, &[plate(1e-3, 0.0)], &mut state).unwrap();
    let mut ratios = Vec::new();
    for drag_m in [0.2e-3, 1e-3, 4e-3, 8e-3, 12e-3] {
        let info = body.go_on(&tool, &[plate(1e-3, drag_m)], &mut state).unwrap();
        let ratio = -info.force_n.x / info.force_n.z;
        println!("plate dragged {:4.1} mm: tangential over normal force {ratio:.5}", drag_m * 1e3);
        ratios.push(ratio);
    }
    assert!(ratios[0] < 0.2, "it sticks at first");
    assert!(ratios.is_sorted_by(|a, b| a <= &(b + 1e-4)));
    assert!((ratios[4] - 0.3).abs() < 1e-3 * 0.3, "{}", ratios[4]);
}

/// Twenty repeated solves with a tool at rest keep force and shape: neither sticking nor slid points creep. A small
/// drag there and back brings the force back.
#[test]
fn what_sticks_does_not_creep() {
    let mut body = soft_block([12, 12, 6]);
    for friction in [0.8, 5.0] {
        let tool = Tool::ball(7e-3, friction).exactly();
        let (before, mut state) = pressed(&mut body, &tool, 7e-3, 4e-3, 1e-3);
        let (pose, x) = (*state.pose(), body.x.clone());
        let held = body.go_on(&tool, &[pose; 20], &mut state).unwrap();
        let drift_m = body.x.iter().zip(&x).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        let change = (held.force_n - before.force_n).norm() / before.force_n.norm();
        println!("friction {friction}: held 20 times, force changed by {change:.1e}, positions by {drift_m:.1e} m");
        assert!(change < 1e-4, "{change:e}");
        assert!(drift_m < 1e-6, "{drift_m:e} m");
        let aside = at(2e-4, 0.0, 0.0) * pose;
        let back = body.go_on(&tool, &[aside, pose, aside, pose], &mut state).unwrap();
        let change = (back.force_n - held.force_n).norm() / held.force_n.norm();
        println!("friction {friction}: twice 0.2 mm there and back, force changed by {change:.1e}");
        let allowed = if friction > 1.0 { 1e-2 } else { 5e-2 };
        assert!(change < allowed, "{change:e}");
    }
}

/// A ball on the middle of a square block: no lateral force, and symmetric points move alike.
#[test]
fn a_symmetric_press_is_symmetric() {
    let mut body = soft_block([10, 10, 5]);
    let (middle, top) = (0.5 * BLOCK_M[0], TOP_M + 7e-3);
    let tool = Tool::ball(7e-3, 0.8).exactly();
    let (info, _) = body.press(&tool, &[at(middle, middle, top), at(middle, middle, top - 5e-3)]);
    let sideways = info.force_n.xy().norm() / info.force_n.z;
    let n = 11;
    let mut asymmetry_m = 0.0_f64;
    for (node, x) in body.x.iter().enumerate() {
        let (i, j, k) = (node % n, node / n % n, node / n / n);
        let other = body.x[(n - 1 - i) + n * (j + n * k)];
        let mirrored = Vector3::new(2.0 * middle - other.x, other.y, other.z);
        let swapped = body.x[j + n * (i + n * k)].yxz();
        asymmetry_m = asymmetry_m.max((x - mirrored).norm()).max((x - swapped).norm());
    }
    println!("symmetric press: force sideways {sideways:.1e} of the force, asymmetry {asymmetry_m:.1e} m");
    assert!(sideways < 1e-6, "{sideways:e}");
    assert!(asymmetry_m < 1e-8, "{asymmetry_m:e} m");
}

/// Without friction the result is independent of the path; with friction, shorter increments converge.
#[test]
fn results_depend_little_on_increments() {
    let mut body = soft_block([10, 10, 5]);
    for friction in [0.0, 0.8] {
        let forces: Vec<_> = [4e-3, 2e-3, 1e-3, 0.5e-3]
            .map(|max_increment_m| {
                let mut tool = Tool::capsule(friction).exactly();
                tool.params.max_increment_m = max_increment_m;
                let (info, _) = pressed(&mut body, &tool, 7e-3, 6e-3, 3e-3);
                println!(
                    "friction {friction}, increments of {:.2} mm: force {:.5} {:.5} N, {} increments, {} Newton steps",
                    max_increment_m * 1e3,
                    info.force_n.x,
                    info.force_n.z,
                    info.increments,
                    info.newton_iterations
                );
                info.force_n
            })
            .into();
        let misses = forces.iter().map(|f| (f - forces[3]).norm() / forces[3].norm()).collect::<Vec<_>>();
        let allowed = if friction == 0.0 { [1e-4; 3] } else { [0.04, 0.02, 0.01] };
        assert!(misses.iter().zip(allowed).all(|(miss, allowed)| *miss < allowed), "{misses:?}");
    }
}

/// The same press twice has the same bits.
#[test]
fn presses_repeat() {
    let mut body = soft_block([8, 8, 4]);
    let first = (pressed(&mut body, &Tool::capsule(0.8), 7e-3, 5e-3, 2e-3), body.x.clone());
    let second = (pressed(&mut body, &Tool::capsule(0.8), 7e-3, 5e-3, 2e-3), body.x.clone());
    assert_eq!(first, second);
}

/// An increment that takes too many Newton steps is halved, and the press reaches the same result.
#[test]
fn failed_increments_are_halved() {
    let mut body = soft_block([8, 8, 4]);
    let mut tool = Tool::ball(7e-3, 0.0).exactly();
    let (with_ease, _) = pressed(&mut body, &tool, 7e-3, 6e-3, 0.0);
    tool.params.max_increment_m = 6e-3;
    tool.params.max_newton_iterations = 3;
    let (with_effort, _) = pressed(&mut body, &tool, 7e-3, 6e-3, 0.0);
    assert!(with_effort.failed_increments > 0, "{with_effort:?}");
    assert!((with_effort.force_n - with_ease.force_n).norm() < 1e-4 * with_ease.force_n.norm());
    tool.params.max_newton_iterations = 0;
    let mut state = body.rest(&over(7e-3, TOP_M, 0.0));
    let error = body.go_on(&tool, &[over(7e-3, TOP_M - 1e-3, 0.0)], &mut state).unwrap_err();
    assert!(matches!(error, ContactError::Solve { halvings: 5, .. }), "{error}");
    tool.params.max_newton_iterations = 30;
    tool.params.max_updates = 1;
    let error = body.go_on(&tool, &[over(7e-3, TOP_M - 1e-3, 0.0)], &mut state).unwrap_err();
    assert!(matches!(error, ContactError::Unsettled { halvings: 5, .. }), "{error}");
    println!("{error}");
}

/// A cancelled press leaves the last solved increment, from which it can continue. With friction the result differs
/// slightly: the solve starts elsewhere, and solutions of Coulomb's law are not unique.
#[test]
fn presses_can_be_cancelled_and_taken_up() {
    let mut body = soft_block([8, 8, 4]);
    for (friction, allowed) in [(0.0, 1e-6), (0.8, 0.02)] {
        let tool = Tool::capsule(friction).exactly();
        let target = [over(7e-3, TOP_M - 6e-3, 0.0)];
        let (whole, _) = body.press(&tool, &[over(7e-3, TOP_M, 0.0), target[0]]);
        let mut state = body.rest(&over(7e-3, TOP_M, 0.0));
        let mut shares = Vec::new();
        let cancelled = body.go_on_watched(&tool, &target, &mut state, &mut |progress| {
            shares.push(progress.share);
            if progress.increments == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(cancelled, Err(ContactError::Cancelled { share }) if (share - 2.0 / 3.0).abs() < 1e-12));
        assert!(shares.is_sorted() && shares[0] > 0.0 && *shares.last().unwrap() == 1.0);
        assert!((state.pose().translation.z - (TOP_M + 3e-3)).abs() < 1e-12);
        let taken_up = body.go_on(&tool, &target, &mut state).unwrap();
        let change = (taken_up.force_n - whole.force_n).norm() / whole.force_n.norm();
        println!("friction {friction}: taken up after a break, the force differs by {change:.1e}");
        assert!(change < allowed, "{change:e}");
    }
}

/// Motion through free air takes no iterations.
#[test]
fn free_air_is_free() {
    let mut body = soft_block([8, 8, 4]);
    let tool = Tool::capsule(0.8);
    let (info, _) = body.press(&tool, &[over(7e-3, 0.05, 0.0), over(7e-3, TOP_M + 1e-6, 0.0), over(7e-3, 0.06, 0.02)]);
    assert_eq!((info.newton_iterations, info.force_n.norm()), (0, 0.0));
    assert!(info.increments > 10);
}
