//! Newton steps in full, with stresses carried along in the tangent.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::random::Random;
use common::{MODELS, distance, distorted_block, material, rest, sides, solve};
use nalgebra::Vector3;
use plica_accurate::{Constraints, Energy, Hessian, MaterialModel, NodalForces, Params, Projection, Solid, Traction};
use plica_geometry::NodeIdx;
use plica_geometry::shapes::block;

const SIZE: [f64; 3] = [0.02, 0.01, 0.01];

/// The solid, its Hessian with given stresses in place of the exact one.
struct WithStresses<'a> {
    solid: &'a Solid,
    carried: Vec<f64>,
}

impl Energy for WithStresses<'_> {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.solid.visit_stencils(visit);
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        self.solid.value(x)
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        self.solid.add_gradient(x, gradient);
    }

    fn add_hessian(&self, x: &[Vector3<f64>], _: Projection, hessian: &mut Hessian) {
        self.solid.add_carried_hessian(x, &self.carried, hessian);
    }
}

#[test]
fn with_its_own_stresses_the_tangent_is_exact() {
    let mesh = distorted_block(SIZE, [2, 1, 1], 0.3, 5);
    let x = Random::new(1).scatter(&rest(&mesh), 1e-3);
    let v = Random::new(2).scatter(&vec![Vector3::zeros(); x.len()], 1.0);
    let free = Constraints::none(x.len());
    for model in MODELS {
        let solid = Solid::uniform(&mesh, material(model, 3e4, 0.45)).unwrap();
        let own = WithStresses { solid: &solid, carried: solid.carried_stresses(&x, &vec![Vector3::zeros(); x.len()]) };
        let product = |energy: &dyn Energy| Hessian::assemble(&[energy], &free, &x, Projection::Exact).multiply(&v);
        let (exact, found) = (product(&solid), product(&own));
        let size = exact.iter().map(Vector3::norm).fold(0.0, f64::max);
        assert!(distance(&exact, &found) <= 1e-12 * size, "{model:?}: {}", distance(&exact, &found));
    }
}

#[test]
fn carried_stresses_are_the_linear_part_of_those_after_a_step() {
    let mesh = distorted_block(SIZE, [2, 1, 1], 0.3, 5);
    let x = Random::new(1).scatter(&rest(&mesh), 1e-3);
    let v = Random::new(2).scatter(&vec![Vector3::zeros(); x.len()], 1e-3);
    let none = vec![Vector3::zeros(); x.len()];
    for model in [MaterialModel::CompressibleNeoHookean, MaterialModel::StableNeoHookean] {
        let solid = Solid::uniform(&mesh, material(model, 3e4, 0.45)).unwrap();
        let at = |share: f64| -> Vec<f64> {
            let moved: Vec<_> = x.iter().zip(&v).map(|(x, v)| x + v * share).collect();
            solid.carried_stresses(&moved, &none)
        };
        let (here, carried, step) = (at(0.0), solid.carried_stresses(&x, &v), 1e-4);
        let difference: Vec<f64> = at(step).iter().zip(at(-step)).map(|(a, b)| (a - b) / (2.0 * step)).collect();
        let size = difference.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        for ((carried, here), expected) in carried.iter().zip(&here).zip(&difference) {
            // Of the strain, S' leaves out dF^T dF / 2, and its derivative does not.
            assert!((carried - here - expected).abs() <= 1e-6 * size, "{model:?}: {} {expected}", carried - here);
        }
    }
}

/// A slender strip that a dead force F L^2 / (E I) = 1/2 at its end bends.
#[test]
fn full_steps_reach_the_same_equilibrium_sooner() {
    let size = [0.1, 0.002, 0.005];
    let mesh = block(size, [40, 1, 2]);
    let solid = Solid::uniform(&mesh, material(MaterialModel::CompressibleNeoHookean, 1e6, 0.3)).unwrap();
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| sides(x, size)[0][0]) {
        constraints.hold(node, &x.coords);
    }
    let is_at_end = |node: &NodeIdx| sides(&mesh.nodes()[node.index()], size)[0][1];
    let end: Vec<_> = mesh.boundary_quads().into_iter().filter(|quad| quad.iter().all(is_at_end)).collect();
    let inertia = size[1] * size[2].powi(3) / 12.0;
    let pull = Traction::new(&mesh, &end, Vector3::new(0.0, 0.0, 0.5 * 1e6 * inertia / (size[0] * size[0] * 1e-5)));
    let energies: [&dyn Energy; 2] = [&solid, &pull];
    let run = |max_full_steps: u32| {
        let mut x = rest(&mesh);
        let params = Params { max_full_steps, max_iterations: 400, ..Params::default() };
        let info = solve(&energies, &constraints, &params, &mut x).unwrap();
        (x, info.iterations)
    };
    let ((searched, slow), (full, fast)) = (run(0), run(25));
    println!("line search {slow} steps, full steps {fast}");
    assert!(distance(&searched, &full) <= 1e-6 * size[0], "{}", distance(&searched, &full));
    assert!(fast < slow, "{fast} and {slow}");
}

/// A column pressed beyond its Euler load with a small force sideways: full steps that end at a saddle are given up.
#[test]
fn full_steps_end_at_no_saddle_of_a_potential() {
    let size = [0.08, 0.02, 0.02];
    let mesh = block(size, [8, 2, 2]);
    let solid = Solid::uniform(&mesh, material(MaterialModel::StableNeoHookean, 3e4, 0.45)).unwrap();
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| sides(x, size)[0][0]) {
        constraints.hold(node, &x.coords);
    }
    let end = (0..mesh.n_nodes()).filter(|&n| sides(&mesh.nodes()[n], size)[0][1]).map(NodeIdx::from_index);
    let load = NodalForces::new(end.map(|node| (node, Vector3::new(-0.18, 0.0, 1e-5))).collect());
    let energies: [&dyn Energy; 2] = [&solid, &load];
    let mut x = rest(&mesh);
    let params = Params { max_full_steps: 25, ..Params::default() };
    solve(&energies, &constraints, &params, &mut x).unwrap();
    let mut solver = plica_accurate::Solver::new(&constraints, &energies).unwrap();
    assert_eq!(solver.n_negative(&energies, &constraints, &x), Some(0));
}
