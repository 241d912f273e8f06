//! Coulomb friction: the cone in every tick, sliding force, no creep, quiet holds.
#![allow(clippy::unwrap_used, reason = "a test that cannot build its scene should fail")]

mod common;

use common::*;
use nalgebra::{Point3, Vector3};
use plica_sim::*;

const RADIUS: f64 = 0.010;

/// The wedge with a ball of friction `mu`, rigid or coupled.
fn scene(e: f64, mu: f64, coupled: bool) -> Scene {
    let mut ball = ball(RADIUS);
    ball.friction = mu;
    if coupled {
        ball.coupling = Coupling::Spring(SpringCoupling { max_force_n: 200.0, ..spring() });
    }
    Scene::wedge(e, 0.45).tool(ball)
}

fn start(depth: f64) -> Point3<f64> {
    Point3::new(0.05, 0.02, top(0.05)) + top_normal() * (RADIUS - depth)
}

/// Sum of tangential over friction times normal forces of all contacts.
fn cone_share(run: &Run, mu: f64) -> Option<f64> {
    let (mut normal, mut tangential) = (0.0, 0.0);
    for c in run.state.contacts() {
        assert!(c.normal_force_n >= 0.0, "a contact pulls with {} N", c.normal_force_n);
        normal += c.normal_force_n;
        tangential += c.tangential_force_n.norm();
    }
    (normal > 1e-6).then(|| tangential / (mu * normal))
}

/// Presses 3 mm, slides 20 mm at 20 mm/s, and returns the cone shares of steady sliding and the largest change of the
/// force per tick, as a share of the force.
fn slide(e: f64, mu: f64, coupled: bool) -> (f64, f64, f64) {
    let mut run = scene(e, mu, coupled).run();
    let c = start(3e-3);
    let mut worst: f64 = 0.0;
    run.glide(c + top_normal() * 4e-3, c, 0.3, |run, _| worst = worst.max(cone_share(run, mu).unwrap_or(0.0)));
    run.hold(c, 0.5, |run, _| worst = worst.max(cone_share(run, mu).unwrap_or(0.0)));
    let (mut shares, mut forces) = (Vec::new(), Vec::new());
    let begin = run.clock_s + 0.4;
    run.glide(c, c + Vector3::new(0.0, 0.02, 0.0), 1.0, |run, _| {
        let share = cone_share(run, mu).unwrap();
        worst = worst.max(share);
        if run.clock_s > begin {
            shares.push(share);
            forces.push(run.state.tools()[0].force_n);
        }
    });
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    let jump = forces.windows(2).map(|w| (w[1] - w[0]).norm() / w[0].norm()).fold(0.0, f64::max);
    println!(
        "E {e:.0e} mu {mu} coupled {coupled}: sliding force over mu N {mean:.3}, worst cone {worst:.3}, change per tick {:.2} %",
        100.0 * jump
    );
    (mean, worst, jump)
}

#[test]
fn sliding_stays_on_the_cone() {
    for coupled in [false, true] {
        for mu in [0.5, 0.8] {
            let (mean, worst, jump) = slide(3e4, mu, coupled);
            assert!((mean - 1.0).abs() < 0.06);
            assert!(worst <= 1.03);
            assert!(jump < 0.03);
        }
        for e in [1e3, 1e6] {
            let (_, worst, _) = slide(e, 0.5, coupled);
            assert!(worst <= 1.03, "the cone holds for every stiffness");
        }
    }
}

#[test]
fn a_stuck_tool_does_not_creep() {
    for (e, coupled) in [(3e4, false), (3e4, true), (1e6, false), (1e3, false)] {
        let mut run = scene(e, 0.4, coupled).run();
        let c = start(3e-3);
        run.glide(c + top_normal() * 4e-3, c, 0.3, |_, _| {});
        // A sideways load of about half the cone, held.
        let aside = c + Vector3::new(0.0, 0.4e-3, 0.0);
        run.glide(c, aside, 0.2, |_, _| {});
        run.hold(aside, if e < 1e4 { 8.0 } else { 2.0 }, |_, _| {});
        let share = cone_share(&run, 0.4).unwrap();
        let touched = touched_vertex(&run);
        let relative = |run: &Run| run.skin()[touched] - Point3::from(run.state.tools()[0].proxy.translation.vector);
        let before = relative(&run);
        run.hold(aside, 10.0, |_, _| {});
        let creep = (relative(&run) - before).norm();
        println!("E {e:.0e} coupled {coupled}: at {share:.2} of the cone, creep {:.5} mm in 10 s", 1e3 * creep);
        assert!(share > 0.2 && share < 0.95, "the load should stick with something to hold: {share}");
        assert!(creep < 0.005e-3);
    }
}

/// The skin vertex nearest to the heaviest contact.
fn touched_vertex(run: &Run) -> usize {
    let heaviest = run.state.contacts().max_by(|a, b| a.normal_force_n.total_cmp(&b.normal_force_n)).unwrap();
    let distance = |p: &Point3<f64>| (p - heaviest.point_m).norm();
    let skin = run.skin();
    (0..skin.len()).min_by(|&a, &b| distance(&skin[a]).total_cmp(&distance(&skin[b]))).unwrap()
}

#[test]
fn a_held_tool_is_quiet() {
    for (e, coupled, settle_s) in [(3e4, false, 5.0), (3e4, true, 5.0), (1e6, false, 5.0), (1e3, false, 12.0)] {
        for mu in [0.0, 0.5] {
            let mut run = scene(e, mu, coupled).run();
            let c = start(5e-3);
            run.glide(c + top_normal() * 6e-3, c, 0.3, |_, _| {});
            run.hold(c, settle_s, |_, _| {});
            let mut forces = Vec::new();
            run.hold(c, 2.0, |run, _| forces.push(run.state.tools()[0].force_n));
            let mean: Vector3<f64> = forces.iter().sum::<Vector3<f64>>() / forces.len() as f64;
            let variance = forces.iter().map(|f| (f - mean).norm_squared()).sum::<f64>() / forces.len() as f64;
            let noise = variance.sqrt() / mean.norm();
            println!("E {e:.0e} coupled {coupled} mu {mu}: hold noise {noise:.1e} of the force");
            // A very soft object under a rigid ball without friction sways sideways by tenths of a millimetre: no
            // lateral force holds it. Reported, not asserted (MATH.md, "Limits of contact").
            if e > 1e3 || mu > 0.0 {
                assert!(noise < 5e-4, "noise {noise}");
            }
        }
    }
}
