//! Uniaxial, equibiaxial and shear tests of the fibre-reinforced material against closed forms, along and across the fibres.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{assert_close, distorted_block, is_on_boundary, material, rest, sides, solve};
use nalgebra::{Matrix3, Vector3};
use plica_accurate::{Constraints, Energy, Fibres, Lame, Material, MaterialModel, Params, Solid, reactions};
use plica_geometry::HexMesh;

const SIZE: [f64; 3] = [0.03, 0.02, 0.04];
/// Across and along the fibres of a meniscus \[Pa\].
const ACROSS: f64 = 20e6;
const ALONG: f64 = 140e6;

fn mesh() -> HexMesh {
    distorted_block(SIZE, [2, 2, 2], 0.3, 7)
}

/// Fibres along an axis.
fn meniscus(axis: usize, poisson_ratio: f64) -> Material {
    let direction = Vector3::from_fn(|k, _| if k == axis { 2.0 } else { 0.0 });
    let fibres = Fibres { young_modulus_pa: ALONG, direction };
    material(MaterialModel::FibreReinforced(fibres), ACROSS, poisson_ratio)
}

/// Principal nominal stress along `axis` for principal stretches `s`: matrix, and `k (s - 1)` along the fibres.
fn nominal_stress(material: &Material, fibre_axis: usize, s: [f64; 3], axis: usize) -> f64 {
    let Lame { lambda_pa, mu_pa } = material.lame();
    let (j, s_k) = (s[0] * s[1] * s[2], s[axis]);
    let matrix = mu_pa * (s_k - 1.0 / s_k) + lambda_pa / 2.0 * (j * j - 1.0) / s_k;
    let nu = material.poisson_ratio;
    let matrix_pa = ACROSS * (1.0 - nu * nu) / (1.0 - nu * nu * ACROSS / ALONG);
    if axis == fibre_axis { matrix + (ALONG - matrix_pa) * (s_k - 1.0) } else { matrix }
}

/// Stretches with those of `given` and no stress along the other axes, by Newton's method on differences.
fn free_stretches(material: &Material, fibre_axis: usize, given: [Option<f64>; 3]) -> [f64; 3] {
    let mut s = given.map(|stretch| stretch.unwrap_or(1.0));
    for _ in 0..200 {
        for axis in (0..3).filter(|&axis| given[axis].is_none()) {
            let stress = |value: f64| {
                let mut at = s;
                at[axis] = value;
                nominal_stress(material, fibre_axis, at, axis)
            };
            let slope = (stress(s[axis] + 1e-6) - stress(s[axis] - 1e-6)) / 2e-6;
            s[axis] -= stress(s[axis]) / slope;
        }
    }
    s
}

/// Stretches given along some axes, the least sides sliding: extents over those at rest, and forces on the greatest sides.
fn pull(material: Material, given: [Option<f64>; 3]) -> ([f64; 3], [f64; 3]) {
    let mesh = mesh();
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate() {
        for (axis, [least, greatest]) in sides(x, SIZE).into_iter().enumerate() {
            match given[axis] {
                Some(stretch) if greatest => constraints.give(node, axis, stretch * x[axis]),
                _ if least => constraints.give(node, axis, 0.0),
                _ => {}
            }
        }
    }
    let (x, forces) = equilibrium(&mesh, material, &constraints);
    let reached = [0, 1, 2].map(|axis| x.iter().map(|x| x[axis]).fold(0.0, f64::max) / SIZE[axis]);
    let on_end = |axis: usize| mesh.nodes().iter().zip(&forces).filter(move |(x, _)| sides(x, SIZE)[axis][1]);
    (reached, [0, 1, 2].map(|axis| on_end(axis).map(|(_, f)| f[axis]).sum()))
}

fn equilibrium(
    mesh: &HexMesh,
    material: Material,
    constraints: &Constraints,
) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let solid = Solid::uniform(mesh, material).unwrap();
    let mut x = rest(mesh);
    solve(&[&solid], constraints, &Params { tolerance: 1e-11, ..Params::default() }, &mut x).unwrap();
    let energies: [&dyn Energy; 1] = [&solid];
    let forces = reactions(&energies, &x);
    (x, forces)
}

