//! The output gate: a state that is not finite, or has left the scene, is replaced by the last good one.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{E, Run, Scene, at, ball, relative, top, top_normal};
use nalgebra::{Point3, Vector3};
use plica_geometry::shapes::{block, block_skin};
use plica_sim::*;

const RADIUS_M: f64 = 0.01;

fn pressed(depth: f64) -> Point3<f64> {
    Point3::new(0.05, 0.03, top(0.05)) + top_normal() * (RADIUS_M - depth)
}

/// A ball held 3 mm deep.
fn pressing(coupling: Coupling) -> Run {
    let mut tool = ball(RADIUS_M);
    (tool.coupling, tool.friction) = (coupling, 0.5);
    let mut run = Scene::wedge(E, 0.45).tool(tool).run();
    run.glide(pressed(-1e-3), pressed(3e-3), 0.1, |_, _| {});
    run.hold(pressed(3e-3), 0.3, |_, _| {});
    run
}

fn is_finite(run: &Run) -> bool {
    let tool = run.state.tools()[0];
    let vectors = [
        tool.force_n,
        tool.torque_n_m,
        tool.contact_force_n,
        tool.contact_point_m.coords,
        tool.proxy.translation.vector,
    ];
    let contacts = run.state.contacts().all(|c| c.normal_force_n.is_finite() && c.gap_m.is_finite());
    let skin = run.skin();
    contacts && skin.iter().map(|p| p.coords).chain(vectors).all(|v| v.iter().all(|c| c.is_finite()))
}

/// The present displacements with one node, or all, replaced.
fn spoilt(run: &Run, value: f64, everywhere: bool) -> Vec<Vector3<f64>> {
    let mut u = run.state.node_displacements(&run.model);
    let moving = run.model.description().fixed.iter().position(|f| !f).unwrap();
    match everywhere {
        true => u.fill(Vector3::new(value, -value, value)),
        false => u[moving].y = value,
    }
    u
}

#[test]
fn spoilt_state_is_rolled_back_counted_and_goes_on() {
    for coupling in [Coupling::Rigid, Coupling::Spring(SpringCoupling::default())] {
        let mut run = pressing(coupling);
        let (settled, settled_force) = (run.state.node_displacements(&run.model), run.force());
        let mut expected_rollbacks = 0;
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 1e30, -1e12, 1e4, 10.0] {
            for everywhere in [false, true] {
                let before = run.state.node_displacements(&run.model);
                let bad = spoilt(&run, value, everywhere);
                run.state.set_node_displacements(&run.model, &bad);
                let report = run.tick(&[(0, at(pressed(3e-3)))]);
                expected_rollbacks += 1;
                assert!(report.rolled_back, "{value} {everywhere}");
                assert_eq!(run.state.rollbacks(), expected_rollbacks);
                assert!(is_finite(&run), "{value} {everywhere}: {:?}", run.state.tools()[0]);
                let after = run.state.node_displacements(&run.model);
                assert!(after == before, "{value} {everywhere}: not the last good state");
                assert!(run.state.node_velocities(&run.model).iter().all(|v| v.norm() == 0.0));
                // Far enough apart in time that each roll-back counts as the first.
                run.hold(pressed(3e-3), 0.1, |run, report| assert!(!report.rolled_back && is_finite(run)));
            }
        }
        run.hold(pressed(3e-3), 0.5, |_, _| {});
        let shape = relative(&run.state.node_displacements(&run.model), &settled);
        let force = (run.force() - settled_force).norm() / settled_force.norm();
        println!("back to the shape within {shape:.1e}, to the force within {force:.1e}");
        // Friction: the ball sticks where it was put back.
        assert!(shape < 0.05 && force < 0.05, "{coupling:?}: off by {shape} in shape, {force} in force");
    }
}

/// The last good state at the first roll-back; that state or the rest shape at a second one.
#[test]
fn gate_holds_tick_after_tick() {
    let mut run = pressing(Coupling::Rigid);
    let good = run.state.node_displacements(&run.model);
    for k in 1..=200 {
        let bad = spoilt(&run, f64::NAN, k % 2 == 0);
        run.state.set_node_displacements(&run.model, &bad);
        assert!(run.tick(&[(0, at(pressed(3e-3)))]).rolled_back && is_finite(&run));
        assert_eq!(run.state.rollbacks(), k);
        let after = run.state.node_displacements(&run.model);
        assert!(after == good || k > 1 && after.iter().all(|u| u.norm() == 0.0), "roll-back {k}");
    }
}

#[test]
fn gate_works_with_sub_steps_and_block_jacobi() {
    for (substeps, preconditioner) in [(4, Preconditioner::Auto), (1, Preconditioner::BlockJacobi)] {
        let scene = Scene::wedge(E, 0.45).tool(ball(RADIUS_M)).with(|d| {
            (d.substeps, d.solver.preconditioner) = (substeps, preconditioner);
        });
        let mut run = scene.run();
        run.hold(pressed(2e-3), 0.05, |run, _| assert!(is_finite(run)));
        let bad = spoilt(&run, f64::NAN, false);
        run.state.set_node_displacements(&run.model, &bad);
        assert!(run.tick(&[]).rolled_back && is_finite(&run));
        run.hold(pressed(2e-3), 0.05, |run, report| assert!(is_finite(run) && !report.rolled_back));
    }
}

