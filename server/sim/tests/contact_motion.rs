//! Contact in motion: sweeps, two tools at once.
#![allow(clippy::unwrap_used, reason = "a test that cannot build its scene should fail")]

mod common;

use common::*;
use nalgebra::{Point3, Vector3};
use plica_sim::*;

const RADIUS: f64 = 0.007;

fn end() -> Point3<f64> {
    Point3::new(0.05, 0.03, top(0.05)) + top_normal() * (RADIUS - 3e-3)
}

/// Settled skin offsets after a press to 3 mm depth along this path.
fn settled(approach: impl Fn(&mut Run)) -> Vec<Vector3<f64>> {
    let mut ball = ball(RADIUS);
    ball.max_tool_speed_m_per_s = 3.0;
    let mut run = Scene::wedge(E, 0.45).tool(ball).run();
    approach(&mut run);
    run.hold(end(), 3.0, |_, _| {});
    assert_eq!(run.state.tools()[0].placements, 0, "the tool was swept, not placed");
    run.offsets()
}

#[test]
fn a_fast_arrival_between_tracker_samples_settles_like_a_slow_one() {
    let slow = settled(|run| run.glide(end() + top_normal() * 0.01, end(), 1.0, |_, _| {}));
    // 60 Hz at 2 m/s: 33 mm from sample to sample, the last one ends inside.
    let fast = settled(|run| {
        let step = 2.0 / 60.0;
        for k in (0..5).rev() {
            let p = end() + top_normal() * (step * f64::from(k));
            run.tick(&[(0, at(p))]);
            for _ in 0..16 {
                run.tick(&[]);
            }
        }
    });
    let difference = relative(&fast, &slow);
    println!("arrival at 2 m/s between 60 Hz samples: settled shape differs by {:.2} %", 100.0 * difference);
    assert!(difference < 0.03);
}

#[test]
fn a_pinch_of_two_tools_gains_no_energy() {
    for e in [1e3, 3e4, 1e6] {
        let pinching =
            |name: &str| ToolDescription { friction: 0.5, ..tool(name, ToolShape::Ball { radius_m: RADIUS }) };
        let mut run = Scene::wedge(e, 0.45).tool(pinching("left")).tool(pinching("right")).run();
        let pose = |side: f64, depth: f64, lift: f64| {
            let y = 0.03 + side * (0.03 + RADIUS - depth);
            at(Point3::new(0.05, y, 0.018 + lift))
        };
        let pinch = |run: &mut Run, seconds: f64, depth: &dyn Fn(f64) -> f64, lift: &dyn Fn(f64) -> f64| {
            let n = (seconds * 1e3) as usize;
            (1..=n)
                .map(|k| {
                    let s = k as f64 / n as f64;
                    run.tick(&[(0, pose(-1.0, depth(s), lift(s))), (1, pose(1.0, depth(s), lift(s)))]);
                    energy(run)
                })
                .collect::<Vec<f64>>()
        };
        pinch(&mut run, 0.5, &|s| 0.012 * s - 0.001, &|_| 0.0);
        pinch(&mut run, 0.5, &|_| 0.011, &|s| 0.004 * s);
        let held = pinch(&mut run, if e < 1e4 { 10.0 } else { 3.0 }, &|_| 0.011, &|_| 0.004);
        // Tools at rest do no work: the energy may only fall, up to noise.
        let rise = held.windows(100).map(|w| w[99] - w[0]).fold(0.0, f64::max) / held[0];
        println!(
            "pinch E {e:.0e}: energy {:.3e} J, largest rise within 0.1 s {:.1e} of it, last {:.3e}",
            held[0],
            rise,
            held[held.len() - 1]
        );
        assert!(rise < 0.01, "energy rose by {rise}");
        assert!(held[held.len() - 1] <= held[0] * 1.001);
    }
}
