//! Settled contact without friction: no penetration, balanced forces, no pull, for every kind of tool.
#![allow(clippy::unwrap_used, reason = "a test that cannot build its scene should fail")]

mod common;

use common::*;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use plica_geometry::ConvexPolytope;
use plica_sim::*;

/// Contact of the wedge's top face at `x`, and the pose of a ball pressed `depth` into it.
fn pressed(x: f64, y: f64, radius: f64, depth: f64) -> Point3<f64> {
    Point3::new(x, y, top(x)) + top_normal() * (radius - depth)
}

/// Presses tool 0 at `pose` by `depth` along the top's normal within half a second and holds it.
fn press_and_hold(run: &mut Run, end: Isometry3<f64>, depth: f64, hold_s: f64) -> TickReport {
    let steps = (0.5 / run.model.timestep_s()) as usize;
    for k in 0..=steps {
        let lift = top_normal() * ((depth + 1e-3) * (1.0 - k as f64 / steps as f64));
        run.tick(&[(0, Isometry3::from_parts((end.translation.vector + lift).into(), end.rotation))]);
    }
    let mut last = TickReport::default();
    for _ in 0..(hold_s / run.model.timestep_s()) as usize {
        last = run.tick(&[(0, end)]);
    }
    last
}

fn assert_balanced(run: &Run, name: &str) {
    let on_tool = run.force();
    let reaction = reaction(run);
    let error = (on_tool - reaction).norm() / on_tool.norm();
    println!("{name}: force on the tool {:.4} N, reaction error {:.3} %", on_tool.norm(), 100.0 * error);
    assert!(error < 0.01, "{name}: contact {on_tool:?} against reaction {reaction:?}");
}

#[test]
fn a_ball_settles_on_the_triangles_and_forces_balance() {
    for (e, h) in [(1e3, 1e-3), (3e4, 1e-3), (1e6, 1e-3), (3e4, 5e-3), (1e6, 5e-3)] {
        for radius in [0.007, 0.015] {
            let mut run = Scene::wedge(e, 0.45).tool(ball(radius)).timestep(h).run();
            let center = pressed(0.05, 0.03, radius, 0.005);
            press_and_hold(&mut run, at(center), 0.005, 5.0);
            let penetration = run.ball_penetration(center, radius);
            println!("E {e:.0e} h {h} R {radius}: penetration {:.4} mm", 1e3 * penetration);
            assert!(penetration < 0.03e-3);
            assert!(run.state.contacts().all(|c| c.normal_force_n >= 0.0));
            assert_balanced(&run, "ball");
        }
    }
}

#[test]
fn a_1_mm_ball_between_vertices_is_not_lost() {
    let radius = 0.5e-3;
    let mut run = Scene::wedge(E, 0.45).tool(ball(radius)).run();
    let d = run.model.description();
    let is_on_top = |p: &Point3<f64>| (p.z - top(p.x)).abs() < 1e-9 && (p - Point3::new(0.05, 0.03, p.z)).norm() < 3e-3;
    let between = d.skin.triangles().iter().map(|t| t.map(|v| d.skin.positions()[v.index()]));
    let [a, b, c] = between.into_iter().find(|t| t.iter().all(is_on_top)).unwrap();
    let center = Point3::from((a.coords + b.coords + c.coords) / 3.0) + top_normal() * (radius - 3e-3);
    press_and_hold(&mut run, at(center), 3e-3, 2.0);
    let penetration = run.ball_penetration(center, radius);
    println!("1 mm ball: penetration {:.4} mm, force {:.3} N", 1e3 * penetration, run.force().norm());
    assert!(run.force().norm() > 0.5);
    assert!(penetration < 0.1e-3);
}

/// Half-spaces of a cuboid at a pose, `n . x <= o` in the world.
fn cuboid_planes(pose: &Isometry3<f64>, half: [f64; 3]) -> Vec<(Vector3<f64>, f64)> {
    let axis = |k: usize, sign: f64| {
        let n = pose.rotation * (Vector3::ith(k, sign));
        (n, n.dot(&pose.translation.vector) + half[k])
    };
    (0..3).flat_map(|k| [axis(k, 1.0), axis(k, -1.0)]).collect()
}

/// The rotation that puts the tool's -z onto the wedge's top, then turned by `tilt` about y.
fn facing_top(tilt: f64) -> UnitQuaternion<f64> {
    let down = UnitQuaternion::rotation_between(&Vector3::z(), &top_normal()).unwrap();
    down * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt)
}

