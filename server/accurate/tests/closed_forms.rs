//! Uniaxial, confined, equibiaxial and shear tests of each isotropic material against the closed form, on a distorted mesh.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{ISOTROPIC, distorted_block, material, rest, sides, solve};
use nalgebra::{Matrix3, Vector3};
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
        MaterialModel::Exponential { exponent: b } => {
            mu * (b * (i_c - 3.0 - 2.0 * j.ln())).exp() * (s_k - 1.0 / s_k) + lambda / 2.0 * (j * j - 1.0) / s_k
        }
        MaterialModel::FibreReinforced(_) => panic!("not isotropic: see fibres.rs"),
    }
}

/// The lateral stretch at which lateral faces are free.
fn free_lateral_stretch(material: &Material, axial: f64) -> f64 {
    root(|lateral| nominal_stress(material, [lateral, lateral, axial], 0))
}

/// Zero of an increasing function, by bisection.
fn root(f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.01, 4.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Stretches the block along z, its least sides sliding; the deformed positions and the axial force on the top.
fn press(material: Material, stretch: f64, is_confined: bool) -> (Vec<Vector3<f64>>, f64) {
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
    for model in ISOTROPIC {
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
    for model in ISOTROPIC {
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
    for model in ISOTROPIC {
        let material = material(model, 3e4, 0.45);
        let back = Material::from_lame(model, material.lame());
        common::assert_close(back.young_modulus_pa, 3e4, 1e-13, "E");
        common::assert_close(back.poisson_ratio, 0.45, 1e-13, "nu");
        let (_, force) = press(material, 1.0 + 1e-7, false);
        let expected = 3e4 * 1e-7 * SIZE[0] * SIZE[1];
        common::assert_close(force, expected, 1e-6, &format!("{model:?}: force at a strain of 1e-7"));
    }
}

/// Stretched along x and y, free along z.
#[test]
fn equibiaxial() {
    let mesh = mesh();
    for model in ISOTROPIC {
        for poisson_ratio in [0.0, 0.3, 0.48] {
            let material = material(model, 3e4, poisson_ratio);
            for stretch in [0.7, 0.9, 1.1, 1.5] {
                let thinned = root(|s| nominal_stress(&material, [stretch, stretch, s], 2));
                let expected = nominal_stress(&material, [stretch, stretch, thinned], 0) * SIZE[1] * SIZE[2];
                let mut constraints = Constraints::none(mesh.n_nodes());
                for (node, x) in mesh.nodes().iter().enumerate() {
                    for (axis, [least, greatest]) in sides(x, SIZE).into_iter().enumerate() {
                        if least || (axis < 2 && greatest) {
                            constraints.give(node, axis, stretch * x[axis]);
                        }
                    }
                }
                let (x, forces) = equilibrium(material, &constraints);
                let on_end = mesh.nodes().iter().zip(&forces).filter(|(x, _)| sides(x, SIZE)[0][1]);
                let force: f64 = on_end.map(|(_, f)| f.x).sum();
                common::assert_close(force, expected, 1e-9, &format!("{material:?}, stretch {stretch}: force"));
                let reached = x.iter().map(|x| x.z).fold(0.0, f64::max) / SIZE[2];
                common::assert_close(reached, thinned, 1e-9, &format!("{material:?}, stretch {stretch}: thickness"));
            }
        }
    }
}

/// Simple shear `F = I + g e_x e_z^T`: `J = 1`, `I_C - 3 = g^2`, shear stress on the top in closed form.
#[test]
fn simple_shear() {
    let mesh = mesh();
    for model in ISOTROPIC {
        let material = material(model, 3e4, 0.45);
        let mu = 3e4 / 2.9;
        for shear in [0.1, 0.5, 1.0] {
            let f = Matrix3::identity() + Matrix3::new(0.0, 0.0, shear, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
            let moved = common::affine(&mesh, &f, &Vector3::zeros());
            let mut constraints = Constraints::none(mesh.n_nodes());
            let on_boundary = |node: &usize| common::is_on_boundary(&mesh.nodes()[*node], SIZE);
            (0..mesh.n_nodes()).filter(on_boundary).for_each(|node| constraints.hold(node, &moved[node]));
            let (_, forces) = equilibrium(material, &constraints);
            // Corner nodes belong to several faces: the shear force is the work of all of them on a unit shear.
            let work: f64 = mesh.nodes().iter().zip(&forces).map(|(x, f)| f.x * x.z).sum();
            let stress = work / (SIZE[0] * SIZE[1] * SIZE[2]);
            let expected = match model {
                MaterialModel::StableNeoHookean => 4.0 / 3.0 * mu * shear * (1.0 - 1.0 / (4.0 + shear * shear)),
                MaterialModel::Exponential { exponent: b } => mu * shear * (b * shear * shear).exp(),
                _ => mu * shear,
            };
            common::assert_close(stress, expected, 1e-9, &format!("{model:?}, shear {shear}"));
        }
    }
}

/// Incompressible textbook forms: `mu e (s - 1/s^2)` uniaxial, `mu e (s - 1/s^5)` equibiaxial, `e = exp(b (I_C - 3))`.
#[test]
fn a_nearly_incompressible_exponential_follows_the_incompressible_forms() {
    let b = 2.0_f64;
    let material = material(MaterialModel::Exponential { exponent: b }, 3e4, 0.499_999_9);
    let mu = material.lame().mu_pa;
    for s in [0.6_f64, 0.8, 1.2, 1.5] {
        let lateral = free_lateral_stretch(&material, s);
        let uniaxial = mu * (b * (s * s + 2.0 / s - 3.0)).exp() * (s - 1.0 / (s * s));
        common::assert_close(nominal_stress(&material, [lateral, lateral, s], 2), uniaxial, 1e-5, "uniaxial");
        let found = material.first_piola_stress(&Matrix3::from_diagonal(&Vector3::new(lateral, lateral, s)));
        common::assert_close(found[(2, 2)], uniaxial, 1e-5, "uniaxial, of the material");
    }
}

/// Positions and reactions.
fn equilibrium(material: Material, constraints: &Constraints) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let mesh = mesh();
    let solid = Solid::uniform(&mesh, material).unwrap();
    let mut x = rest(&mesh);
    let params = Params { tolerance: 1e-11, ..Params::default() };
    solve(&[&solid], constraints, &params, &mut x).unwrap();
    let energies: [&dyn Energy; 1] = [&solid];
    let forces = reactions(&energies, &x);
    (x, forces)
}
