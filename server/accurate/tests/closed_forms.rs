//! Uniaxial and confined tests of each material against the closed form, on a distorted mesh.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{MODELS, distorted_block, material, rest, sides, solve};
use plica_accurate::{Constraints, Energy, Material, MaterialModel, Params, Solid, reactions};
use plica_geometry::HexMesh;

const SIZE: [f64; 3] = [0.03, 0.02, 0.04];
const STRETCHES: [f64; 7] = [0.5, 0.7, 0.9, 0.999, 1.1, 1.5, 2.0];

fn mesh() -> HexMesh {
    distorted_block(SIZE, [2, 2, 2], 0.3, 7)
}

/// Principal nominal stress \[Pa\] along `axis` for the principal stretches `s`, in textbook form.
fn nominal_stress(material: &Material, s: [f64; 3], axis: usize) -> f64 {
    let (e, nu) = (material.young_modulus_pa, material.poisson_ratio);
    let (lambda, mu) = (e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)));
    let (j, i_c) = (s[0] * s[1] * s[2], s.iter().map(|s| s * s).sum::<f64>());
    let s_k = s[axis];
    match material.model {
        MaterialModel::Linear => lambda * s.iter().map(|s| s - 1.0).sum::<f64>() + 2.0 * mu * (s_k - 1.0),
        MaterialModel::CompressibleNeoHookean => mu * (s_k - 1.0 / s_k) + lambda / 2.0 * (j * j - 1.0) / s_k,
        MaterialModel::StableNeoHookean => {
            let (mu_s, lambda_s) = (4.0 / 3.0 * mu, lambda + 5.0 / 6.0 * mu);
            let alpha = 1.0 + 0.75 * mu_s / lambda_s;
            mu_s * s_k * (1.0 - 1.0 / (i_c + 1.0)) + lambda_s * (j - alpha) * j / s_k
        }
    }
}

/// The lateral stretch at which lateral faces are free, by bisection.
fn free_lateral_stretch(material: &Material, axial: f64) -> f64 {
    let (mut low, mut high) = (0.2, 3.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        let stress = nominal_stress(material, [middle, middle, axial], 0);
        if stress < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Stretches the block along z, its least sides sliding; the deformed positions and the axial force on the top.
fn press(material: Material, stretch: f64, is_confined: bool) -> (Vec<nalgebra::Vector3<f64>>, f64) {
    let mesh = mesh();
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate() {
        for (axis, [least, greatest]) in sides(x, SIZE).into_iter().enumerate() {
            if least || (is_confined && axis < 2 && greatest) {
                constraints.give(node, axis, x[axis]);
            } else if axis == 2 && greatest {
                constraints.give(node, axis, stretch * x[axis]);
            }
        }
    }
    let solid = Solid::uniform(&mesh, material).unwrap();
    let mut x = rest(&mesh);
    let params = Params { tolerance: 1e-11, ..Params::default() };
    let info = solve(&[&solid], &constraints, &params, &mut x).unwrap();
    assert!(info.smallest_jacobian.unwrap() > 0.0);
    let energies: [&dyn Energy; 1] = [&solid];
    let forces = reactions(&energies, &x);
    let on_top = mesh.nodes().iter().zip(&forces).filter(|(x, _)| sides(x, SIZE)[2][1]);
    (x, on_top.map(|(_, f)| f.z).sum())
}

#[test]
fn uniaxial() {
    let mut worst = 0.0_f64;
    for model in MODELS {
        for poisson_ratio in [0.0, 0.3, 0.48] {
            let material = material(model, 3e4, poisson_ratio);
            for stretch in STRETCHES {
                let lateral = free_lateral_stretch(&material, stretch);
                let expected = nominal_stress(&material, [lateral, lateral, stretch], 2) * SIZE[0] * SIZE[1];
                let (x, force) = press(material, stretch, false);
                let reached = x.iter().map(|x| x.x).fold(0.0, f64::max) / SIZE[0];
                let miss = (force / expected - 1.0).abs().max((reached / lateral - 1.0).abs());
                assert!(miss <= 1e-9, "{material:?}, stretch {stretch}: force {force} N, {expected} N");
                worst = worst.max(miss);
            }
        }
    }
    println!("uniaxial, stretch 0.5 to 2: force and lateral stretch within {worst:.1e}");
}

#[test]
fn confined() {
    let mut worst = 0.0_f64;
    for model in MODELS {
        for poisson_ratio in [0.0, 0.3, 0.48, 0.499] {
            let material = material(model, 3e4, poisson_ratio);
            for stretch in STRETCHES {
                let expected = nominal_stress(&material, [1.0, 1.0, stretch], 2) * SIZE[0] * SIZE[1];
                let (_, force) = press(material, stretch, true);
                let miss = (force / expected - 1.0).abs();
                assert!(miss <= 1e-9, "{material:?}, stretch {stretch}: force {force} N, {expected} N");
                worst = worst.max(miss);
            }
        }
    }
    println!("confined, stretch 0.5 to 2: force within {worst:.1e}");
}

/// Lamé's parameters and back, and the modulus at small strain.
#[test]
fn small_strain_follows_hooke() {
    for model in MODELS {
        let material = material(model, 3e4, 0.45);
        let back = Material::from_lame(model, material.lame());
        common::assert_close(back.young_modulus_pa, 3e4, 1e-13, "E");
        common::assert_close(back.poisson_ratio, 0.45, 1e-13, "nu");
        let (_, force) = press(material, 1.0 + 1e-7, false);
        common::assert_close(force, 3e4 * 1e-7 * SIZE[0] * SIZE[1], 1e-6, "force at a strain of 1e-7");
    }
}
