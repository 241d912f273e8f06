//! Tetrahedra in the harnesses of the hexahedra: derivatives, invariances, patch test, order, locking.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::derivatives::{check_derivatives, gradient_of};
use common::manufactured::errors_of_tetrahedra;
use common::random::Random;
use common::{MODELS, assert_close, distance, distorted_block, is_on_boundary, material, solve, tets};
use nalgebra::{Matrix3, Point3, Rotation3, Unit, Vector3};
use plica_accurate::{Constraints, Energy, MaterialModel, Params, Pressure, Solid, Traction};
use plica_geometry::shapes::block;
use plica_geometry::{ElementIdx, Face, TetMesh};

const SIZE: [f64; 3] = [0.06, 0.04, 0.05];
const E: f64 = 3e4;

/// Distorted tetrahedra of 4 nodes, and of 10 with plane faces and with bent ones.
fn meshes(divisions: [usize; 3]) -> Vec<(&'static str, TetMesh)> {
    let hexes = distorted_block(SIZE, divisions, 0.2, 4);
    let bend = |x: &Point3<f64>| {
        let s = [0, 1, 2].map(|k| (std::f64::consts::PI * x[k] / SIZE[k]).sin());
        x + Vector3::new(1.0, -0.5, 0.8) * (0.006 * s[0] * s[1] * s[2])
    };
    vec![
        ("4 nodes", tets::linear(&hexes)),
        ("10 nodes", tets::quadratic(&hexes, |x| *x)),
        ("10 nodes, bent", tets::quadratic(&hexes, bend)),
    ]
}

fn affine(mesh: &TetMesh, a: &Matrix3<f64>, b: &Vector3<f64>) -> Vec<Vector3<f64>> {
    mesh.nodes().iter().map(|x| a * x.coords + b).collect()
}

/// A force that 1 % of strain would give \[N\].
fn force_scale() -> f64 {
    0.01 * E * SIZE[0] * SIZE[1] / 9.0
}

#[test]
fn derivatives() {
    let mut random = Random::new(31);
    for (name, mesh) in meshes([1, 1, 1]) {
        for model in MODELS {
            for poisson_ratio in [-0.3, 0.3, 0.49] {
                let solid = tets::solid(&mesh, material(model, E, poisson_ratio));
                for share in [0.0, 0.02, 0.08] {
                    let x = random.scatter(&tets::rest(&mesh), share * SIZE[1] / 2.0);
                    check_derivatives(&format!("{name}, {model:?}, nu {poisson_ratio}, {share}"), &solid, &x, 0.02);
                }
            }
        }
        let faces = mesh.boundary_faces();
        let x = random.scatter(&tets::rest(&mesh), 0.002);
        check_derivatives(name, &Pressure::new(faces[..4].to_vec(), 100.0), &x, 0.02);
        check_derivatives(name, &Traction::on_faces(mesh.nodes(), &faces, Vector3::new(1.0, 2.0, 3.0)), &x, 0.02);
    }
}

#[test]
fn no_force_at_rest_or_after_a_rigid_motion() {
    for (name, mesh) in meshes([2, 2, 2]) {
        for (model, angle) in MODELS.into_iter().zip([0.0, 2.5, 2.5, 2.5, 2.5]) {
            let solid = tets::solid(&mesh, material(model, E, 0.48));
            let rest = tets::rest(&mesh);
            assert!(gradient_of(&solid, &rest).amax() <= 1e-12 * force_scale(), "{name}, {model:?}");
            assert!(solid.value(&rest).abs() <= 1e-25, "{name}, {model:?}");
            let turn = *Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(1.0, 2.0, -1.0)), angle).matrix();
            let forces = gradient_of(&solid, &affine(&mesh, &turn, &Vector3::new(0.3, -0.2, 0.1)));
            assert!(forces.amax() <= 1e-9 * force_scale(), "{name}, {model:?}: {}", forces.amax());
        }
    }
}

