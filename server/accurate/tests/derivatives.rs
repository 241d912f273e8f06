//! Every energy passes the harness of `common/derivatives.rs`. A new energy is a new line here.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::derivatives::{check_derivatives, hessian_of};
use common::random::Random;
use common::{MODELS, distorted_block, material, rest};
use nalgebra::{Point3, Vector3};
use plica_accurate::{
    Couple, Energy, Material, MaterialModel, NodalForces, Pressure, Projection, Solid, Tie, TieOptions, TieTarget,
    Traction, TurnGuard,
};
use plica_geometry::{Embedding, EmbeddingKind, HexMesh, NodeIdx, VertexIdx};

const SIZE: [f64; 3] = [0.02, 0.01, 0.01];
const CELL: f64 = 0.01;

/// Two distorted hexahedra.
fn mesh() -> HexMesh {
    let mut random = Random::new(1);
    common::moved(&distorted_block(SIZE, [2, 1, 1], 0.0, 0), |x| x + random.vector(0.15 * CELL))
}

/// Rest, and nodes scattered by a little and by much.
fn states(mesh: &HexMesh) -> Vec<Vec<Vector3<f64>>> {
    let mut random = Random::new(2);
    let rest = rest(mesh);
    [0.0, 0.02, 0.1, 0.15].map(|share| random.scatter(&rest, share * CELL)).to_vec()
}

#[test]
fn solids() {
    let mesh = mesh();
    for model in MODELS {
        for poisson_ratio in [-0.3, 0.0, 0.3, 0.49] {
            let solid = Solid::uniform(&mesh, material(model, 3e4, poisson_ratio)).unwrap();
            for (i, x) in states(&mesh).iter().enumerate() {
                check_derivatives(&format!("{model:?}, nu {poisson_ratio}, state {i}"), &solid, x, CELL);
            }
        }
    }
}

#[test]
fn stable_neo_hookean_solid_turned_over() {
    let mesh = mesh();
    let solid = Solid::uniform(&mesh, material(MaterialModel::StableNeoHookean, 3e4, 0.45)).unwrap();
    let mut random = Random::new(3);
    for state in 0..4 {
        let x = random.scatter(&rest(&mesh), 0.8 * CELL);
        check_derivatives(&format!("scattered solid, state {state}"), &solid, &x, CELL);
    }
    let mirrored: Vec<_> = rest(&mesh).iter().map(|x| Vector3::new(x.x, x.y, -x.z)).collect();
    assert!(solid.smallest_jacobian(&mirrored).unwrap() < 0.0);
    check_derivatives("mirrored solid", &solid, &mirrored, CELL);
}

#[test]
fn guards_against_turning_over() {
    let mesh = mesh();
    let solid = Solid::uniform(&mesh, material(MaterialModel::StableNeoHookean, 3e4, 0.45)).unwrap();
    let guard = TurnGuard { solid: &solid, floor: 0.4, stiffness_ratio: 10.0 };
    let mut random = Random::new(4);
    assert_eq!(guard.value(&rest(&mesh)), 0.0);
    for state in 0..4 {
        let x = random.scatter(&rest(&mesh), 0.8 * CELL);
        assert!(guard.value(&x) > 0.0);
        check_derivatives(&format!("guard, state {state}"), &guard, &x, CELL);
    }
}

#[test]
fn solid_of_two_materials() {
    let mesh = mesh();
    let both: [Material; 2] = [
        material(MaterialModel::CompressibleNeoHookean, 1e6, 0.3),
        material(MaterialModel::StableNeoHookean, 3e4, 0.48),
    ];
    let solid = Solid::new(&mesh, &both).unwrap();
    for x in states(&mesh) {
        check_derivatives("two materials", &solid, &x, CELL);
    }
}

#[test]
fn ties() {
    let mesh = mesh();
    let points = [Point3::new(0.004, 0.005, 0.008), Point3::new(0.011, 0.004, 0.004), Point3::new(0.016, 0.007, 0.006)];
    for kind in [EmbeddingKind::Trilinear, EmbeddingKind::default()] {
        let embedding = Embedding::new(&mesh, &points, kind).unwrap();
        let targets = [-1e-3, 3e-4, 8e-4].iter().enumerate().map(|(v, &gap_m)| TieTarget {
            vertex: VertexIdx::from_index(v),
            gap_m,
            area_m2: 4e-6,
            position: points[v].coords + Vector3::new(1e-3, -2e-3, 5e-4),
        });
        let tie = Tie::new(&embedding, &targets.collect::<Vec<_>>(), &TieOptions::for_modulus(3e4));
        for x in states(&mesh) {
            check_derivatives("tie", &tie, &x, CELL);
        }
    }
}

#[test]
fn loads() {
    let mesh = mesh();
    let quads = mesh.boundary_quads();
    let forces = vec![(NodeIdx(3), Vector3::new(1.0, 2.0, -3.0)), (NodeIdx(7), Vector3::new(0.0, -1.0, 0.5))];
    for x in states(&mesh) {
        check_derivatives("nodal forces", &NodalForces::new(forces.clone()), &x, CELL);
        check_derivatives("traction", &Traction::new(&mesh, &quads[..3], Vector3::new(10.0, -20.0, 5.0)), &x, CELL);
        check_derivatives("pressure on some faces", &Pressure::new(quads[..4].to_vec(), 100.0), &x, CELL);
        let couple = Couple::new(&mesh, &quads[..3], Vector3::new(1.0, -2.0, 3.0));
        check_derivatives("couple", &couple, &x, CELL);
        check_derivatives("pressure on all faces", &Pressure::new(quads.clone(), -50.0), &x, CELL);
    }
}

#[test]
fn projection_leaves_alone_what_is_positive() {
    let mesh = mesh();
    let stretched: Vec<_> = rest(&mesh).iter().map(|x| x.component_mul(&Vector3::new(1.2, 1.1, 1.15))).collect();
    for model in MODELS {
        let solid = Solid::uniform(&mesh, material(model, 3e4, 0.2)).unwrap();
        for x in [rest(&mesh), stretched.clone()] {
            let [exact, projected] =
                [Projection::Exact, Projection::PositiveSemidefinite].map(|p| hessian_of(&solid, &x, p));
            assert_eq!(exact, projected, "{model:?}");
        }
    }
}
