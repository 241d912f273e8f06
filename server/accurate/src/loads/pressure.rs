//! Pressure that follows the surface.

use nalgebra::{Matrix3, Vector3};
use plica_geometry::{Face, NodeIdx};

use super::face::{FacePositions, MAX_FACE_NODES, gauss_points, normal, positions, tangents};
use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;

/// A pressure `p` against faces of the deformed surface: `f_a = -int N_a p n da`, `n` outward.
///
/// It has a potential only on closed faces, and is always treated as having none. The symmetric part of its derivative
/// is the exact Hessian; it is indefinite, and a projected Hessian leaves it out.
#[derive(Debug, Clone, PartialEq)]
pub struct Pressure {
    faces: Vec<Face>,
    pressure_pa: f64,
}

/// `d gradient_a / dx_b` of a face.
type Derivative = [[Matrix3<f64>; MAX_FACE_NODES]; MAX_FACE_NODES];

impl Pressure {
    /// `pressure_pa` \[Pa\], positive when it pushes, on outward faces (as [`plica_geometry::HexMesh::boundary_quads`] or
    /// [`plica_geometry::VolumeMesh::boundary_faces`] has them).
    pub fn new(faces: Vec<impl Into<Face>>, pressure_pa: f64) -> Self {
        Self { faces: faces.into_iter().map(Into::into).collect(), pressure_pa }
    }

    /// The same faces under another pressure \[Pa\].
    pub fn set_pressure(&mut self, pressure_pa: f64) {
        self.pressure_pa = pressure_pa;
    }

    /// `p int N_a (N_b,eta [s x .] - N_b,xi [t x .])`, with the tangents `s = dx/dxi`, `t = dx/deta`.
    fn derivative(&self, face: &Face, at: &FacePositions) -> Derivative {
        let mut blocks = [[Matrix3::zeros(); MAX_FACE_NODES]; MAX_FACE_NODES];
        let n_nodes = face.nodes().len();
        for point in gauss_points(face) {
            let [s, t] = tangents(at, n_nodes, point);
            for a in 0..n_nodes {
                for b in 0..n_nodes {
                    let turn = s * point.by_eta[b] - t * point.by_xi[b];
                    blocks[a][b] += turn.cross_matrix() * (self.pressure_pa * point.shape[a] * point.weight);
                }
            }
        }
        blocks
    }
}

impl Energy for Pressure {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.faces.iter().for_each(|face| visit(face.nodes()));
    }

    fn value(&self, _x: &[Vector3<f64>]) -> f64 {
        0.0
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        for face in &self.faces {
            let (at, nodes) = (positions(x, face), face.nodes());
            for point in gauss_points(face) {
                let force = normal(&at, nodes.len(), point) * self.pressure_pa;
                nodes.iter().zip(point.shape).for_each(|(node, n)| gradient[node.index()] += force * n);
            }
        }
    }

    fn add_hessian(&self, x: &[Vector3<f64>], projection: Projection, hessian: &mut Hessian) {
        if projection == Projection::PositiveSemidefinite {
            return;
        }
        for face in &self.faces {
            let d = self.derivative(face, &positions(x, face));
            hessian.add_stencil(face.nodes(), |a, b| (d[a][b] + d[b][a].transpose()) * 0.5);
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
        for face in &self.faces {
            let (d, nodes) = (self.derivative(face, &positions(x, face)), face.nodes());
            for a in 0..nodes.len() {
                for b in 0..nodes.len() {
                    let remainder = match projection {
                        Projection::Exact => (d[a][b] - d[b][a].transpose()) * 0.5,
                        Projection::PositiveSemidefinite => d[a][b],
                    };
                    product[nodes[a].index()] += remainder * v[nodes[b].index()];
                }
            }
        }
    }
}
