//! The imprint of a ball is independent of Young's modulus, the time step and the contact solver.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;
mod reference;

use common::{E, Scene, ball, relative, top, top_normal};
use nalgebra::{Point3, Vector3};
use reference::Reference;
use reference::ball::Ball;

const DEPTH_M: f64 = 5e-3;
const POISSON_RATIO: f64 = 0.45;

/// Position of a ball `depth` below the top, at x = 50 mm, y = 30 mm.
fn pressed(radius: f64, depth: f64) -> Point3<f64> {
    Point3::new(0.05, 0.03, top(0.05)) + top_normal() * (radius - depth)
}

/// A settled imprint.
struct Imprint {
    /// Displacements of the nodes that can move [m].
    displacements: Vec<Vector3<f64>>,
    /// Force on the ball over Young's modulus [m2].
    force: Vector3<f64>,
}

fn free<T: Copy>(fixed: &[bool], values: &[T]) -> Vec<T> {
    fixed.iter().zip(values).filter(|(f, _)| !**f).map(|(_, v)| *v).collect()
}

/// Pressed within half a second and held for 5 s.
fn simulated(radius: f64, young_modulus_pa: f64, h: f64) -> Imprint {
    let mut run = Scene::wedge(young_modulus_pa, POISSON_RATIO).tool(ball(radius)).timestep(h).run();
    run.glide(pressed(radius, -1e-3), pressed(radius, DEPTH_M), 0.5, |_, _| {});
    run.hold(pressed(radius, DEPTH_M), 5.0, |_, _| {});
    let displacements = free(&run.model.description().fixed, &run.state.node_displacements(&run.model));
    Imprint { displacements, force: run.force() / young_modulus_pa }
}

/// The reference's imprint, pushed in by steps and settled to 10 nm.
fn expected(radius: f64) -> Imprint {
    const STEPS: usize = 20;
    let scene = Scene::wedge(E, POISSON_RATIO);
    let mut reference = Reference::new(&scene.description);
    for k in 1..STEPS {
        let center = pressed(radius, DEPTH_M * k as f64 / STEPS as f64);
        reference.press(Ball { center, radius }, 3, 1e-8);
    }
    let (force, last) = reference.press(Ball { center: pressed(radius, DEPTH_M), radius }, 400, 1e-8);
    assert!(last < 1e-8, "the reference has not settled: its last step moved a node by {last:e} m");
    Imprint { displacements: free(&scene.description.fixed, &reference.u), force: force / E }
}

/// Shape within 3 % (all nodes that can move, 2-norm) and force within 0.5 %, of the reference and of each other.
fn same_imprint(radius: f64) {
    let expected = expected(radius);
    println!("R {:.0} mm, reference: F/E {:.5e} m2", radius * 1e3, expected.force.norm());
    let mut found: Vec<Imprint> = Vec::new();
    for (e, h) in [(1e3, 1e-3), (3e4, 1e-3), (1e6, 1e-3), (1e3, 5e-3), (3e4, 5e-3), (1e6, 5e-3)] {
        let imprint = simulated(radius, e, h);
        let differences = |other: &Imprint| {
            let force = imprint.force.norm() / other.force.norm() - 1.0;
            (relative(&imprint.displacements, &other.displacements), force.abs())
        };
        let (shape, force) = differences(&expected);
        let others = found.iter().map(differences).fold((0.0, 0.0), |m: (f64, f64), d| (m.0.max(d.0), m.1.max(d.1)));
        println!(
            "  E {e:.0e} Pa, h {:.0} ms: off the reference by {:.2} % in shape and {:.3} % in force, off the rows above by {:.2} % and {:.3} %",
            h * 1e3,
            shape * 100.0,
            force * 100.0,
            others.0 * 100.0,
            others.1 * 100.0
        );
        assert!(
            shape < 0.03 && others.0 < 0.03,
            "R {radius} m, E {e} Pa, h {h} s: shape differs by {shape}, {}",
            others.0
        );
        assert!(
            force < 5e-3 && others.1 < 5e-3,
            "R {radius} m, E {e} Pa, h {h} s: force differs by {force}, {}",
            others.1
        );
        found.push(imprint);
    }
}

#[test]
fn imprint_of_a_7_mm_ball() {
    same_imprint(0.007);
}

#[test]
fn imprint_of_a_10_mm_ball() {
    same_imprint(0.010);
}

#[test]
fn imprint_of_a_15_mm_ball() {
    same_imprint(0.015);
}
