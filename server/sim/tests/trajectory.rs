//! Motion against the `f64` reference at the same time step.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;
mod reference;

use common::{E, Run, Scene, at, ball, top, top_normal};
use nalgebra::{Point3, Vector3};
use reference::Reference;
use reference::ball::Ball;

/// Largest distance between two sets of nodes, and largest displacement of the second [m].
fn distance(found: &[Vector3<f64>], expected: &[Vector3<f64>]) -> (f64, f64) {
    let apart = found.iter().zip(expected).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    (apart, expected.iter().map(|b| b.norm()).fold(0.0, f64::max))
}

/// A smooth bump of 7 mm on the top, fading towards the bottom [m].
fn bump(x: &Point3<f64>) -> Vector3<f64> {
    let r_squared = ((x.x - 0.05).powi(2) + (x.y - 0.03).powi(2)) / 0.02_f64.powi(2);
    Vector3::new(0.002, 0.001, -0.007) * (-r_squared).exp() * (x.z / top(x.x))
}

/// Worst error over time and nodes, over the largest displacement.
#[derive(Debug, Clone, Copy, Default)]
struct Deviation {
    worst_m: f64,
    largest_m: f64,
}

impl Deviation {
    fn watch(&mut self, run: &Run, reference: &Reference) {
        let (apart, size) = distance(&run.state.node_displacements(&run.model), &reference.u);
        (self.worst_m, self.largest_m) = (self.worst_m.max(apart), self.largest_m.max(size));
    }

    fn share(&self) -> f64 {
        self.worst_m / self.largest_m
    }
}

/// Both start from the same displacements at rest, without tools.
fn deviation(scene: Scene, start: impl Fn(&Point3<f64>) -> Vector3<f64>, seconds: f64) -> Deviation {
    let mut reference = Reference::new(&scene.description);
    let mut run = scene.run();
    let u: Vec<Vector3<f64>> = run.model.description().mesh.nodes().iter().map(start).collect();
    run.state.set_node_displacements(&run.model, &u);
    reference.u = run.state.node_displacements(&run.model);
    let mut deviation = Deviation::default();
    deviation.watch(&run, &reference);
    for _ in 0..(seconds / run.model.timestep_s()).round() as usize {
        run.tick(&[]);
        reference.step();
        deviation.watch(&run, &reference);
    }
    deviation
}

#[test]
fn released_bump_rings_down_as_in_the_reference() {
    // The last one is stiff and nearly incompressible: the solver's loose exit shows most.
    let cases = [
        (3e4, 0.45, 1e-3, 1e-3),
        (3e4, 0.45, 5e-3, 1e-3),
        (1e3, 0.45, 1e-3, 1e-3),
        (1e6, 0.45, 1e-3, 1e-3),
        (3e4, 0.49, 1e-3, 1e-3),
        (1e6, 0.49, 1e-3, 2e-3),
    ];
    for (e, nu, h, bound) in cases {
        let found = deviation(Scene::wedge(e, nu).timestep(h), bump, 0.3);
        println!("E {e:.0e} Pa, nu {nu}, h {h} s: {:.1e} of {:.1e} m", found.share(), found.largest_m);
        assert!(found.share() < bound, "E {e} Pa, nu {nu}, h {h} s: {found:?}");
    }
}

#[test]
fn object_that_gravity_is_switched_on_for_moves_as_in_the_reference() {
    let scene = Scene::wedge(E, 0.45).with(|d| d.gravity_m_per_s2 = Vector3::new(3.0, -2.0, -9.81));
    let found = deviation(scene, |_| Vector3::zeros(), 0.5);
    println!("{:.1e} of {:.1e} m", found.share(), found.largest_m);
    assert!(found.largest_m > 4e-4 && found.share() < 1e-3, "{found:?}");
}

/// Depth of a ball that is pressed within 0.1 s, held for 0.2 s and lifted [m].
fn depth(tick: usize) -> f64 {
    let pressed = |ticks: usize| -0.001 + 0.006 * ticks as f64 / 100.0;
    match tick {
        0..100 => pressed(tick),
        100..300 => pressed(100),
        300..400 => pressed(400 - tick),
        _ => pressed(0),
    }
}

/// The reference ends every step with no point inside the ball; the crate's multipliers lag behind a tool that moves, and the
/// frictionless ball has a soft sideways mode.
#[test]
fn pressed_and_lifted_ball_moves_the_object_as_exact_contact_does() {
    for radius in [0.007, 0.010] {
        let scene = Scene::wedge(E, 0.45).tool(ball(radius));
        let mut reference = Reference::new(&scene.description);
        let mut run = scene.run();
        let (mut found, mut force_error, mut largest_force) = (Deviation::default(), 0.0_f64, 0.0_f64);
        for k in 0..600 {
            let center = Point3::new(0.05, 0.03, top(0.05)) + top_normal() * (radius - depth(k));
            run.tick(&[(0, at(center))]);
            let force = reference.step_with_ball(Ball { center, radius });
            found.watch(&run, &reference);
            largest_force = largest_force.max(force.norm());
            force_error = force_error.max((run.force() - force).norm());
        }
        let rest = distance(&run.state.node_displacements(&run.model), &reference.u).0;
        let force_share = force_error / largest_force;
        println!("R {radius} m: shape {:.1e}, force {force_share:.1e}, {rest:.1e} m at the end", found.share());
        assert!(found.share() < 0.05 && force_share < 0.05, "{found:?}, force {force_share}");
        assert!(rest < 1e-3 * found.largest_m, "{rest} m apart long after release");
    }
}
