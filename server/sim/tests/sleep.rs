//! An object at rest with no tool near is not solved, without effect on its shape.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{E, Run, Scene, at, ball, top, top_normal};
use nalgebra::{Point3, Vector3};
use plica_geometry::shapes::{block, block_skin};
use plica_sim::*;

const RADIUS_M: f64 = 0.01;

fn above(height: f64) -> Point3<f64> {
    Point3::new(0.05, 0.03, top(0.05)) + top_normal() * (RADIUS_M + height)
}

fn scene(enabled: bool) -> Scene {
    Scene::wedge(E, 0.45).tool(ball(RADIUS_M)).with(|d| d.sleep = SleepOptions { enabled, ..SleepOptions::default() })
}

/// Farthest skin vertex from rest [m].
fn farthest(run: &Run) -> f64 {
    run.offsets().iter().map(|o| o.norm()).fold(0.0, f64::max)
}

#[test]
fn object_at_rest_falls_asleep_and_is_not_solved() {
    let mut run = scene(true).run();
    let after = SleepOptions::default().after_s;
    let mut first_asleep = None;
    run.hold(above(0.1), 1.0, |run, report| {
        assert_eq!(report.sleeping, run.state.sleeping());
        if report.sleeping {
            first_asleep.get_or_insert(run.clock_s);
            assert_eq!((report.iterations, report.passes, report.n_contacts), (0, 0, 0));
        }
    });
    assert!((first_asleep.unwrap() - after).abs() < 2e-3, "asleep after {first_asleep:?} s");
    assert_eq!(farthest(&run), 0.0);
    let mut awake = scene(false).run();
    awake.hold(above(0.1), 2.0, |_, report| assert!(!report.sleeping));
}

#[test]
fn approaching_tool_wakes_it_before_it_touches() {
    for speed in [0.05, 0.5, 5.0] {
        let mut run = scene(true).run();
        run.hold(above(0.1), 1.0, |_, _| {});
        assert!(run.state.sleeping());
        let mut woke_at = None;
        run.glide(above(0.1), above(-2e-3), 0.102 / speed, |run, report| {
            let height = (run.state.tools()[0].proxy.translation.vector - above(0.0).coords).dot(&top_normal());
            if !report.sleeping {
                woke_at.get_or_insert(height);
            }
            assert!(report.sleeping || woke_at.is_some());
        });
        println!("{speed} m/s: awake {:.1} mm above the object", woke_at.unwrap() * 1e3);
        assert!(woke_at.unwrap() > 0.0, "touched before it woke: {woke_at:?}");
        assert!(!run.state.sleeping() && run.state.tools()[0].in_contact);
    }
}

