//! Bodies and helpers shared by the tests of the accurate solver.
#![allow(dead_code, unreachable_pub, reason = "every test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

pub mod derivatives;
pub mod manufactured;
pub mod random;
pub mod tets;

use std::ops::ControlFlow;

use nalgebra::{Matrix3, Point3, Vector3};
use plica_accurate::{Constraints, Energy, Fibres, Info, Material, MaterialModel, Params, SolveError, Solver};
use plica_geometry::HexMesh;
use plica_geometry::shapes::block;
use random::Random;

pub const EXPONENTIAL: MaterialModel = MaterialModel::Exponential { exponent: 2.0 };
/// Fibres five times as stiff as 3e4 Pa, at a slant.
pub const FIBRE_REINFORCED: MaterialModel =
    MaterialModel::FibreReinforced(Fibres { young_modulus_pa: 1.5e5, direction: Vector3::new(1.0, 2.0, -1.0) });
pub const ISOTROPIC: [MaterialModel; 4] =
    [MaterialModel::Linear, MaterialModel::CompressibleNeoHookean, MaterialModel::StableNeoHookean, EXPONENTIAL];
pub const MODELS: [MaterialModel; 5] = [
    MaterialModel::Linear,
    MaterialModel::CompressibleNeoHookean,
    MaterialModel::StableNeoHookean,
    EXPONENTIAL,
    FIBRE_REINFORCED,
];

pub fn material(model: MaterialModel, young_modulus_pa: f64, poisson_ratio: f64) -> Material {
    Material { model, young_modulus_pa, poisson_ratio }
}

pub fn rest(mesh: &HexMesh) -> Vec<Vector3<f64>> {
    mesh.nodes().iter().map(|x| x.coords).collect()
}

/// `A X + b` for every node.
pub fn affine(mesh: &HexMesh, a: &Matrix3<f64>, b: &Vector3<f64>) -> Vec<Vector3<f64>> {
    mesh.nodes().iter().map(|x| a * x.coords + b).collect()
}

/// Whether each coordinate lies on the least or the greatest side of a block of the given size.
pub fn sides(x: &Point3<f64>, size_m: [f64; 3]) -> [[bool; 2]; 3] {
    std::array::from_fn(|k| [x[k].abs() < 1e-9 * size_m[k], (x[k] - size_m[k]).abs() < 1e-9 * size_m[k]])
}

pub fn is_on_boundary(x: &Point3<f64>, size_m: [f64; 3]) -> bool {
    sides(x, size_m).as_flattened().contains(&true)
}

/// A block whose inner nodes are moved by up to `share` of a cell along each axis.
pub fn distorted_block(size_m: [f64; 3], divisions: [usize; 3], share: f64, seed: u64) -> HexMesh {
    let mut random = Random::new(seed);
    moved(&block(size_m, divisions), |x| {
        let cell = |k: usize| size_m[k] / divisions[k] as f64;
        let step = Vector3::from_fn(|k, _| share * cell(k) * random.within(1.0));
        if is_on_boundary(x, size_m) { *x } else { x + step }
    })
}

/// The mesh with its nodes moved.
pub fn moved(mesh: &HexMesh, mut place: impl FnMut(&Point3<f64>) -> Point3<f64>) -> HexMesh {
    HexMesh::new(mesh.nodes().iter().map(&mut place).collect(), mesh.hexes().to_vec()).unwrap()
}

pub fn solve(
    energies: &[&dyn Energy],
    constraints: &Constraints,
    params: &Params,
    x: &mut [Vector3<f64>],
) -> Result<Info, SolveError> {
    let mut solver = Solver::new(constraints, energies).unwrap();
    solver.minimise(energies, constraints, params, x, &mut |_| ControlFlow::Continue(()))
}

/// Largest distance between two sets of points \[m\].
pub fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

pub fn assert_close(found: f64, expected: f64, relative: f64, what: &str) {
    assert!((found - expected).abs() <= relative * expected.abs(), "{what}: {found} instead of {expected}");
}