#[test]
fn refused_pose_changes_nothing() {
    let (mut run, mut other) = (pressing(Coupling::Rigid), pressing(Coupling::Rigid));
    for k in 0..50 {
        let bad = at(Point3::new(0.05, if k % 2 == 0 { f64::NAN } else { f64::INFINITY }, 0.03));
        let report = run.tick(&[(0, bad)]);
        other.tick(&[]);
        assert_eq!((report.poses_refused, report.rolled_back), (1, false));
        assert!(run.state.node_displacements(&run.model) == other.state.node_displacements(&other.model));
        assert_eq!(run.state.tools(), other.state.tools());
    }
}

/// A restored state does not depend on events after the snapshot or on the workspace.
#[test]
fn snapshot_brings_back_every_bit() {
    let mut run = pressing(Coupling::Spring(SpringCoupling::default()));
    let snapshot = run.state.clone();
    let (clock_s, sequence) = (run.clock_s, run.sequence);
    let replay = |run: &mut Run| {
        (run.clock_s, run.sequence) = (clock_s, sequence);
        run.glide(pressed(3e-3), pressed(4e-3), 0.05, |_, _| {});
        (run.skin(), run.state.tools().to_vec(), run.state.tick())
    };
    let first = replay(&mut run);
    run.state.copy_from(&snapshot);
    assert!(replay(&mut run) == first, "a copied state goes on differently");
    let bad = spoilt(&run, f64::NAN, true);
    run.state.set_node_displacements(&run.model, &bad);
    run.tick(&[]);
    run.state.copy_from(&snapshot);
    assert_eq!(run.state.rollbacks(), 0);
    assert!(replay(&mut run) == first, "a roll-back in between shows");
    run.state = snapshot.clone();
    run.workspace = Workspace::new(&run.model);
    assert!(replay(&mut run) == first, "a new workspace shows");
}

/// A nearly flat tool comes near more skin points than are kept for selection; those beyond are reported as well.
#[test]
fn candidates_beyond_the_room_are_reported_as_dropped() {
    const KEPT_CANDIDATES: u32 = 4096;
    let (size, radius) = ([0.08, 0.04, 0.04], 10.0);
    let mut run = Scene::on(block(size, [8, 4, 4]), block_skin(size, 0.6e-3), E, 0.45).tool(ball(radius)).run();
    let report = run.tick(&[(0, at(Point3::new(0.04, 0.02, 0.04 + radius)))]);
    assert!(report.dropped_contacts > KEPT_CANDIDATES, "{}", report.dropped_contacts);
}

/// A block of 80 x 40 x 40 mm that nothing holds, in free fall above a plane of this slope along x.
fn free_block(slope: f64, friction: f64, bounds_m: Option<[Point3<f64>; 2]>) -> Run {
    let size = [0.08, 0.04, 0.04];
    let scene = Scene::on(block(size, [4, 2, 2]), block_skin(size, 4e-3), E, 0.45).with(|d| {
        d.fixed.fill(false);
        d.gravity_m_per_s2 = Vector3::new(0.0, 0.0, -9.81);
        d.planes =
            vec![Plane { point_m: Point3::new(0.0, 0.0, -5e-3), normal: Vector3::new(slope.sin(), 0.0, slope.cos()) }];
        (d.contact.plane_friction, d.bounds_m) = (friction, bounds_m);
    });
    scene.run()
}

fn centre(run: &Run) -> Vector3<f64> {
    let u = run.state.node_displacements(&run.model);
    u.iter().sum::<Vector3<f64>>() / u.len() as f64
}

#[test]
fn a_free_block_falls_and_slides_for_many_lengths_without_being_put_back() {
    const LENGTH_M: f64 = 0.08;
    let slope = 20.0_f64.to_radians();
    let (mut run, friction) = (free_block(slope, 0.1, None), 0.1);
    for _ in 0..1000 {
        assert!(!run.tick(&[]).rolled_back);
    }
    let (slid, speed) = (centre(&run), run.state.node_velocities(&run.model)[0].norm());
    // Constant acceleration `a` against a drag of 1/s times the speed, for 1 s: `a (t - 1 + exp(-t))`.
    let acceleration = 9.81 * (slope.sin() - friction * slope.cos());
    let on_paper = acceleration * (-1.0_f64).exp();
    println!("slid {:.2} m in 1 s ({on_paper:.2} m on paper), {speed:.2} m/s", slid.norm());
    assert!(slid.norm() > 10.0 * LENGTH_M && (slid.norm() / on_paper - 1.0).abs() < 0.1, "{slid:?}");
    // Along the plane, neither through it nor off it.
    assert!((slid.x * slope.sin() + slid.z * slope.cos()).abs() < 0.02, "{slid:?}");
    assert_eq!(run.state.rollbacks(), 0);
}

#[test]
fn a_block_that_leaves_its_bounds_is_put_back_where_it_began_and_counted() {
    let bounds = [Point3::new(-0.1, -0.1, -0.3), Point3::new(0.3, 0.2, 0.2)];
    let mut run = free_block(20.0_f64.to_radians(), 0.0, Some(bounds));
    assert_eq!(run.model.room_m(), bounds);
    let mut farthest: f64 = 0.0;
    for round in 1..=3 {
        let ticks = (1..3000).find(|_| {
            farthest = farthest.max(centre(&run).x);
            run.tick(&[]).rolled_back
        });
        println!("round {round}: put back after {ticks:?} ticks");
        assert!(ticks.is_some() && run.state.rollbacks() == round);
        assert!(centre(&run).norm() == 0.0 && run.state.node_velocities(&run.model).iter().all(|v| v.norm() == 0.0));
    }
    assert!(farthest > 0.15 && farthest < 0.3, "{farthest}");
}
