//! Manufactured solution: a smooth displacement, its body force, and errors against it.

use nalgebra::{Matrix3, Point3, Vector3};
use plica_accurate::{Constraints, Material, NodalForces, Params, Solid};
use plica_geometry::shapes::block;
use plica_geometry::{HexIdx, HexMesh, isoparametric};

use super::{is_on_boundary, moved, rest, solve};

/// Edge of the cube \[m\].
const SIZE: f64 = 0.1;
/// Amplitude of the displacement gradient.
const AMPLITUDE: f64 = 0.1;

/// Errors of the displacement and of its gradient, as shares of their norms.
#[derive(Debug, Clone, Copy)]
pub struct Errors {
    pub l2: f64,
    pub h1: f64,
}

/// Solves on `cells^3` hexahedra with the exact displacement on the boundary.
pub fn errors(material: Material, cells: usize) -> Errors {
    let mesh = mesh(cells);
    let solid = Solid::uniform(&mesh, material).unwrap();
    let load = body_force(&mesh, &material);
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| is_on_boundary(x, [SIZE; 3])) {
        constraints.hold(node, &(x.coords + displacement(x)));
    }
    let mut x = rest(&mesh);
    solve(&[&solid, &load], &constraints, &Params::default(), &mut x).unwrap();
    measure(&mesh, &x)
}

/// A cube whose cells are bent smoothly.
fn mesh(cells: usize) -> HexMesh {
    moved(&block([SIZE; 3], [cells; 3]), |x| {
        let s = x.coords.map(|c| (2.0 * std::f64::consts::PI * c / SIZE).sin());
        x + Vector3::new(s.y * s.x, s.z * s.y, s.x * s.z) * (0.04 * SIZE)
    })
}

fn displacement(x: &Point3<f64>) -> Vector3<f64> {
    let [x, y, z] = [x.x, x.y, x.z].map(|c| c / SIZE);
    Vector3::new((2.0 * y + z).sin() + 0.5 * x * x, (x + 2.0 * z).cos(), x * y + z * z) * (AMPLITUDE * SIZE)
}

fn displacement_gradient(x: &Point3<f64>) -> Matrix3<f64> {
    let [x, y, z] = [x.x, x.y, x.z].map(|c| c / SIZE);
    let (c, s) = ((2.0 * y + z).cos(), (x + 2.0 * z).sin());
    Matrix3::new(x, 2.0 * c, c, -s, 0.0, -2.0 * s, y, x, 2.0 * z) * AMPLITUDE
}

/// `-Div P`, by differences of fourth order.
fn force_density(x: &Point3<f64>, material: &Material) -> Vector3<f64> {
    let h = 1e-3 * SIZE;
    let stress = |axis: usize, steps: f64| {
        let mut at = *x;
        at[axis] += steps * h;
        material.first_piola_stress(&(Matrix3::identity() + displacement_gradient(&at))).column(axis).into_owned()
    };
    let along = |axis| (stress(axis, 1.0) - stress(axis, -1.0)) * 8.0 - (stress(axis, 2.0) - stress(axis, -2.0));
    -(along(0) + along(1) + along(2)) / (12.0 * h)
}

fn body_force(mesh: &HexMesh, material: &Material) -> NodalForces {
    let mut forces = Vec::new();
    for hex in mesh.hex_indices() {
        let corners = mesh.corner_positions(hex);
        for (xi, weight) in quadrature(mesh, hex) {
            let force = force_density(&isoparametric::map(&corners, xi), material) * weight;
            let shares = isoparametric::shape_functions(xi);
            forces.extend(mesh.hexes()[hex.index()].into_iter().zip(shares).map(|(node, n)| (node, force * n)));
        }
    }
    NodalForces::new(forces)
}

/// 3 x 3 x 3 Gauss points with their volumes.
fn quadrature(mesh: &HexMesh, hex: HexIdx) -> impl Iterator<Item = ([f64; 3], f64)> {
    let corners = mesh.corner_positions(hex);
    let line = [(-0.6_f64.sqrt(), 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.6_f64.sqrt(), 5.0 / 9.0)];
    (0..27).map(move |q| {
        let [(x, a), (y, b), (z, c)] = [line[q % 3], line[q / 3 % 3], line[q / 9]];
        ([x, y, z], a * b * c * isoparametric::jacobian(&corners, [x, y, z]).determinant())
    })
}

fn measure(mesh: &HexMesh, x: &[Vector3<f64>]) -> Errors {
    let [mut miss, mut size, mut gradient_miss, mut gradient_size] = [0.0; 4];
    for hex in mesh.hex_indices() {
        let corners = mesh.corner_positions(hex);
        let u = mesh.hexes()[hex.index()].map(|n| x[n.index()] - mesh.nodes()[n.index()].coords);
        for (xi, weight) in quadrature(mesh, hex) {
            let at = isoparametric::map(&corners, xi);
            let inverse = isoparametric::jacobian(&corners, xi).try_inverse().unwrap();
            let (shares, gradients) = (isoparametric::shape_functions(xi), isoparametric::shape_gradients(xi));
            let found: Vector3<f64> = u.iter().zip(shares).map(|(u, n)| u * n).sum();
            let found_gradient: Matrix3<f64> =
                u.iter().zip(gradients).map(|(u, g)| u * Vector3::from(g).transpose() * inverse).sum();
            miss += weight * (found - displacement(&at)).norm_squared();
            size += weight * displacement(&at).norm_squared();
            gradient_miss += weight * (found_gradient - displacement_gradient(&at)).norm_squared();
            gradient_size += weight * displacement_gradient(&at).norm_squared();
        }
    }
    Errors { l2: (miss / size).sqrt(), h1: (gradient_miss / gradient_size).sqrt() }
}
