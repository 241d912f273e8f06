//! The elastic energy of a hexahedral mesh.

mod element;
mod guard;

use nalgebra::{Matrix3, Vector3};
use plica_geometry::{HexIdx, HexMesh, NodeIdx, isoparametric};

use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;
use crate::material::{Law, Material, MaterialError};
use element::Element;
pub use guard::TurnGuard;

/// Reference coordinates of the 2 x 2 x 2 Gauss points, in the order of the corners.
pub const GAUSS_POINTS: [[f64; 3]; 8] = {
    const G: f64 = 0.577_350_269_189_625_8; // 1 / sqrt 3
    let mut points = isoparametric::CORNERS;
    let mut q = 0;
    while q < 8 {
        let c = points[q];
        points[q] = [c[0] * G, c[1] * G, c[2] * G];
        q += 1;
    }
    points
};

/// Hexahedra of hyperelastic materials with mean dilatation \[STP85\]:
///
/// `W(x) = sum_e [ sum_q w_q psi(F_q) + V_e U(sum_q w_q J_q / V_e) ]`,
///
/// `q` running over 2 x 2 x 2 Gauss points, `psi` and `U` being the local and volumetric parts of the material (the linear
/// one has `tr(F) - 3` in place of `J - 1`). One volumetric condition per element instead of eight: nearly incompressible
/// materials do not lock.
#[derive(Debug, Clone)]
pub struct Solid {
    rest: Vec<Vector3<f64>>,
    elements: Vec<Element>,
}

/// Error of a solid's mesh and materials.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SolidError {
    /// The number of materials is not that of the hexahedra.
    #[error("{n_materials} materials for {n_hexes} hexahedra")]
    Count {
        /// Materials given.
        n_materials: usize,
        /// Hexahedra of the mesh.
        n_hexes: usize,
    },
    /// A material is not valid.
    #[error("hexahedron {hex}: {error}")]
    Material {
        /// Its first hexahedron.
        hex: HexIdx,
        /// Cause.
        error: MaterialError,
    },
}

impl Solid {
    /// The mesh at rest with one material per hexahedron, `[n_hexes]`.
    ///
    /// # Errors
    /// See [`SolidError`].
    pub fn new(mesh: &HexMesh, materials: &[Material]) -> Result<Self, SolidError> {
        if materials.len() != mesh.n_hexes() {
            return Err(SolidError::Count { n_materials: materials.len(), n_hexes: mesh.n_hexes() });
        }
        let mut elements = Vec::with_capacity(mesh.n_hexes());
        for (hex, material) in mesh.hex_indices().zip(materials) {
            material.check().map_err(|error| SolidError::Material { hex, error })?;
            elements.push(Element::new(mesh, hex, Law::new(material)));
        }
        Ok(Self { rest: mesh.nodes().iter().map(|x| x.coords).collect(), elements })
    }

    /// The mesh at rest, all of one material.
    ///
    /// # Errors
    /// See [`SolidError`].
    pub fn uniform(mesh: &HexMesh, material: Material) -> Result<Self, SolidError> {
        Self::new(mesh, &vec![material; mesh.n_hexes()])
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.rest.len()
    }

    /// Deformation gradient at reference coordinates `xi` of a hexahedron.
    pub fn deformation_gradient(&self, x: &[Vector3<f64>], hex: HexIdx, xi: [f64; 3]) -> Matrix3<f64> {
        self.elements[hex.index()].deformation_at(x, xi).f()
    }

    /// Cauchy stress \[Pa\] at reference coordinates `xi` of a hexahedron ([`GAUSS_POINTS`], or 0 for the centre), with the
    /// pressure of the element's mean dilatation: `P F^T / J`; of the linear material `2 mu eps + lambda tr(eps) I`.
    pub fn cauchy_stress(&self, x: &[Vector3<f64>], hex: HexIdx, xi: [f64; 3]) -> Matrix3<f64> {
        self.elements[hex.index()].cauchy_stress(x, xi)
    }

    /// The hexahedron with the smallest `det F` at a Gauss point.
    pub fn most_compressed(&self, x: &[Vector3<f64>]) -> Option<HexIdx> {
        let smallest = self.elements.iter().map(|e| e.smallest_jacobian(x)).enumerate();
        smallest.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(hex, _)| HexIdx::from_index(hex))
    }

    /// Volume \[m^3\] of the deformed solid.
    pub fn volume(&self, x: &[Vector3<f64>]) -> f64 {
        self.elements.iter().map(|e| e.volume(x)).sum()
    }
}

impl Energy for Solid {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.elements.iter().for_each(|e| visit(e.nodes()));
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        self.elements.iter().map(|e| e.value(x)).sum()
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        for element in &self.elements {
            for (node, force) in element.nodes().iter().zip(element.gradient(x)) {
                gradient[node.index()] += force;
            }
        }
    }

    fn add_hessian(&self, x: &[Vector3<f64>], projection: Projection, hessian: &mut Hessian) {
        for element in &self.elements {
            let blocks = element.hessian(x, projection);
            hessian.add_stencil(element.nodes(), |a, b| blocks[a][b]);
        }
    }

    fn smallest_jacobian(&self, x: &[Vector3<f64>]) -> Option<f64> {
        self.elements.iter().map(|e| e.smallest_jacobian(x)).reduce(f64::min)
    }

    fn rest_positions(&self) -> Option<&[Vector3<f64>]> {
        Some(&self.rest)
    }
}
