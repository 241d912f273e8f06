//! Manufactured solution: a smooth displacement, its body force, and errors against it.

use nalgebra::{Matrix3, Point3, Vector3};
use plica_accurate::{Constraints, Material, NodalForces, Params, Solid};
use plica_geometry::shapes::block;
use plica_geometry::tetrahedron::{quadratic_gradients, quadratic_shapes};
use plica_geometry::{HexIdx, HexMesh, NodeIdx, TetMesh, Tets, isoparametric};

use super::{is_on_boundary, moved, rest, solve, tets};

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

/// The same on `6 cells^3` tetrahedra of 10 nodes, whose edges are bent too.
pub fn errors_of_tetrahedra(material: Material, cells: usize) -> Errors {
    let mesh = tets::quadratic(&block([SIZE; 3], [cells; 3]), bent);
    let solid = tets::solid(&mesh, material);
    let exact: Vec<_> = mesh.nodes().iter().map(|x| x.coords + displacement(x)).collect();
    let constraints = tets::hold(&mesh, &exact, |x| is_on_boundary(x, [SIZE; 3]));
    let mut forces = Vec::new();
    for (nodes, x) in tetrahedra(&mesh) {
        for (xi, share) in collapsed_points() {
            let (at, jacobian) = tetrahedron_at(&x, xi);
            let force = force_density(&at, &material) * (share * jacobian.determinant());
            forces.extend(nodes.iter().zip(quadratic_shapes(xi)).map(|(node, n)| (*node, force * n)));
        }
    }
    let mut x = tets::rest(&mesh);
    solve(&[&solid, &NodalForces::new(forces)], &constraints, &Params::default(), &mut x).unwrap();
    let mut sums = Sums::default();
    for (nodes, rest) in tetrahedra(&mesh) {
        let u: Vec<_> = nodes.iter().zip(&rest).map(|(node, rest)| x[node.index()] - rest.coords).collect();
        for (xi, share) in collapsed_points() {
            let (at, jacobian) = tetrahedron_at(&rest, xi);
            let inverse = jacobian.try_inverse().unwrap();
            let found = u.iter().zip(quadratic_shapes(xi)).map(|(u, n)| u * n).sum();
            let by_xi = u.iter().zip(quadratic_gradients(xi)).map(|(u, g)| u * Vector3::from(g).transpose());
            let gradient = by_xi.sum::<Matrix3<f64>>() * inverse;
            sums.add(share * jacobian.determinant(), &at, &found, &gradient);
        }
    }
    sums.errors()
}

fn tetrahedra(mesh: &TetMesh) -> impl Iterator<Item = ([NodeIdx; 10], [Point3<f64>; 10])> + '_ {
    let Tets::Quadratic(tets) = mesh.tets() else { panic!("10 nodes each") };
    tets.iter().map(|nodes| (*nodes, nodes.map(|node| mesh.nodes()[node.index()])))
}

fn tetrahedron_at(x: &[Point3<f64>; 10], xi: [f64; 3]) -> (Point3<f64>, Matrix3<f64>) {
    let at: Vector3<f64> = x.iter().zip(quadratic_shapes(xi)).map(|(x, n)| x.coords * n).sum();
    let jacobian = x.iter().zip(quadratic_gradients(xi)).map(|(x, g)| x.coords * Vector3::from(g).transpose()).sum();
    (at.into(), jacobian)
}

/// 4 x 4 x 4 Gauss points of a cube collapsed to the reference simplex \[Duf82\], with their shares of its volume.
fn collapsed_points() -> impl Iterator<Item = ([f64; 3], f64)> {
    let (a, b) = (0.861_136_311_594_052_6, 0.339_981_043_584_856_3);
    let (v, w) = (0.347_854_845_137_453_85, 0.652_145_154_862_546_1);
    let line = [(-a, v), (-b, w), (b, w), (a, v)].map(|(x, weight)| (0.5 + 0.5 * x, 0.5 * weight));
    (0..64).map(move |q| {
        let [(r, a), (s, b), (t, c)] = [line[q % 4], line[q / 4 % 4], line[q / 16]];
        let xi = [r, s * (1.0 - r), t * (1.0 - r) * (1.0 - s)];
        (xi, a * b * c * (1.0 - r) * (1.0 - r) * (1.0 - s))
    })
}

/// A cube whose cells are bent smoothly.
fn mesh(cells: usize) -> HexMesh {
    moved(&block([SIZE; 3], [cells; 3]), bent)
}

fn bent(x: &Point3<f64>) -> Point3<f64> {
    let s = x.coords.map(|c| (2.0 * std::f64::consts::PI * c / SIZE).sin());
    x + Vector3::new(s.y * s.x, s.z * s.y, s.x * s.z) * (0.04 * SIZE)
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
    let mut sums = Sums::default();
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
            sums.add(weight, &at, &found, &found_gradient);
        }
    }
    sums.errors()
}

/// Integrals of squares.
#[derive(Default)]
struct Sums {
    miss: f64,
    size: f64,
    gradient_miss: f64,
    gradient_size: f64,
}

impl Sums {
    fn add(&mut self, weight: f64, at: &Point3<f64>, found: &Vector3<f64>, found_gradient: &Matrix3<f64>) {
        self.miss += weight * (found - displacement(at)).norm_squared();
        self.size += weight * displacement(at).norm_squared();
        self.gradient_miss += weight * (found_gradient - displacement_gradient(at)).norm_squared();
        self.gradient_size += weight * displacement_gradient(at).norm_squared();
    }

    fn errors(&self) -> Errors {
        Errors { l2: (self.miss / self.size).sqrt(), h1: (self.gradient_miss / self.gradient_size).sqrt() }
    }
}
