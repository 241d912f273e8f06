//! Loads: forces that keep their direction, and pressures and moments that follow the surface.

mod body;
mod couple;
mod face;
mod pressure;

use nalgebra::{Point3, Vector3};
use plica_geometry::{Face, HexMesh, NodeIdx};

use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;
pub use body::{body_forces, volume_forces};
pub use couple::Couple;
use face::{gauss_points, normal, positions};
pub use pressure::Pressure;

/// Dead forces at nodes: `W = -sum_n f_n . x_n`.
#[derive(Debug, Clone, PartialEq)]
pub struct NodalForces {
    forces: Vec<(NodeIdx, Vector3<f64>)>,
}

impl NodalForces {
    /// Forces \[N\] at nodes; those of a node named twice add up.
    pub fn new(forces: Vec<(NodeIdx, Vector3<f64>)>) -> Self {
        Self { forces }
    }

    /// Sum of all forces \[N\].
    pub fn total(&self) -> Vector3<f64> {
        self.forces.iter().map(|(_, f)| f).sum()
    }

    /// The forces \[N\], as given.
    pub fn forces(&self) -> &[(NodeIdx, Vector3<f64>)] {
        &self.forces
    }
}

impl Energy for NodalForces {
    fn visit_stencils(&self, _visit: &mut dyn FnMut(&[NodeIdx])) {}

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        -self.forces.iter().map(|(node, f)| f.dot(&x[node.index()])).sum::<f64>()
    }

    fn add_gradient(&self, _x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        self.forces.iter().for_each(|(node, f)| gradient[node.index()] -= f);
    }

    fn add_hessian(&self, _x: &[Vector3<f64>], _projection: Projection, _hessian: &mut Hessian) {}
}

/// A dead traction on faces: force per rest area, independent of the deformation.
#[derive(Debug, Clone, PartialEq)]
pub struct Traction {
    nodal: NodalForces,
}

impl Traction {
    /// `f_a = int N_a t dA` over the rest faces, by 2 x 2 Gauss points; `traction_pa` \[Pa\] is one vector for all `quads`
    /// (outward, as [`HexMesh::boundary_quads`] has them).
    ///
    /// # Panics
    /// If a quad names a node that the mesh does not have.
    pub fn new(mesh: &HexMesh, quads: &[[NodeIdx; 4]], traction_pa: Vector3<f64>) -> Self {
        let faces: Vec<Face> = quads.iter().copied().map(Face::from).collect();
        Self::on_faces(mesh.nodes(), &faces, traction_pa)
    }

    /// The same on faces of any elements, by their Gauss points; `nodes` \[m\] are those of the mesh at rest.
    ///
    /// # Panics
    /// If a face names a node that there is not.
    pub fn on_faces(nodes: &[Point3<f64>], faces: &[Face], traction_pa: Vector3<f64>) -> Self {
        let rest: Vec<_> = nodes.iter().map(|x| x.coords).collect();
        let mut forces = Vec::with_capacity(4 * faces.len());
        for face in faces {
            let (at, n_nodes) = (positions(&rest, face), face.nodes().len());
            for (a, &node) in face.nodes().iter().enumerate() {
                let area: f64 = gauss_points(face).iter().map(|q| q.shape[a] * normal(&at, n_nodes, q).norm()).sum();
                forces.push((node, traction_pa * area));
            }
        }
        Self { nodal: NodalForces::new(forces) }
    }

    /// Sum of all forces \[N\].
    pub fn total(&self) -> Vector3<f64> {
        self.nodal.total()
    }
}

/// Area of a face at rest \[m^2\], by its Gauss points; `nodes` \[m\] are those of the mesh.
///
/// # Panics
/// If the face names a node that there is not.
pub fn face_area(nodes: &[Point3<f64>], face: &Face) -> f64 {
    let mut rest = [Vector3::zeros(); face::MAX_FACE_NODES];
    rest.iter_mut().zip(face.nodes()).for_each(|(x, node)| *x = nodes[node.index()].coords);
    gauss_points(face).iter().map(|q| normal(&rest, face.nodes().len(), q).norm()).sum()
}

impl Energy for Traction {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.nodal.visit_stencils(visit);
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        self.nodal.value(x)
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        self.nodal.add_gradient(x, gradient);
    }

    fn add_hessian(&self, x: &[Vector3<f64>], projection: Projection, hessian: &mut Hessian) {
        self.nodal.add_hessian(x, projection, hessian);
    }
}