#[test]
fn forces_and_their_moments_sum_to_nothing() {
    let mut random = Random::new(5);
    for (name, mesh) in meshes([2, 2, 2]) {
        for model in MODELS.into_iter().filter(|model| *model != MaterialModel::Linear) {
            let solid = tets::solid(&mesh, material(model, E, 0.45));
            let x = random.scatter(&tets::rest(&mesh), 1e-3);
            let mut forces = vec![Vector3::zeros(); x.len()];
            solid.add_gradient(&x, &mut forces);
            let largest = forces.iter().map(Vector3::norm).fold(0.0, f64::max);
            let force: Vector3<f64> = forces.iter().sum();
            let moment: Vector3<f64> = x.iter().zip(&forces).map(|(x, f)| x.cross(f)).sum();
            assert!(force.norm() <= 1e-12 * largest && moment.norm() <= 1e-13 * largest, "{name}, {model:?}");
        }
    }
}

/// Boundary nodes are moved by an affine map; the inner ones follow, and all points have the stress of the material.
#[test]
fn patch_test() {
    let mut random = Random::new(6);
    for (name, mesh) in meshes([2, 2, 2]) {
        for model in MODELS {
            for poisson_ratio in [0.0, 0.3, 0.499] {
                let material = material(model, E, poisson_ratio);
                let solid = tets::solid(&mesh, material);
                let f = Matrix3::identity() + random.matrix(0.12);
                let expected = affine(&mesh, &f, &random.vector(0.05));
                let constraints = tets::hold(&mesh, &expected, |x| is_on_boundary(x, SIZE));
                let mut x = tets::rest(&mesh);
                let params = Params { tolerance: 1e-12, ..Params::default() };
                solve(&[&solid], &constraints, &params, &mut x).unwrap();
                let miss = distance(&x, &expected) / SIZE[0];
                println!("patch test, {name}, {model:?}, nu {poisson_ratio}: off by {miss:.1e} of the size");
                assert!(miss <= 1e-11, "{name}, {model:?}, nu {poisson_ratio}: {miss:e}");
                let piola = material.first_piola_stress(&f);
                let expected =
                    if model == MaterialModel::Linear { piola } else { piola * f.transpose() / f.determinant() };
                for xi in [[0.25; 3], [0.1, 0.2, 0.6]] {
                    let stress = solid.cauchy_stress(&x, ElementIdx(3), xi);
                    assert!((stress - expected).norm() <= 1e-7 * expected.norm(), "{name}, {model:?}");
                    let recovered = solid.recovered_stress(&x, ElementIdx(3), xi);
                    assert!((recovered - expected).norm() <= 1e-7 * expected.norm(), "{name}, {model:?}");
                }
            }
        }
    }
}

#[test]
fn volume_area_and_traction_are_those_of_the_body() {
    for (name, mesh) in meshes([2, 2, 2]) {
        let solid = tets::solid(&mesh, material(MaterialModel::Linear, E, 0.3));
        let volume = SIZE[0] * SIZE[1] * SIZE[2];
        if !name.ends_with("bent") {
            assert_close(solid.volume(&tets::rest(&mesh)), volume, 1e-13, name);
        }
        let is_on_top = |face: &Face| face.nodes().iter().all(|n| (mesh.nodes()[n.index()].z - SIZE[2]).abs() < 1e-12);
        let top: Vec<_> = mesh.boundary_faces().into_iter().filter(is_on_top).collect();
        let load = Traction::on_faces(mesh.nodes(), &top, Vector3::new(0.0, 5.0, -20.0));
        let expected = Vector3::new(0.0, 5.0, -20.0) * SIZE[0] * SIZE[1];
        assert!((load.total() - expected).norm() <= 1e-13 * expected.norm(), "{name}");
        let area: f64 = mesh.boundary_faces().iter().map(|face| plica_accurate::face_area(mesh.nodes(), face)).sum();
        let whole = 2.0 * (SIZE[0] * SIZE[1] + SIZE[1] * SIZE[2] + SIZE[2] * SIZE[0]);
        assert_close(area, whole, 1e-12, name);
    }
}

