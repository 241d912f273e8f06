//! Pressure that follows the surface.

use nalgebra::{Matrix3, Vector3};
use plica_geometry::NodeIdx;

use super::quad::{QUAD_GAUSS_POINTS, corners, normal, tangents};
use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;

/// A pressure `p` against faces of the deformed surface: `f_a = -int N_a p n da`, `n` outward.
///
/// It has a potential only on closed faces, and is always treated as having none. The symmetric part of its derivative
/// is the exact Hessian; it is indefinite, and a projected Hessian leaves it out.
#[derive(Debug, Clone, PartialEq)]
pub struct Pressure {
    quads: Vec<[NodeIdx; 4]>,
    pressure_pa: f64,
}

/// `d gradient_a / dx_b` of a face.
type Derivative = [[Matrix3<f64>; 4]; 4];

impl Pressure {
    /// `pressure_pa` \[Pa\], positive when it pushes, on outward `quads` (as [`plica_geometry::HexMesh::boundary_quads`] has
    /// them).
    pub fn new(quads: Vec<[NodeIdx; 4]>, pressure_pa: f64) -> Self {
        Self { quads, pressure_pa }
    }

    /// The same faces under another pressure \[Pa\].
    pub fn set_pressure(&mut self, pressure_pa: f64) {
        self.pressure_pa = pressure_pa;
    }

    /// `p int N_a (N_b,eta [s x .] - N_b,xi [t x .])`, with the tangents `s = dx/dxi`, `t = dx/deta`.
    fn derivative(&self, corners: &[Vector3<f64>; 4]) -> Derivative {
        let mut blocks = [[Matrix3::zeros(); 4]; 4];
        for point in &QUAD_GAUSS_POINTS {
            let [s, t] = tangents(corners, point);
            for a in 0..4 {
                for b in 0..4 {
                    let turn = s * point.by_eta[b] - t * point.by_xi[b];
                    blocks[a][b] += turn.cross_matrix() * (self.pressure_pa * point.shape[a]);
                }
            }
        }
        blocks
    }
}

impl Energy for Pressure {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.quads.iter().for_each(|quad| visit(quad));
    }

    fn value(&self, _x: &[Vector3<f64>]) -> f64 {
        0.0
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        for quad in &self.quads {
            let corners = corners(x, quad);
            for point in &QUAD_GAUSS_POINTS {
                let force = normal(&corners, point) * self.pressure_pa;
                quad.iter().zip(point.shape).for_each(|(node, n)| gradient[node.index()] += force * n);
            }
        }
    }

    fn add_hessian(&self, x: &[Vector3<f64>], projection: Projection, hessian: &mut Hessian) {
        if projection == Projection::PositiveSemidefinite {
            return;
        }
        for quad in &self.quads {
            let d = self.derivative(&corners(x, quad));
            hessian.add_stencil(quad, |a, b| (d[a][b] + d[b][a].transpose()) * 0.5);
        }
    }

    fn has_potential(&self) -> bool {
        false
    }

    fn add_remainder_product(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        projection: Projection,
        product: &mut [Vector3<f64>],
    ) {
        for quad in &self.quads {
            let d = self.derivative(&corners(x, quad));
            for a in 0..4 {
                for b in 0..4 {
                    let remainder = match projection {
                        Projection::Exact => (d[a][b] - d[b][a].transpose()) * 0.5,
                        Projection::PositiveSemidefinite => d[a][b],
                    };
                    product[quad[a].index()] += remainder * v[quad[b].index()];
                }
            }
        }
    }
}