/// The same press and release with sleeping allowed and not.
#[test]
fn shape_and_force_are_those_of_an_object_that_never_sleeps() {
    let (mut sleeper, mut other) = (scene(true).run(), scene(false).run());
    let (mut slept, mut worst, mut worst_force) = (0, 0.0_f64, 0.0_f64);
    let legs = [
        (0.1, 0.1, 1.0),
        (0.1, -4e-3, 0.3),
        (-4e-3, -4e-3, 0.3),
        (-4e-3, 0.1, 0.3),
        (0.1, 0.1, 3.0),
        (0.1, -4e-3, 0.3),
    ];
    for (from, to, seconds) in legs {
        sleeper.glide(above(from), above(to), seconds, |_, report| slept += u32::from(report.sleeping));
        other.glide(above(from), above(to), seconds, |_, _| {});
        let apart = sleeper.offsets().iter().zip(other.offsets()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        (worst, worst_force) = (worst.max(apart), worst_force.max((sleeper.force() - other.force()).norm()));
    }
    println!("slept {slept} ticks; {worst:.1e} m and {worst_force:.1e} N of {:.1} N apart", other.force().norm());
    assert!(slept > 2000 && worst < 2e-5 && worst_force < 5e-3 * other.force().norm());
}

#[test]
fn released_object_sleeps_close_to_rest() {
    let mut run = scene(true).run();
    run.glide(above(1e-3), above(-5e-3), 0.1, |_, _| {});
    run.hold(above(-5e-3), 2.0, |_, report| assert!(!report.sleeping, "a touched object sleeps"));
    run.glide(above(-5e-3), above(0.1), 0.1, |_, _| {});
    let mut asleep_after = None;
    run.hold(above(0.1), 5.0, |run, report| {
        if report.sleeping {
            asleep_after.get_or_insert((run.clock_s - 2.2, farthest(run)));
            assert!(
                run.state.node_velocities(&run.model).iter().all(|v| v.norm() == 0.0),
                "a sleeping object has speed"
            );
        }
    });
    let (seconds, offset) = asleep_after.unwrap();
    println!("asleep {seconds:.2} s after release, {offset:.1e} m from rest");
    assert!(offset < 5e-5 && seconds < 2.0);
    assert_eq!(farthest(&run), offset, "a sleeping object moved");
}

#[test]
fn tool_that_moves_while_the_object_sleeps_is_where_its_device_is() {
    for coupling in [Coupling::Rigid, Coupling::Spring(SpringCoupling::default())] {
        let mut run = scene(true).with(|d| d.tools[0].coupling = coupling).run();
        run.hold(above(0.1), 1.0, |_, _| {});
        let mut worst = 0.0_f64;
        run.glide(above(0.1), above(0.05), 0.5, |run, report| {
            let share = (run.clock_s - 1.0) / 0.5;
            let device = above(0.1) + (above(0.05) - above(0.1)) * share;
            worst = worst.max((run.state.tools()[0].proxy.translation.vector - device.coords).norm());
            assert!(report.sleeping);
        });
        // A spring follows with a small lag.
        assert!(worst < 1e-3, "{coupling:?}: {worst} m behind");
        run.hold(above(0.05), 0.2, |_, _| {});
        assert!((run.state.tools()[0].proxy.translation.vector - above(0.05).coords).norm() < 1e-5);
        assert!(run.state.tools()[0].force_n.norm() < 1e-2);
    }
}

#[test]
fn moved_nodes_wake_it() {
    let mut run = scene(true).run();
    run.hold(above(0.1), 1.0, |_, _| {});
    let u = vec![Vector3::new(0.0, 0.0, 1e-3); run.model.n_nodes()];
    run.state.set_node_displacements(&run.model, &u);
    let report = run.tick(&[(0, at(above(0.1)))]);
    assert!(!report.sleeping && report.iterations > 0);
}

/// A loose block on a plane: its contacts carry it before, during and after sleep.
#[test]
fn block_that_rests_on_a_plane_sleeps_and_wakes_without_a_start() {
    let size = [0.04, 0.04, 0.02];
    let mut run = Scene::on(block(size, [4, 4, 2]), block_skin(size, 4e-3), E, 0.45)
        .with(|d| {
            d.fixed.fill(false);
            d.gravity_m_per_s2 = Vector3::new(0.0, 0.0, -9.81);
            d.planes.push(Plane { point_m: Point3::origin(), normal: Vector3::z() });
            d.sleep = SleepOptions::default();
        })
        .tool(ball(RADIUS_M))
        .run();
    let far = Point3::new(0.02, 0.02, 0.2);
    let mut asleep = None;
    run.hold(far, 6.0, |run, report| {
        if report.sleeping {
            asleep.get_or_insert(run.clock_s);
        }
    });
    println!(
        "asleep after {asleep:?} s, lowest point {:.1e} m",
        run.skin().iter().map(|p| p.z).fold(f64::INFINITY, f64::min)
    );
    assert!(run.state.sleeping(), "still awake after 6 s");
    let before = run.skin();
    // Near enough to wake the object, without contact.
    let near = Point3::new(0.02, 0.02, 0.02 + RADIUS_M + 2e-3);
    run.glide(far, near, 0.5, |_, _| {});
    run.hold(near, 0.3, |_, _| {});
    assert!(!run.state.sleeping());
    let moved = run.skin().iter().zip(&before).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    println!("moved {moved:.1e} m on waking");
    assert!(moved < 2e-5, "{moved} m");
}
