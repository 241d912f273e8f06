//! A moment on faces.

use nalgebra::{Matrix3, Point3, Vector3};
use plica_geometry::{Face, HexMesh, NodeIdx};

use super::face::{gauss_points, normal, positions};
use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;

/// A couple of forces that follow the surface: at every deformation its moment about an axis of fixed direction `a` is `M`,
/// and its resultant 0.
///
/// `f_n = M w_n a x r_n / S`, `S = sum_n w_n |a x r_n|^2`, with `r_n` from the mean of the nodes to node `n`, weighted with the
/// share `w_n` of the faces' rest area. It does the work of `M` on the mean rotation of the faces about `a`, bends and
/// twists, and has no potential in general. The derivative couples all nodes of the faces and is left to
/// [`Energy::add_remainder_product`].
#[derive(Debug, Clone, PartialEq)]
pub struct Couple {
    /// Nodes and their shares of the area; these sum to 1.
    nodes: Vec<(NodeIdx, f64)>,
    axis: Vector3<f64>,
    moment_nm: f64,
}

impl Couple {
    /// `moment_nm` \[N m\], a vector along the axis, on `quads` of a mesh at rest.
    ///
    /// # Panics
    /// If a quad names a node that the mesh does not have.
    pub fn new(mesh: &HexMesh, quads: &[[NodeIdx; 4]], moment_nm: Vector3<f64>) -> Self {
        let faces: Vec<Face> = quads.iter().copied().map(Face::from).collect();
        Self::on_faces(mesh.nodes(), &faces, moment_nm)
    }

    /// The same on faces of any elements; `nodes` \[m\] are those of the mesh at rest.
    ///
    /// # Panics
    /// If a face names a node that there is not.
    pub fn on_faces(nodes: &[Point3<f64>], faces: &[Face], moment_nm: Vector3<f64>) -> Self {
        let rest: Vec<_> = nodes.iter().map(|x| x.coords).collect();
        let mut areas = vec![0.0; rest.len()];
        for face in faces {
            let at = positions(&rest, face);
            for point in gauss_points(face) {
                let area = normal(&at, face.nodes().len(), point).norm();
                face.nodes().iter().zip(point.shape).for_each(|(node, share)| areas[node.index()] += area * share);
            }
        }
        let total: f64 = areas.iter().sum();
        let on_faces = areas.iter().enumerate().filter(|(_, area)| **area > 0.0);
        let nodes = on_faces.map(|(node, area)| (NodeIdx::from_index(node), area / total)).collect();
        let size = moment_nm.norm();
        let axis = if size > 0.0 { moment_nm / size } else { Vector3::z() };
        Self { nodes, axis, moment_nm: size }
    }

    /// Vectors `r_n`, and `S`.
    fn arms(&self, x: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, f64) {
        let mean: Vector3<f64> = self.nodes.iter().map(|(node, w)| x[node.index()] * *w).sum();
        let arms: Vec<_> = self.nodes.iter().map(|(node, _)| x[node.index()] - mean).collect();
        let spread = self.nodes.iter().zip(&arms).map(|((_, w), r)| w * self.axis.cross(r).norm_squared()).sum();
        (arms, spread)
    }
}

impl Energy for Couple {
    fn visit_stencils(&self, _visit: &mut dyn FnMut(&[NodeIdx])) {}

    fn value(&self, _x: &[Vector3<f64>]) -> f64 {
        0.0
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        let (arms, spread) = self.arms(x);
        for ((node, w), r) in self.nodes.iter().zip(&arms) {
            gradient[node.index()] -= self.axis.cross(r) * (self.moment_nm * w / spread);
        }
    }

    fn add_hessian(&self, _x: &[Vector3<f64>], _projection: Projection, _hessian: &mut Hessian) {}

    fn has_potential(&self) -> bool {
        false
    }

    /// `d f_n = M w_n / S (a x dr_n - a x r_n dS / S)`, `dS = 2 sum_m w_m (a x r_m) . (a x dr_m)`.
    fn add_remainder_product(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        _projection: Projection,
        product: &mut [Vector3<f64>],
    ) {
        let (arms, spread) = self.arms(x);
        let turn: Matrix3<f64> = self.axis.cross_matrix();
        let mean: Vector3<f64> = self.nodes.iter().map(|(node, w)| v[node.index()] * *w).sum();
        let change =
            |(node, w): &(NodeIdx, f64), r: &Vector3<f64>| 2.0 * w * (turn * r).dot(&(turn * (v[node.index()] - mean)));
        let change: f64 = self.nodes.iter().zip(&arms).map(|(node, r)| change(node, r)).sum();
        for ((node, w), r) in self.nodes.iter().zip(&arms) {
            let along = turn * (v[node.index()] - mean) - turn * r * (change / spread);
            product[node.index()] -= along * (self.moment_nm * w / spread);
        }
    }
}
