//! A nearly incompressible beam bends as much as a compressible one of the same Young's modulus: elements with one
//! volumetric condition do not lock. The same element with eight of them does.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{ISOTROPIC, material, rest, sides, solve};
use nalgebra::{Matrix3, Vector3};
use plica_accurate::{
    Constraints, Energy, GAUSS_POINTS, Hessian, Lame, Material, MaterialModel, Params, Projection, Solid, Traction,
};
use plica_geometry::shapes::block;
use plica_geometry::{HexIdx, HexMesh, NodeIdx, isoparametric};

const SIZE: [f64; 3] = [0.16, 0.02, 0.02];
const E: f64 = 3e4;

/// Linear elasticity with full integration: the volumetric part at every Gauss point. Quadratic, so that value and gradient
/// follow from the Hessian.
struct FullyIntegrated {
    mesh: HexMesh,
    lame: Lame,
}

impl FullyIntegrated {
    /// `w (lambda a b^T + mu (a . b) I + mu b a^T)` of two nodes of a hexahedron, summed over its Gauss points.
    fn blocks(&self, hex: HexIdx) -> [[Matrix3<f64>; 8]; 8] {
        let corners = self.mesh.corner_positions(hex);
        let mut blocks = [[Matrix3::zeros(); 8]; 8];
        for xi in GAUSS_POINTS {
            let jacobian = isoparametric::jacobian(&corners, xi);
            let inverse = jacobian.try_inverse().unwrap();
            let g = isoparametric::shape_gradients(xi).map(|g| inverse.tr_mul(&Vector3::from(g)));
            for a in 0..8 {
                for b in 0..8 {
                    let shear = Matrix3::from_diagonal_element(g[a].dot(&g[b])) + g[b] * g[a].transpose();
                    let block = g[a] * g[b].transpose() * self.lame.lambda_pa + shear * self.lame.mu_pa;
                    blocks[a][b] += block * jacobian.determinant();
                }
            }
        }
        blocks
    }
}

impl Energy for FullyIntegrated {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.mesh.hexes().iter().for_each(|nodes| visit(nodes));
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        let mut gradient = vec![Vector3::zeros(); x.len()];
        self.add_gradient(x, &mut gradient);
        0.5 * gradient.iter().zip(x.iter().zip(rest(&self.mesh))).map(|(g, (x, rest))| g.dot(&(x - rest))).sum::<f64>()
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        for (hex, nodes) in self.mesh.hex_indices().zip(self.mesh.hexes()) {
            let blocks = self.blocks(hex);
            for a in 0..8 {
                for b in 0..8 {
                    let u = x[nodes[b].index()] - self.mesh.nodes()[nodes[b].index()].coords;
                    gradient[nodes[a].index()] += blocks[a][b] * u;
                }
            }
        }
    }

    fn add_hessian(&self, _x: &[Vector3<f64>], _projection: Projection, hessian: &mut Hessian) {
        for (hex, nodes) in self.mesh.hex_indices().zip(self.mesh.hexes()) {
            let blocks = self.blocks(hex);
            hessian.add_stencil(nodes, |a, b| blocks[a][b]);
        }
    }
}

fn mesh() -> HexMesh {
    block(SIZE, [16, 2, 2])
}

/// Deflection of the free end \[m\] under a small shear on it.
fn deflection(solid: &dyn Energy) -> f64 {
    let mesh = mesh();
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| sides(x, SIZE)[0][0]) {
        constraints.hold(node, &x.coords);
    }
    let is_at_end = |node: &NodeIdx| sides(&mesh.nodes()[node.index()], SIZE)[0][1];
    let end: Vec<_> = mesh.boundary_quads().into_iter().filter(|quad| quad.iter().all(is_at_end)).collect();
    let load = Traction::new(&mesh, &end, Vector3::new(0.0, 0.0, -0.1));
    let mut x = rest(&mesh);
    solve(&[solid, &load], &constraints, &Params::default(), &mut x).unwrap();
    let at_end = mesh.nodes().iter().zip(&x).filter(|(rest, _)| sides(rest, SIZE)[0][1]);
    let sunk: Vec<f64> = at_end.map(|(rest, x)| rest.z - x.z).collect();
    sunk.iter().sum::<f64>() / sunk.len() as f64
}

/// Deflection at `nu = 0.499` over that at `nu = 0.3`.
fn softness<S: Energy>(solid: impl Fn(f64) -> S) -> f64 {
    deflection(&solid(0.499)) / deflection(&solid(0.3))
}

/// `F L^3 / 3 E I + F L / kappa G A` of the two, `kappa = 10 (1 + nu) / (12 + 11 nu)` \[Cowper66\].
fn expected_softness() -> f64 {
    let beam = |nu: f64| {
        let kappa = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu);
        SIZE[0].powi(2) / SIZE[2].powi(2) * 4.0 + 2.0 * (1.0 + nu) / kappa
    };
    beam(0.499) / beam(0.3)
}

#[test]
fn nearly_incompressible_bending_does_not_lock() {
    for model in ISOTROPIC {
        let found = softness(|nu| Solid::uniform(&mesh(), material(model, E, nu)).unwrap());
        println!("{model:?}: deflection at nu .499 over .3 is {found:.4}, in beam theory {:.4}", expected_softness());
        assert!((found / expected_softness() - 1.0).abs() <= 0.03, "{model:?}: {found}");
    }
}

#[test]
fn full_integration_locks() {
    let lame = |nu| Material { model: MaterialModel::Linear, young_modulus_pa: E, poisson_ratio: nu }.lame();
    let found = softness(|nu| FullyIntegrated { mesh: mesh(), lame: lame(nu) });
    println!("full integration: {found:.4}");
    assert!(found < 0.5, "{found}");
}
