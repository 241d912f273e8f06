//! A slender beam with one element across: bending of each kind of hexahedron.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{E, material};
use nalgebra::{DMatrix, DVector};
use plica_geometry::shapes::block;
use plica_sim::{ElementKind, rest_stiffness};

const N_CELLS: usize = 8;
const CELL_M: f64 = 0.01;

/// Deflection of the tip, mean of its four nodes, under 1 N shared by them [m]; the other end is clamped.
fn tip_deflection(poisson_ratio: f64, kind: ElementKind) -> f64 {
    let mesh = block([N_CELLS as f64 * CELL_M, CELL_M, CELL_M], [N_CELLS, 1, 1]);
    let n = 3 * mesh.n_nodes();
    let mut stiffness = DMatrix::<f64>::zeros(n, n);
    for hex in mesh.hexes() {
        let k = rest_stiffness(&hex.map(|n| mesh.nodes()[n.index()]), &material(E, poisson_ratio), kind);
        let dof = |i: usize| 3 * hex[i / 3].index() + i % 3;
        for (i, j) in (0..24).flat_map(|i| (0..24).map(move |j| (i, j))) {
            stiffness[(dof(i), dof(j))] += k[(i, j)];
        }
    }
    let at = |x: f64| -> Vec<usize> { (0..mesh.n_nodes()).filter(|&i| (mesh.nodes()[i].x - x).abs() < 1e-9).collect() };
    let (clamped, tip) = (at(0.0), at(N_CELLS as f64 * CELL_M));
    for dof in clamped.iter().flat_map(|node| (0..3).map(move |k| 3 * node + k)) {
        stiffness.row_mut(dof).fill(0.0);
        stiffness.column_mut(dof).fill(0.0);
        stiffness[(dof, dof)] = 1.0;
    }
    let mut load = DVector::zeros(n);
    tip.iter().for_each(|node| load[3 * node + 2] = 1.0 / tip.len() as f64);
    let u = stiffness.cholesky().unwrap().solve(&load);
    tip.iter().map(|node| u[3 * node + 2]).sum::<f64>() / tip.len() as f64
}

/// Timoshenko's beam of a square section under 1 N [m]: `L^3 / (3 E I) + L / (kappa G A)`, with the shear coefficient
/// `kappa = 10 (1 + nu) / (12 + 11 nu)` [Cowper66]. (Shear is 1 % of it: 5/6 instead changes the ratios by .001.)
fn timoshenko(nu: f64) -> f64 {
    let (length, area, inertia) = (N_CELLS as f64 * CELL_M, CELL_M.powi(2), CELL_M.powi(4) / 12.0);
    let (kappa, shear_modulus) = (10.0 * (1.0 + nu) / (12.0 + 11.0 * nu), E / (2.0 * (1.0 + nu)));
    length.powi(3) / (3.0 * E * inertia) + length / (kappa * shear_modulus * area)
}

#[test]
fn tip_deflects_as_much_as_the_element_lets_it() {
    let expected = [
        (ElementKind::FullIntegration, 0.3, 0.641),
        (ElementKind::FullIntegration, 0.49, 0.386),
        (ElementKind::EnhancedStrain, 0.3, 0.981),
        (ElementKind::EnhancedStrain, 0.49, 0.905),
    ];
    for (kind, nu, ratio) in expected {
        let found = tip_deflection(nu, kind) / timoshenko(nu);
        println!("{kind:?}, nu {nu}: {found:.4} of Timoshenko's deflection, expected {ratio}");
        assert!((found / ratio - 1.0).abs() < 0.02, "{kind:?}, nu {nu}: {found}, expected {ratio}");
    }
}