/// Order 3 for displacements and 2 for their gradients at nu = 0.3; at 0.499, with most of `U` at the mean dilatation, order 2.
#[test]
fn ten_nodes_converge_with_the_third_order() {
    for (model, poisson_ratio) in [
        (MaterialModel::CompressibleNeoHookean, 0.3),
        (MaterialModel::StableNeoHookean, 0.3),
        (MaterialModel::Linear, 0.3),
        (MaterialModel::Linear, 0.499),
    ] {
        // One Newton step affords a finer mesh.
        let cells = if model == MaterialModel::Linear && poisson_ratio == 0.3 { [3, 6, 12] } else { [2, 4, 8] };
        let found = cells.map(|cells| errors_of_tetrahedra(material(model, E, poisson_ratio), cells));
        let order = |error: &dyn Fn(usize) -> f64| (error(1) / error(2)).log2();
        let (l2, h1) = (order(&|i| found[i].l2), order(&|i| found[i].h1));
        println!("{model:?}, nu {poisson_ratio}: errors {found:?}, last orders {l2:.3} and {h1:.3}");
        if poisson_ratio == 0.3 {
            assert!((l2 - 3.0).abs() <= 0.1 && (h1 - 2.0).abs() <= 0.2, "{model:?}: {l2}, {h1}");
        } else {
            assert!(l2 > 1.7, "{model:?}: {l2}");
        }
    }
}

/// Rise of the top corner of Cook's membrane \[mm\], plane strain, linear, of solids made by `solid` from `n x n` cells.
fn cook(nodes: &[Point3<f64>], solid: &Solid, faces: &[Face]) -> f64 {
    let mut constraints = Constraints::none(nodes.len());
    for (node, x) in nodes.iter().enumerate() {
        constraints.give(node, 2, x.z);
        if x.x == 0.0 {
            constraints.hold(node, &x.coords);
        }
    }
    let is_right = |face: &&Face| face.nodes().iter().all(|node| nodes[node.index()].x > 48.0 - 1e-9);
    let right: Vec<Face> = faces.iter().filter(is_right).copied().collect();
    let load = Traction::on_faces(nodes, &right, Vector3::new(0.0, 6.25, 0.0));
    let mut x: Vec<_> = nodes.iter().map(|x| x.coords).collect();
    solve(&[solid, &load], &constraints, &Params::default(), &mut x).unwrap();
    let corner = |node: &usize| (nodes[*node] - Point3::new(48.0, 60.0, 0.0)).norm();
    let node = (0..nodes.len()).min_by(|a, b| corner(a).total_cmp(&corner(b))).unwrap();
    x[node].y - nodes[node].y
}

fn membrane(p: &Point3<f64>, thickness: f64) -> Point3<f64> {
    Point3::new(48.0 * p.x, 44.0 * p.x * (1.0 - p.y) + (44.0 + 16.0 * p.x) * p.y, thickness * p.z)
}

#[test]
fn cooks_membrane_of_ten_nodes_is_that_of_hexahedra() {
    for poisson_ratio in [1.0 / 3.0, 0.499] {
        let material = material(MaterialModel::Linear, 70.0, poisson_ratio);
        let of_hexes = |n: usize| {
            let mesh = common::moved(&block([1.0; 3], [n, n, 1]), |p| membrane(p, 40.0 / n as f64));
            let faces: Vec<Face> = mesh.boundary_quads().into_iter().map(Face::from).collect();
            cook(mesh.nodes(), &Solid::uniform(&mesh, material).unwrap(), &faces)
        };
        let [coarse, fine] = [32, 64].map(of_hexes);
        // Second order, less at the corner of the wall: the limit lies beyond the finer one by about a third of the difference.
        let limit = fine + (fine - coarse) / 3.0;
        let of_tets = |n: usize| {
            let mesh = tets::quadratic(&block([1.0; 3], [n, n, 1]), |p| membrane(p, 40.0 / n as f64));
            cook(mesh.nodes(), &tets::solid(&mesh, material), &mesh.boundary_faces())
        };
        let found = [4, 8, 16].map(of_tets);
        println!(
            "Cook, nu {poisson_ratio:.4}: hexahedra {coarse:.3}, {fine:.3}, limit {limit:.3} mm; 10 nodes, 4, 8, 16 cells: {found:.3?}"
        );
        assert_close(found[2], limit, 0.01, "Cook");
    }
}