fn check(fibre_axis: usize, given: [Option<f64>; 3]) {
    for poisson_ratio in [0.0, 0.3, 0.48] {
        let material = meniscus(fibre_axis, poisson_ratio);
        let expected = free_stretches(&material, fibre_axis, given);
        let (reached, forces) = pull(material, given);
        for axis in 0..3 {
            let name = format!("fibres along {fibre_axis}, {given:?}, nu {poisson_ratio}, axis {axis}");
            assert_close(reached[axis], expected[axis], 1e-9, &name);
            if given[axis].is_some() {
                let area = SIZE[0] * SIZE[1] * SIZE[2] / SIZE[axis];
                assert_close(forces[axis], nominal_stress(&material, fibre_axis, expected, axis) * area, 1e-8, &name);
            }
        }
    }
}

#[test]
fn uniaxial_along_and_across_the_fibres() {
    for stretch in [0.8, 0.95, 1.05, 1.3] {
        (0..3).for_each(|fibre_axis| check(fibre_axis, [None, None, Some(stretch)]));
    }
}

#[test]
fn equibiaxial_with_and_without_the_fibres() {
    for stretch in [0.9, 1.05, 1.3] {
        (0..3).for_each(|fibre_axis| check(fibre_axis, [Some(stretch), Some(stretch), None]));
    }
}

/// The moduli at small strain are those that were given: 20 MPa across and 140 MPa along.
#[test]
fn small_strain_has_the_given_moduli_along_and_across() {
    for poisson_ratio in [0.0, 0.3, 0.45] {
        for (fibre_axis, modulus) in [(0, ACROSS), (1, ACROSS), (2, ALONG)] {
            let (reached, forces) = pull(meniscus(fibre_axis, poisson_ratio), [None, None, Some(1.0 + 1e-6)]);
            assert_close(forces[2] / (SIZE[0] * SIZE[1]), modulus * 1e-6, 1e-5, "modulus");
            if fibre_axis == 2 {
                assert_close(1.0 - reached[0] + 1.0, 1.0 + poisson_ratio * 1e-6, 1e-10, "contraction");
            }
        }
    }
}

/// Simple shear `F = I + g e_x e_z^T`: fibres along x keep their length, those along z are stretched to `sqrt(1 + g^2)`.
#[test]
fn shear_along_and_across_the_fibres() {
    let mesh = mesh();
    for (fibre_axis, shear) in [0, 1, 2].into_iter().flat_map(|axis| [0.1, 0.5, 1.0].map(|shear| (axis, shear))) {
        let material = meniscus(fibre_axis, 0.3);
        let f = Matrix3::identity() + Matrix3::new(0.0, 0.0, shear, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let moved = common::affine(&mesh, &f, &Vector3::zeros());
        let mut constraints = Constraints::none(mesh.n_nodes());
        let on_boundary = |node: &usize| is_on_boundary(&mesh.nodes()[*node], SIZE);
        (0..mesh.n_nodes()).filter(on_boundary).for_each(|node| constraints.hold(node, &moved[node]));
        let (_, forces) = equilibrium(&mesh, material, &constraints);
        let work: f64 = mesh.nodes().iter().zip(&forces).map(|(x, f)| f.x * x.z).sum();
        let matrix_pa = ACROSS * (1.0 - 0.09) / (1.0 - 0.09 * ACROSS / ALONG);
        // Nominal stress of the fibre, k (s - 1), along its present direction (g, 0, 1)/s.
        let stretch = shear.hypot(1.0);
        let fibres = if fibre_axis == 2 { (ALONG - matrix_pa) * (stretch - 1.0) * shear / stretch } else { 0.0 };
        let expected = matrix_pa / 2.6 * shear + fibres;
        assert_close(work / (SIZE[0] * SIZE[1] * SIZE[2]), expected, 1e-9, &format!("fibres {fibre_axis}, {shear}"));
    }
}
