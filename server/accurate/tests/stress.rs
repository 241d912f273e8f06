//! Recovered stress of a thick-walled sphere under inner pressure against Lamé's solution: second order up to the surface.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::path::Path;

use common::{material, solve};
use nalgebra::{Matrix3, Point3, Vector3};
use plica_accurate::{Constraints, MaterialModel, Params, Pressure, Solid};
use plica_geometry::import::{ReadOptions, read_mesh};
use plica_geometry::shapes::block;
use plica_geometry::{Face, VolumeMesh};

const INNER_M: f64 = 0.01;
const OUTER_M: f64 = 0.02;
const PRESSURE_PA: f64 = 1.0;
const E: f64 = 1e6;

/// Radial and hoop stress, and radial displacement \[TG70, art. 136\].
struct Lame {
    radial_pa: f64,
    hoop_pa: f64,
    displacement_m: f64,
}

fn lame(r: f64, nu: f64) -> Lame {
    let (a, b) = (INNER_M.powi(3), OUTER_M.powi(3));
    let scale = PRESSURE_PA * a / (b - a);
    Lame {
        radial_pa: scale * (1.0 - b / r.powi(3)),
        hoop_pa: scale * (1.0 + b / (2.0 * r.powi(3))),
        displacement_m: scale * r / E * ((1.0 - 2.0 * nu) + (1.0 + nu) * b / (2.0 * r.powi(3))),
    }
}

/// An eighth of the sphere, held by its planes of symmetry.
struct Ball {
    mesh: VolumeMesh,
    x: Vec<Vector3<f64>>,
    solid: Solid,
}

impl Ball {
    fn new(mesh: VolumeMesh, nu: f64) -> Self {
        let solid = Solid::of_volume(&mesh, &vec![material(MaterialModel::Linear, E, nu); mesh.n_elements()]).unwrap();
        let mut constraints = Constraints::none(mesh.n_nodes());
        for (node, x) in mesh.nodes().iter().enumerate() {
            (0..3).filter(|&k| x[k].abs() < 1e-9).for_each(|k| constraints.give(node, k, x[k]));
        }
        let is_inner = |face: &Face| {
            face.nodes().iter().all(|n| (mesh.nodes()[n.index()].coords.norm() - INNER_M).abs() < 1e-3 * INNER_M)
        };
        let inner: Vec<Face> = mesh.boundary_faces().into_iter().filter(is_inner).collect();
        let load = Pressure::new(inner, PRESSURE_PA);
        let mut x: Vec<_> = mesh.nodes().iter().map(|x| x.coords).collect();
        solve(&[&solid, &load], &constraints, &Params::default(), &mut x).unwrap();
        Self { mesh, x, solid }
    }

    /// Largest error of radial and hoop stress over the largest stress at a radius, recovered and of the element alone.
    fn stress_errors(&self, r: f64, nu: f64) -> [f64; 2] {
        let exact = lame(r, nu);
        let mut errors = [0.0_f64; 2];
        for direction in [Vector3::new(1.0, 0.6, 0.3), Vector3::new(0.2, 0.5, 0.9), Vector3::new(1.0, 1.0, 1.0)] {
            let n = direction.normalize();
            let point = self.mesh.locate(&Point3::from(n * r), 0.2 * INNER_M).unwrap();
            let across = Matrix3::identity() - n * n.transpose();
            let stresses = [
                self.solid.recovered_stress(&self.x, point.element, point.xi),
                self.solid.cauchy_stress(&self.x, point.element, point.xi),
            ];
            for (error, stress) in errors.iter_mut().zip(stresses) {
                let radial = (n.dot(&(stress * n)) - exact.radial_pa).abs();
                let hoop = ((stress * across).trace() / 2.0 - exact.hoop_pa).abs();
                *error = error.max(radial.max(hoop) / PRESSURE_PA);
            }
        }
        errors
    }

