//! Signs of the tangent at an equilibrium: a column under its own Euler load.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::ops::ControlFlow;

use common::{material, rest, sides};
use nalgebra::{DMatrix, Vector3};
use plica_accurate::{Constraints, Energy, Hessian, MaterialModel, NodalForces, Params, Projection, Solid, Solver};
use plica_geometry::shapes::block;
use plica_geometry::{HexMesh, NodeIdx};

const SIZE: [f64; 3] = [0.02, 0.01, 0.1];

/// A column along z that stands on z = 0, pressed by a share of `pi^2 E I / (4 L^2)` about its weaker axis.
struct Column {
    mesh: HexMesh,
    solid: Solid,
    constraints: Constraints,
}

impl Column {
    fn new() -> Self {
        let mesh = block(SIZE, [2, 2, 16]);
        let solid = Solid::uniform(&mesh, material(MaterialModel::CompressibleNeoHookean, 1e6, 0.0)).unwrap();
        let mut constraints = Constraints::none(mesh.n_nodes());
        for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| sides(x, SIZE)[2][0]) {
            constraints.hold(node, &x.coords);
        }
        Self { mesh, solid, constraints }
    }

    fn load(&self, share: f64) -> NodalForces {
        let inertia = SIZE[0] * SIZE[1].powi(3) / 12.0;
        let euler = std::f64::consts::PI.powi(2) * 1e6 * inertia / (4.0 * SIZE[2] * SIZE[2]);
        let top: Vec<_> = (0..self.mesh.n_nodes()).filter(|&n| sides(&self.mesh.nodes()[n], SIZE)[2][1]).collect();
        let force = Vector3::new(0.0, 0.0, -share * euler / top.len() as f64);
        NodalForces::new(top.into_iter().map(|node| (NodeIdx::from_index(node), force)).collect())
    }

    /// The straight state under a share of the load, with its number of negative directions.
    fn straight(&self, share: f64) -> (Solver, NodalForces, Vec<Vector3<f64>>) {
        let load = self.load(share);
        let energies: [&dyn Energy; 2] = [&self.solid, &load];
        let mut solver = Solver::new(&self.constraints, &energies).unwrap();
        let mut x = rest(&self.mesh);
        let go = &mut |_| ControlFlow::Continue(());
        solver.minimise(&energies, &self.constraints, &Params::default(), &mut x, go).unwrap();
        (solver, load, x)
    }

    /// Eigenvalues of the tangent on free coordinates.
    fn eigenvalues(&self, load: &NodalForces, x: &[Vector3<f64>]) -> Vec<f64> {
        let energies: [&dyn Energy; 2] = [&self.solid, load];
        let hessian = Hessian::assemble(&energies, &self.constraints, x, Projection::Exact);
        let free: Vec<_> = (0..3 * x.len()).filter(|&i| !self.constraints.is_given(i / 3)[i % 3]).collect();
        let columns: Vec<_> = free
            .iter()
            .map(|&i| {
                let mut v = vec![Vector3::zeros(); x.len()];
                v[i / 3][i % 3] = 1.0;
                let product = hessian.multiply(&v);
                nalgebra::DVector::from_iterator(free.len(), free.iter().map(|&j| product[j / 3][j % 3]))
            })
            .collect();
        DMatrix::from_columns(&columns).symmetric_eigenvalues().iter().copied().collect()
    }
}

/// About the weak axis 1 and 9 times the Euler load are critical, about the strong one 4 times.
#[test]
fn negative_directions_are_those_of_all_eigenvalues() {
    let column = Column::new();
    let mut seen = Vec::new();
    for share in [0.5, 2.0, 6.0, 14.0] {
        let (mut solver, load, x) = column.straight(share);
        let energies: [&dyn Energy; 2] = [&column.solid, &load];
        let found = solver.n_negative(&energies, &column.constraints, &x).unwrap();
        let all = column.eigenvalues(&load, &x);
        assert_eq!(found, all.iter().filter(|value| **value < 0.0).count(), "share {share}");
        let mode = solver.softest_mode(&energies, &column.constraints, &x).unwrap();
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((mode.curvature - least).abs() <= 1e-6 * least.abs(), "{} beside {least}", mode.curvature);
        seen.push(found);
    }
    println!("negative directions at 0.5, 2, 6, 14 times the Euler load: {seen:?}");
    assert_eq!(seen[0], 0);
    assert!(seen[1] == 1 && seen[2] > 1 && seen[3] > seen[2], "{seen:?}");
}

/// A column under twice its Euler load bends when it is pushed along its softest mode, across its weak axis.
#[test]
fn the_softest_mode_leads_away_from_the_straight_column() {
    let column = Column::new();
    let (mut solver, load, mut x) = column.straight(2.0);
    let energies: [&dyn Energy; 2] = [&column.solid, &load];
    let mode = solver.softest_mode(&energies, &column.constraints, &x).unwrap();
    let top = mode.shape.iter().map(|v| v.y.abs()).fold(0.0, f64::max);
    assert!(mode.curvature < 0.0 && top > 0.99, "{} {top}", mode.curvature);
    x.iter_mut().zip(&mode.shape).for_each(|(x, v)| *x += v * 1e-3);
    let go = &mut |_| ControlFlow::Continue(());
    solver.minimise(&energies, &column.constraints, &Params::default(), &mut x, go).unwrap();
    assert_eq!(solver.n_negative(&energies, &column.constraints, &x), Some(0));
    let sideways = x.iter().zip(column.mesh.nodes()).map(|(x, rest)| (x.y - rest.y).abs()).fold(0.0, f64::max);
    assert!(sideways > 0.5 * SIZE[2], "{sideways}");
}
