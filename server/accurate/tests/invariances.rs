//! Invariances of every element: no force at rest or after a rigid motion, the patch test, volume and stress of affine
//! deformations.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::derivatives::gradient_of;
use common::random::Random;
use common::{MODELS, affine, distance, distorted_block, is_on_boundary, material, rest, solve};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use plica_accurate::{Constraints, Energy, GAUSS_POINTS, MaterialModel, Params, Solid, Traction};
use plica_geometry::{HexIdx, HexMesh};

const SIZE: [f64; 3] = [0.06, 0.04, 0.05];
const E: f64 = 3e4;

fn mesh() -> HexMesh {
    distorted_block(SIZE, [3, 3, 3], 0.25, 4)
}

/// A force that 1 % of strain would give \[N\].
fn force_scale() -> f64 {
    0.01 * E * SIZE[0] * SIZE[1] / 9.0
}

#[test]
fn no_force_at_rest() {
    for model in MODELS {
        let solid = Solid::uniform(&mesh(), material(model, E, 0.48)).unwrap();
        let x = rest(&mesh());
        assert!(gradient_of(&solid, &x).amax() <= 1e-13 * force_scale(), "{model:?}");
        assert!(solid.value(&x).abs() <= 1e-25, "{model:?}: {}", solid.value(&x));
    }
}

#[test]
fn no_force_after_a_rigid_motion() {
    let b = Vector3::new(0.3, -0.2, 0.1);
    for (model, angle) in MODELS.into_iter().zip([0.0, 2.5, 2.5, 2.5, 2.5]) {
        let turn = *Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(1.0, 2.0, -1.0)), angle).matrix();
        let solid = Solid::uniform(&mesh(), material(model, E, 0.48)).unwrap();
        let forces = gradient_of(&solid, &affine(&mesh(), &turn, &b));
        assert!(forces.amax() <= 1e-10 * force_scale(), "{model:?}: {}", forces.amax());
    }
}

#[test]
fn forces_and_their_moments_sum_to_nothing() {
    let mut random = Random::new(5);
    for model in MODELS.into_iter().filter(|model| *model != MaterialModel::Linear) {
        let solid = Solid::uniform(&mesh(), material(model, E, 0.45)).unwrap();
        let x = random.scatter(&rest(&mesh()), 2e-3);
        let mut forces = vec![Vector3::zeros(); x.len()];
        solid.add_gradient(&x, &mut forces);
        let largest = forces.iter().map(Vector3::norm).fold(0.0, f64::max);
        let force: Vector3<f64> = forces.iter().sum();
        let moment: Vector3<f64> = x.iter().zip(&forces).map(|(x, f)| x.cross(f)).sum();
        assert!(force.norm() <= 1e-12 * largest && moment.norm() <= 1e-13 * largest, "{model:?}: {force} {moment}");
    }
}

/// Boundary nodes of a distorted mesh are moved by an affine map; the inner ones follow.
#[test]
fn patch_test() {
    let mesh = mesh();
    let mut random = Random::new(6);
    for model in MODELS {
        for poisson_ratio in [0.0, 0.3, 0.499] {
            let solid = Solid::uniform(&mesh, material(model, E, poisson_ratio)).unwrap();
            let expected = affine(&mesh, &(Matrix3::identity() + random.matrix(0.15)), &random.vector(0.05));
            let mut constraints = Constraints::none(mesh.n_nodes());
            for (node, _) in mesh.nodes().iter().enumerate().filter(|(_, x)| is_on_boundary(x, SIZE)) {
                constraints.hold(node, &expected[node]);
            }
            let mut x = rest(&mesh);
            let params = Params { tolerance: 1e-12, ..Params::default() };
            solve(&[&solid], &constraints, &params, &mut x).unwrap();
            let miss = distance(&x, &expected) / SIZE[0];
            println!("patch test, {model:?}, nu {poisson_ratio}: off by {miss:.1e} of the size");
            assert!(miss <= 1e-11, "{model:?}, nu {poisson_ratio}: {miss:e}");
        }
    }
}

/// Under the same affine deformation all Gauss points have the stress of the material, and the volume is that of the map.
#[test]
fn stress_and_volume_of_an_affine_deformation() {
    let mesh = mesh();
    let f = Matrix3::new(1.2, 0.1, -0.05, 0.0, 0.9, 0.2, 0.1, -0.1, 1.1);
    let x = affine(&mesh, &f, &Vector3::zeros());
    for model in MODELS {
        let material = material(model, E, 0.45);
        let solid = Solid::uniform(&mesh, material).unwrap();
        let piola = material.first_piola_stress(&f);
        let expected = if model == MaterialModel::Linear { piola } else { piola * f.transpose() / f.determinant() };
        for hex in mesh.hex_indices() {
            for xi in GAUSS_POINTS.into_iter().chain([[0.0; 3], [0.3, -0.9, 1.0]]) {
                let miss = (solid.cauchy_stress(&x, hex, xi) - expected).norm();
                assert!(miss <= 1e-11 * E, "{model:?}, {hex}: {miss}");
            }
        }
        let volume = f.determinant() * mesh.volume();
        common::assert_close(solid.volume(&x), volume, 1e-13, "volume");
        common::assert_close(solid.smallest_jacobian(&x).unwrap(), f.determinant(), 1e-13, "smallest J");
        assert!((solid.deformation_gradient(&x, HexIdx(13), [0.1, 0.2, 0.3]) - f).norm() <= 1e-13);
    }
}

#[test]
fn traction_acts_on_the_rest_area() {
    let mesh = mesh();
    let top: Vec<_> = mesh
        .boundary_quads()
        .into_iter()
        .filter(|quad| quad.iter().all(|node| (mesh.nodes()[node.index()].z - SIZE[2]).abs() < 1e-9))
        .collect();
    assert_eq!(top.len(), 9);
    let traction = Traction::new(&mesh, &top, Vector3::new(0.0, 5.0, -20.0));
    let expected = Vector3::new(0.0, 5.0, -20.0) * SIZE[0] * SIZE[1];
    assert!((traction.total() - expected).norm() <= 1e-14 * expected.norm());
}
