//! Tools on a spring: forces from a device on the object, and back.
#![allow(clippy::unwrap_used, reason = "a test that cannot build its scene should fail")]

mod common;

use common::*;
use nalgebra::{Point3, Vector3};
use plica_sim::*;

const RADIUS: f64 = 0.007;

fn coupled(shape: ToolShape, friction: f64) -> ToolDescription {
    ToolDescription {
        coupling: Coupling::Spring(spring()),
        friction,
        max_tool_speed_m_per_s: 3.0,
        ..tool("device", shape)
    }
}

fn capsule() -> ToolShape {
    ToolShape::Capsule { radius_m: RADIUS, length_m: 0.1 }
}

/// A device with the wedge's rod crosses the thin end along +y at 2 m/s and stays 40 mm beyond it. Returns the proxy's last
/// position, the near wall's farthest y around it, the largest force and the deepest penetration.
fn cross(x: f64, friction: f64, max_force_n: f64) -> (Vector3<f64>, f64, f64, f64) {
    let mut tool = coupled(capsule(), friction);
    tool.coupling = Coupling::Spring(SpringCoupling { max_force_n, ..spring() });
    let mut run = Scene::wedge(E, 0.45).tool(tool).run();
    let path = |y: f64| Point3::new(x, y, 0.004);
    run.hold(path(-0.02), 0.1, |_, _| {});
    let (mut largest, mut deepest): (f64, f64) = (0.0, 0.0);
    let mut watch = |run: &Run, report: &TickReport| {
        largest = largest.max(run.state.tools()[0].force_n.norm());
        deepest = deepest.max(f64::from(report.max_penetration_m));
    };
    run.glide(path(-0.02), path(0.10), 0.06, &mut watch);
    run.hold(path(0.10), 1.0, &mut watch);
    assert_eq!(run.state.rollbacks(), 0);
    let proxy = run.state.tools()[0].proxy.translation.vector;
    let (skin, rest) = (run.skin(), run.model.description().skin.positions());
    let is_near_wall = |v: &usize| rest[*v].y < 1e-9 && (skin[*v].x - proxy.x).abs() < 4e-3;
    let wall = (0..skin.len()).filter(is_near_wall).map(|v| skin[v].y).fold(f64::NEG_INFINITY, f64::max);
    println!(
        "crossing at x {x}, friction {friction}, limit {max_force_n} N: proxy at {:.1?} mm, near wall at y {:.1} mm, force up to {largest:.2} N, penetration {:.2} mm",
        (1e3 * proxy).as_slice(),
        1e3 * wall,
        1e3 * deepest
    );
    (proxy, wall, largest, deepest)
}

#[test]
fn a_device_that_crosses_the_thin_end_leaves_its_proxy_on_the_near_side() {
    for (x, limit) in [(0.09, 5.0), (0.09, 10.0), (0.09, 20.0), (0.10, 5.0), (0.10, 10.0), (0.10, 20.0), (0.11, 10.0)] {
        let (proxy, wall, largest, deepest) = cross(x, 0.8, limit);
        assert!(proxy.y < wall, "the proxy went through the wall");
        assert!(largest <= limit + 1e-9);
        assert!(deepest < 0.5e-3);
    }
}

#[test]
fn without_friction_the_tip_may_climb_over_but_not_through() {
    for limit in [5.0, 20.0] {
        let (_, _, largest, deepest) = cross(0.10, 0.0, limit);
        assert!(largest <= limit + 1e-9);
        assert!(deepest < 1.5e-3);
    }
}

#[test]
fn a_device_pushed_through_the_object_is_stable_and_bounded() {
    for (e, friction) in [(1e3, 0.8), (3e4, 0.8), (3e4, 0.0), (1e6, 0.8)] {
        let mut run = Scene::wedge(e, 0.45).tool(coupled(capsule(), friction)).run();
        let surface = Point3::new(0.03, 0.03, top(0.03) + RADIUS);
        let through = surface - Vector3::z() * 0.06;
        let mut largest: f64 = 0.0;
        run.glide(surface + Vector3::z() * 2e-3, through, 0.2, |run, _| {
            largest = largest.max(run.state.tools()[0].force_n.norm())
        });
        let (mut late, mut speed): (Vec<f64>, f64) = (Vec::new(), 0.0);
        run.hold(through, 10.0, |run, _| {
            let reading = &run.state.tools()[0];
            largest = largest.max(reading.force_n.norm());
            if run.clock_s > 8.0 {
                late.push(reading.force_n.norm());
                let v = run.state.node_velocities(&run.model);
                speed = speed.max(v.iter().map(|v| v.norm()).fold(0.0, f64::max));
            }
        });
        let (low, high) = late.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), &f| (l.min(f), h.max(f)));
        let deepest = run.offsets().iter().map(|o| o.norm()).fold(0.0, f64::max);
        println!(
            "through, E {e:.0e} friction {friction}: force {low:.3}..{high:.3} N late, largest {largest:.3}, node speed {speed:.1e} m/s, displaced {:.1} mm",
            1e3 * deepest
        );
        assert!(largest <= 20.0 + 1e-9);
        assert_eq!(run.state.rollbacks(), 0);
        // 20 N on 1 kPa flattens the object onto its fixed floor without coming to rest (MATH.md, "Limits of contact").
        // Asserted there: bounded motion, no roll-back.
        assert!(e < 1e4 || high - low < 0.02 * high, "the force still moves");
    }
}

#[test]
fn first_touch_does_not_hit_hard() {
    for e in [1e3, 3e4, 1e6] {
        let mut run = Scene::wedge(e, 0.45).tool(coupled(ToolShape::Ball { radius_m: RADIUS }, 0.0)).run();
        let touch = Point3::new(0.05, 0.03, top(0.05)) + top_normal() * RADIUS;
        let stop = touch - top_normal() * 3e-3;
        let mut peak: f64 = 0.0;
        let mut peak_contact: f64 = 0.0;
        let mut watch = |run: &Run, _: &TickReport| {
            peak = peak.max(run.state.tools()[0].force_n.norm());
            peak_contact = peak_contact.max(run.force().norm());
        };
        run.hold(touch + top_normal() * 0.022, 0.1, &mut watch);
        run.glide(touch + top_normal() * 0.022, stop, 0.05, &mut watch);
        run.hold(stop, if e < 1e4 { 8.0 } else { 2.0 }, &mut watch);
        let settled = run.force().norm();
        println!(
            "first touch at 0.5 m/s, E {e:.0e}: settled {settled:.3} N, peak contact {:.2}, peak device {:.2} times that",
            peak_contact / settled,
            peak / settled
        );
        if e == 3e4 {
            assert!(peak_contact <= 1.5 * settled);
            assert!(peak <= 1.5 * settled);
        }
    }
}

#[test]
fn a_free_proxy_follows_its_device_without_force() {
    // A tracker at 100 Hz, far from the object: a staircase of poses at 0.5 m/s.
    let mut run = Scene::wedge(E, 0.45).tool(coupled(capsule(), 0.5)).run();
    let high = |x: f64| Point3::new(x, 0.03, 0.2);
    for k in 0..400 {
        let seen = [(0, at(high(0.5e-3 * f64::from(k))))];
        run.tick(if k % 10 == 0 { &seen } else { &[] });
        let reading = &run.state.tools()[0];
        assert_eq!((reading.force_n, reading.torque_n_m), (Vector3::zeros(), Vector3::zeros()), "nothing is touched");
    }
    run.hold(high(0.2), 0.5, |_, _| {});
    assert!((run.state.tools()[0].proxy.translation.vector - high(0.2).coords).norm() < 1e-6);
}