    /// Largest error of the displacement of the inner surface, over that displacement.
    fn displacement_error(&self, nu: f64) -> f64 {
        let inner = self.mesh.nodes().iter().zip(&self.x).filter(|(rest, _)| rest.coords.norm() < 1.0001 * INNER_M);
        let exact = lame(INNER_M, nu).displacement_m;
        inner.map(|(rest, x)| ((x - rest.coords).norm() / exact - 1.0).abs()).fold(0.0, f64::max)
    }
}

/// Three blocks of `n x n` hexahedra over the sphere and `through` its wall, around the axes, joined along the planes between them.
fn hexahedra(n: usize, through: usize) -> VolumeMesh {
    let unit = block([1.0; 3], [n, n, through]);
    let mut nodes: Vec<Point3<f64>> = Vec::new();
    let mut hexes = Vec::new();
    for axis in 0..3 {
        let place = |p: &Point3<f64>| {
            // Of the face of a cube towards `axis`, the quarter between the axes: its corners are an axis, two middles, the diagonal.
            let (u, v) = (p.x, p.y);
            let on_cube = |s: f64| (s * std::f64::consts::FRAC_PI_4).tan();
            let mut direction = Vector3::zeros();
            direction[axis] = 1.0;
            direction[(axis + 1) % 3] = on_cube(u);
            direction[(axis + 2) % 3] = on_cube(v);
            Point3::from(direction.normalize() * (INNER_M + (OUTER_M - INNER_M) * p.z))
        };
        let numbers: Vec<_> = unit
            .nodes()
            .iter()
            .map(|p| {
                let x = place(p);
                let known = nodes.iter().position(|other| (other - x).norm() < 1e-9);
                let number = known.unwrap_or_else(|| {
                    nodes.push(x);
                    nodes.len() - 1
                });
                plica_geometry::NodeIdx::from_index(number)
            })
            .collect();
        hexes.extend(unit.hexes().iter().map(|hex| hex.map(|node| numbers[node.index()])));
    }
    plica_geometry::HexMesh::new(nodes, hexes).unwrap().into()
}

#[test]
fn recovered_stress_is_of_second_order_up_to_the_surface() {
    for nu in [0.3, 0.49] {
        for (name, r) in [("inner", INNER_M), ("middle", 1.4 * INNER_M), ("outer", OUTER_M)] {
            let errors = [4, 8, 16].map(|n| Ball::new(hexahedra(n / 2, n), nu).stress_errors(r, nu));
            let order = (errors[0][0] / errors[2][0]).log2() / 2.0;
            let percent = errors.map(|pair| pair.map(|error| 100.0 * error));
            println!(
                "nu {nu}, {name}: 4, 8, 16 through the wall: recovered {:.2}, {:.2}, {:.2} %, of the element {:.2}, {:.2}, {:.2} %, \
                 order {order:.2}",
                percent[0][0], percent[1][0], percent[2][0], percent[0][1], percent[1][1], percent[2][1]
            );
            assert!(order > 1.75, "{name}: {errors:?}");
            assert!(errors[2][0] < 0.03, "{name}: {errors:?}");
        }
    }
}

#[test]
fn a_thick_sphere_of_gmshs_tetrahedra_is_lames() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/cases/thick-sphere.msh");
    let mesh = read_mesh(&file, ReadOptions::unit(1e-3)).unwrap().mesh;
    for nu in [0.3, 0.49] {
        let ball = Ball::new(mesh.clone(), nu);
        let displacement = ball.displacement_error(nu);
        let errors = [INNER_M, 1.4 * INNER_M, OUTER_M].map(|r| ball.stress_errors(r, nu)[0]);
        println!(
            "{} tetrahedra, nu {nu}: inner displacement within {:.2} %, stress at the inner, middle, outer surface {:.2?} % of p",
            mesh.n_elements(),
            100.0 * displacement,
            errors.map(|error| 100.0 * error)
        );
        assert!(displacement < 5e-3, "{displacement}");
    }
}