#[test]
fn flat_faces_and_edges_settle_on_the_triangles() {
    let half = [0.008, 0.008, 0.008];
    let corner =
        |i: usize| Point3::from(std::array::from_fn::<f64, 3, _>(|k| if i >> k & 1 == 0 { -half[k] } else { half[k] }));
    let shapes = [
        ("cuboid", ToolShape::Cuboid { half_extents_m: half }),
        ("hull", ToolShape::ConvexHull { polytope: ConvexPolytope::hull((0..8).map(corner).collect()).unwrap() }),
    ];
    for (name, shape) in shapes {
        for (how, tilt, reach) in [("flat", 0.0, 0.008), ("edge", 45.0_f64.to_radians(), 0.008 * 2.0_f64.sqrt())] {
            let mut forces = Vec::new();
            for e in [1e3, 3e4, 1e6] {
                let mut run = Scene::wedge(e, 0.45).tool(tool("t", shape.clone())).run();
                let origin = Point3::new(0.05, 0.03, top(0.05)) + top_normal() * (reach - 0.004);
                let pose = Isometry3::from_parts(origin.into(), facing_top(tilt));
                let report = press_and_hold(&mut run, pose, 0.004, 5.0);
                let penetration = polytope_penetration(&run, &cuboid_planes(&pose, half));
                let force = run.force().norm();
                println!(
                    "{name} {how} E {e:.0e}: penetration {:.4} mm, F/E {:.5e}, {} contacts",
                    1e3 * penetration,
                    force / e,
                    report.n_contacts
                );
                assert!(penetration < 0.03e-3, "{name} {how}");
                assert!(run.state.contacts().all(|c| c.normal_force_n >= 0.0));
                assert_balanced(&run, name);
                forces.push(force / e);
            }
            assert!(forces.iter().all(|f| (f / forces[1] - 1.0).abs() < 0.005), "{name} {how}: {forces:?}");
        }
    }
}

