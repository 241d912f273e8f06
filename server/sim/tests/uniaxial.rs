//! Effective material law of the corotated kernels in a bar under tension or compression: `P = E (lambda - 1)`,
//! `J = lambda (1 - nu (lambda - 1))^2`.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::forces::{elastic_forces, instantaneous};
use common::{E, Scene, distorted_block};
use nalgebra::{Matrix3, Rotation3, Vector3};
use plica_geometry::shapes::block_skin;
use plica_sim::{ElementKind, Model};

const BAR_M: [f64; 3] = [0.04, 0.02, 0.02];
const STRETCHES: [f64; 6] = [0.6, 0.8, 0.95, 1.05, 1.2, 1.6];
const TOLERANCE: f64 = 1e-4;

fn bar(poisson_ratio: f64, element: ElementKind) -> Model {
    let mesh = distorted_block(BAR_M, [4, 2, 2], 0.2);
    instantaneous(Scene::on(mesh, block_skin(BAR_M, 5e-3), E, poisson_ratio).with(|d| {
        d.element = element;
        d.fixed.fill(false);
    }))
}

/// Stretch ratios of a bar.
struct BarStretch {
    /// `lambda`
    axial: f64,
    /// `s`
    lateral: f64,
}

/// Forces at the nodes of the homogeneous deformation `x = R diag(lambda, s, s) X`, turned back by `R` [N].
fn forces(model: &Model, stretch: BarStretch, rotation: &Rotation3<f64>) -> Vec<Vector3<f64>> {
    let BarStretch { axial, lateral } = stretch;
    let stretches = Vector3::new(axial, lateral, lateral);
    let gradient = rotation.matrix() * Matrix3::from_diagonal(&stretches) - Matrix3::identity();
    let u: Vec<_> = model.description().mesh.nodes().iter().map(|x| gradient * x.coords).collect();
    elastic_forces(model, &u).iter().map(|f| rotation.inverse() * f).collect()
}

/// Sum over the nodes where coordinate `axis` is largest [N].
fn on_face(model: &Model, forces: &[Vector3<f64>], axis: usize) -> Vector3<f64> {
    let nodes = model.description().mesh.nodes();
    nodes.iter().zip(forces).filter(|(x, _)| x[axis] > BAR_M[axis] - 1e-9).map(|(_, f)| *f).sum()
}

/// Lateral stretch at which the lateral faces are free of traction, by the secant method.
fn free_lateral_stretch(model: &Model, lambda: f64, rotation: &Rotation3<f64>) -> f64 {
    let pull = |s: f64| on_face(model, &forces(model, BarStretch { axial: lambda, lateral: s }, rotation), 1).y;
    let (mut a, mut b) = (1.0, 1.0 - 0.4 * (lambda - 1.0));
    let (mut pull_a, mut pull_b) = (pull(a), pull(b));
    for _ in 0..6 {
        if (pull_b - pull_a).abs() < 1e-12 || (b - a).abs() < 1e-7 {
            break;
        }
        let c = b - pull_b * (b - a) / (pull_b - pull_a);
        (a, pull_a, b, pull_b) = (b, pull_b, c, pull(c));
    }
    b
}

#[test]
fn bar_follows_the_linear_corotational_law() {
    let turned = Rotation3::new(Vector3::new(0.4, -0.9, 0.3));
    let (mut worst_stress, mut worst_volume, mut worst_side) = (0.0_f64, 0.0_f64, 0.0_f64);
    for element in [ElementKind::FullIntegration, ElementKind::EnhancedStrain] {
        for nu in [0.0, 0.3, 0.45, 0.49] {
            let model = bar(nu, element);
            for (lambda, rotation) in STRETCHES.iter().flat_map(|&l| [(l, Rotation3::identity()), (l, turned)]) {
                let s = free_lateral_stretch(&model, lambda, &rotation);
                let volume = lambda * (1.0 - nu * (lambda - 1.0)).powi(2);
                worst_volume = worst_volume.max((lambda * s * s / volume - 1.0).abs());
                let stretch = BarStretch { axial: lambda, lateral: 1.0 - nu * (lambda - 1.0) };
                let forces = forces(&model, stretch, &rotation);
                let pull = E * (lambda - 1.0) * BAR_M[1] * BAR_M[2];
                worst_stress = worst_stress.max((-on_face(&model, &forces, 0).x / pull - 1.0).abs());
                let nodes = model.description().mesh.nodes();
                let sides = nodes.iter().zip(&forces).filter(|(x, _)| x.x > 1e-9 && x.x < BAR_M[0] - 1e-9);
                worst_side = sides.map(|(_, f)| f.norm() / pull.abs()).fold(worst_side, f64::max);
            }
        }
    }
    println!("worst relative errors: P {worst_stress:.1e}, J {worst_volume:.1e}, forces elsewhere {worst_side:.1e}");
    assert!(worst_stress < TOLERANCE && worst_volume < TOLERANCE && worst_side < TOLERANCE);
}
