//! Problems with published solutions: a cantilever bent far, Cook's membrane, a nearly incompressible block pressed in
//! part.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{material, moved, rest, solve};
use nalgebra::{Point3, Vector3};
use plica_accurate::{Constraints, Info, Lame, Material, MaterialModel, Params, Solid, Traction};
use plica_geometry::shapes::block;
use plica_geometry::{HexMesh, NodeIdx};

/// Displacements under a traction on the boundary faces whose corners all lie in a region.
struct Case {
    mesh: HexMesh,
    material: Material,
    constraints: Constraints,
    traction_pa: Vector3<f64>,
}

impl Case {
    fn solve(&self, is_loaded: impl Fn(&Point3<f64>) -> bool) -> (Vec<Vector3<f64>>, Info) {
        let is_corner_loaded = |node: &NodeIdx| is_loaded(&self.mesh.nodes()[node.index()]);
        let quads = self.mesh.boundary_quads().into_iter().filter(|quad| quad.iter().all(is_corner_loaded));
        let load = Traction::new(&self.mesh, &quads.collect::<Vec<_>>(), self.traction_pa);
        let solid = Solid::uniform(&self.mesh, self.material).unwrap();
        let mut x = rest(&self.mesh);
        let info = solve(&[&solid, &load], &self.constraints, &Params::default(), &mut x).unwrap();
        (x.iter().zip(self.mesh.nodes()).map(|(x, rest)| x - rest.coords).collect(), info)
    }

    fn node_at(&self, point: Point3<f64>) -> usize {
        let distance = |node: &usize| (self.mesh.nodes()[*node] - point).norm();
        (0..self.mesh.n_nodes()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    }
}

fn assert_within(found: f64, expected: f64, share: f64, what: &str) {
    println!("{what}: {found:.4}, expected {expected:.4} ({:+.2} %)", 100.0 * (found / expected - 1.0));
    assert!((found / expected - 1.0).abs() <= share, "{what}: {found} instead of {expected}");
}

/// Deflection and shortening over length under a dead load at the tip, `F L^2 / E I = load`, for `nu = 0` and a length of 40
/// thicknesses: the elastica.
fn cantilever(load: f64, expected: [f64; 2]) {
    let (e, thickness) = (1e6, 0.025);
    let mesh = block([1.0, thickness, thickness], [640, 1, 8]);
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| x.x == 0.0) {
        constraints.hold(node, &x.coords);
    }
    let traction_pa = Vector3::new(0.0, 0.0, -load * e * thickness.powi(2) / 12.0);
    let material = material(MaterialModel::StableNeoHookean, e, 0.0);
    let case = Case { mesh, material, constraints, traction_pa };
    let (u, info) = case.solve(|x| x.x > 1.0 - 1e-9);
    let tip = u[case.node_at(Point3::new(1.0, 0.0, 0.5 * thickness))];
    println!("cantilever, 640 x 1 x 8 hexahedra: {} steps", info.iterations);
    assert_within(-tip.z, expected[0], 0.01, "deflection");
    assert_within(-tip.x, expected[1], 0.01, "shortening");
}

#[test]
fn cantilever_bent_by_a_third_of_its_length() {
    cantilever(1.0, [0.3017, 0.0564]);
}

#[test]
fn cantilever_bent_by_two_thirds_of_its_length() {
    cantilever(4.0, [0.6700, 0.3289]);
}

/// Rise of the top corner of Cook's membrane \[mm\], plane strain, `n x n` hexahedra.
fn cook(model: MaterialModel, n: usize) -> f64 {
    let thickness = 10.0 / n as f64;
    let mesh = moved(&block([1.0; 3], [n, n, 1]), |p| {
        Point3::new(48.0 * p.x, 44.0 * p.x * (1.0 - p.y) + (44.0 + 16.0 * p.x) * p.y, thickness * p.z)
    });
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate() {
        constraints.give(node, 2, x.z);
        if x.x == 0.0 {
            constraints.hold(node, &x.coords);
        }
    }
    // Millimetres and newtons: the numbers of the benchmark.
    let traction_pa = Vector3::new(0.0, 6.25, 0.0);
    let case = Case { mesh, material: material(model, 70.0, 1.0 / 3.0), constraints, traction_pa };
    let (u, _) = case.solve(|x| x.x > 48.0 - 1e-9);
    u[case.node_at(Point3::new(48.0, 60.0, 0.0))].y
}

#[test]
fn cook_membrane() {
    assert_within(cook(MaterialModel::Linear, 32), 32.2, 0.01, "Cook, linear, 32 x 32");
    let refined = cook(MaterialModel::StableNeoHookean, 64);
    assert_within(refined, 17.5, 0.01, "Cook, stable Neo-Hookean, 64 x 64");
    let found = cook(MaterialModel::StableNeoHookean, 32);
    assert_within(found, refined, 0.01, "Cook, stable Neo-Hookean, 32 x 32 against 64 x 64");
}

/// Sinking of the middle of a block pressed on a quarter of its quarter model \[mm\], `n^3` hexahedra.
fn pressed_block(model: MaterialModel, n: usize) -> f64 {
    let mesh = block([1.0; 3], [n; 3]);
    let is_loaded = |x: &Point3<f64>| x.z == 1.0 && x.x <= 0.5 && x.y <= 0.5;
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate() {
        for axis in (0..3).filter(|&axis| x[axis] == 0.0 || axis < 2 && is_loaded(x)) {
            constraints.give(node, axis, x[axis]);
        }
    }
    let material = Material::from_lame(model, Lame { lambda_pa: 400_889.806, mu_pa: 80.194 });
    let case = Case { mesh, material, constraints, traction_pa: Vector3::new(0.0, 0.0, -320.0) };
    let (u, info) = case.solve(is_loaded);
    let (steps, indefinite) = (info.iterations, info.indefinite_steps);
    println!(
        "block, {model:?}, {n}^3 hexahedra: {steps} steps, {indefinite} indefinite, J {:?}",
        info.smallest_jacobian
    );
    -u[case.node_at(Point3::new(0.0, 0.0, 1.0))].z
}

#[test]
fn block_under_partial_compression() {
    let compressible = pressed_block(MaterialModel::CompressibleNeoHookean, 8);
    assert_within(compressible, 0.70, 0.03, "block, compressible Neo-Hookean");
    let stable = pressed_block(MaterialModel::StableNeoHookean, 8);
    println!("stable Neo-Hookean over compressible: {:.4}", stable / compressible);
    assert!((0.90..0.96).contains(&(stable / compressible)), "{stable} against {compressible}");
}