#[test]
fn a_hull_of_thousands_of_points_presses_as_the_ball_that_it_approximates() {
    let (radius, depth) = (0.010, 0.005);
    let polytope = ConvexPolytope::hull(golden_spiral(2562).map(|p| Point3::from(p * radius)).collect()).unwrap();
    let center = pressed(0.05, 0.03, radius, depth);
    let press = |shape: ToolShape| {
        let mut run = Scene::wedge(E, 0.45).tool(tool("t", shape)).run();
        press_and_hold(&mut run, at(center), depth, 2.0);
        run
    };
    let (ball, hull) = (press(ToolShape::Ball { radius_m: radius }), press(ToolShape::ConvexHull { polytope }));
    let penetration = hull.ball_penetration(center, radius);
    let force_error = (hull.force() - ball.force()).norm() / ball.force().norm();
    let skin_error = hull.skin().iter().zip(ball.skin()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    println!(
        "hull: force {:.3} % off, skin {:.4} mm, into the ball {:.4} mm",
        100.0 * force_error,
        1e3 * skin_error,
        1e3 * penetration
    );
    assert!(force_error < 0.01 && skin_error < 0.1e-3 && penetration < 0.05e-3);
    assert_balanced(&hull, "hull");
}

#[test]
fn a_rounded_block_of_many_vertices_rests_flat_on_its_side() {
    // A cuboid with edges rounded by 1 mm, larger than the triangles below it: no one vertex can carry it.
    let half = [0.007, 0.007, 0.005];
    let rounded =
        golden_spiral(800).map(|p| Point3::from(Vector3::from_fn(|k, _| p[k] * 1e-3 + p[k].signum() * half[k])));
    let polytope = ConvexPolytope::hull(rounded.collect()).unwrap();
    assert!(polytope.vertices().len() > 64);
    let planes = polytope.planes().to_vec();
    let depth = 0.003;
    let mut run = Scene::wedge(E, 0.45).tool(tool("t", ToolShape::ConvexHull { polytope })).run();
    let origin = Point3::new(0.05, 0.03, top(0.05)) + top_normal() * (half[2] + 1e-3 - depth);
    let pose = Isometry3::from_parts(origin.into(), facing_top(0.0));
    press_and_hold(&mut run, pose, depth, 2.0);
    let placed = planes.iter().map(|plane| {
        let normal = pose.rotation * plane.normal;
        (normal, normal.dot(&pose.translation.vector) + plane.offset_m)
    });
    let penetration = polytope_penetration(&run, &placed.collect::<Vec<_>>());
    let before = run.force();
    let mut largest_change: f64 = 0.0;
    for _ in 0..200 {
        run.tick(&[(0, pose)]);
        largest_change = largest_change.max((run.force() - before).norm() / before.norm());
    }
    println!("rounded block: penetration {:.4} mm, force changes by {:.1e}", 1e3 * penetration, largest_change);
    assert!(penetration < 0.05e-3 && largest_change < 2e-3);
    assert_balanced(&run, "rounded block");
}

#[test]
fn a_rounded_block_smaller_than_a_triangle_rests_quietly() {
    let half = [0.25e-3, 0.25e-3, 0.25e-3];
    let corner = |p: &Vector3<f64>| Vector3::from_fn(|k, _| p[k] * 0.05e-3 + p[k].signum() * half[k]);
    let polytope = ConvexPolytope::hull(golden_spiral(400).map(|p| Point3::from(corner(&p))).collect()).unwrap();
    let mut run = Scene::wedge(E, 0.45).tool(tool("t", ToolShape::ConvexHull { polytope })).run();
    let d = run.model.description();
    let is_on_top = |p: &Point3<f64>| (p.z - top(p.x)).abs() < 1e-9 && (p - Point3::new(0.05, 0.03, p.z)).norm() < 3e-3;
    let between = d.skin.triangles().iter().map(|t| t.map(|v| d.skin.positions()[v.index()]));
    let [a, b, c] = between.into_iter().find(|t| t.iter().all(is_on_top)).unwrap();
    let depth = 2e-3;
    let origin = Point3::from((a.coords + b.coords + c.coords) / 3.0) + top_normal() * (0.3e-3 - depth);
    let pose = Isometry3::from_parts(origin.into(), facing_top(0.0));
    press_and_hold(&mut run, pose, depth, 2.0);
    let before = run.force();
    let mut largest_change: f64 = 0.0;
    for _ in 0..200 {
        run.tick(&[(0, pose)]);
        largest_change = largest_change.max((run.force() - before).norm() / before.norm());
    }
    println!("small rounded block: force {:.3} N, changes by {largest_change:.1e}", before.norm());
    assert!(before.norm() > 0.1 && largest_change < 2e-3);
}

#[test]
fn a_block_rests_on_a_plane() {
    for e in [3e3, 3e4] {
        let mut run = Scene::block(e, 0.45)
            .with(|d| {
                d.fixed.fill(false);
                d.gravity_m_per_s2 = Vector3::new(0.0, 0.0, -9.81);
                d.planes.push(Plane { point_m: Point3::origin(), normal: Vector3::z() });
                d.mass_damping_per_s = 20.0;
            })
            .run();
        for _ in 0..5000 {
            run.tick(&[]);
        }
        let weight = 1000.0 * 0.08 * 0.04 * 0.04 * 9.81;
        let support: f64 = run.state.contacts().map(|c| c.normal_force_n).sum();
        let lowest = run.skin().iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
        println!("plane E {e:.0e}: weight {weight:.4} N, support {support:.4} N, lowest point {:.4} mm", 1e3 * lowest);
        assert!((support / weight - 1.0).abs() < 0.01);
        assert!(lowest > -0.03e-3 && lowest < 0.2e-3);
    }
}

#[test]
fn a_withdrawn_tool_never_pulls_and_the_shape_returns() {
    for (e, seconds) in [(3e4, 2.0), (1e6, 2.0), (1e3, 12.0)] {
        let mut run = Scene::wedge(e, 0.45).tool(ball(0.007)).run();
        let center = pressed(0.05, 0.03, 0.007, 0.005);
        press_and_hold(&mut run, at(center), 0.005, 1.0);
        let away = center + top_normal() * 0.03;
        let mut worst_pull: f64 = 0.0;
        run.glide(center, away, 0.05, |run, _| worst_pull = worst_pull.min(run.force().dot(&top_normal())));
        run.hold(away, seconds, |run, _| worst_pull = worst_pull.min(run.force().dot(&top_normal())));
        let left = run.offsets().iter().map(|o| o.norm()).fold(0.0, f64::max);
        println!("E {e:.0e}: worst pull {worst_pull:.2e} N, left over {:.5} mm after {seconds} s", 1e3 * left);
        assert!(worst_pull >= 0.0);
        assert!(left < 0.05e-3);
    }
}
