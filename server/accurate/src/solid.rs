//! The elastic energy of a mesh.

mod carried;
mod element;
mod guard;
mod recovery;
mod tetrahedra;

use nalgebra::{Matrix3, Vector3};
use plica_geometry::{ElementIdx, HexMesh, NodeIdx, TetMesh, Tets, VolumeMesh, isoparametric};

use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;
use crate::material::{Law, Material, MaterialError};
use carried::Carried;
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

/// Elements of hyperelastic materials with mean dilatation \[STP85\]:
///
/// `W(x) = sum_e [ sum_q w_q psi(F_q) + V_e U(sum_q w_q J_q / V_e) ]`,
///
/// `q` running over Gauss points, 2 x 2 x 2 in hexahedra, `psi` and `U` being the local and volumetric parts of the material (the
/// linear one has `tr(F) - 3` in place of `J - 1`). One volumetric condition per element instead of one per point: nearly
/// incompressible materials do not lock.
///
/// Tetrahedra of 10 nodes have 4 Gauss points. With all of `U` at the mean dilatation they would be of second order; what a
/// Poisson's ratio of 1/3 has of it stays at the Gauss points. Tetrahedra of 4 nodes have one, and lock.
#[derive(Debug, Clone)]
pub struct Solid {
    rest: Vec<Vector3<f64>>,
    elements: Elements,
}

/// Elements of one kind.
#[derive(Debug, Clone)]
enum Elements {
    Hexahedra(Vec<Element<8, 8>>),
    LinearTetrahedra(Vec<Element<4, 1>>),
    QuadraticTetrahedra(Vec<Element<10, 4>>),
}

/// The same expression for the elements of any kind.
macro_rules! with_elements {
    ($elements:expr, $list:ident => $result:expr) => {
        match $elements {
            Elements::Hexahedra($list) => $result,
            Elements::LinearTetrahedra($list) => $result,
            Elements::QuadraticTetrahedra($list) => $result,
        }
    };
}
use with_elements;

/// Error of a solid's mesh and materials.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SolidError {
    /// The number of materials is not that of the elements.
    #[error("{n_materials} materials for {n_elements} elements")]
    Count {
        /// Materials given.
        n_materials: usize,
        /// Elements of the mesh.
        n_elements: usize,
    },
    /// A material is not valid.
    #[error("element {element}: {error}")]
    Material {
        /// Its first element.
        element: ElementIdx,
        /// Cause.
        error: MaterialError,
    },
}

impl Solid {
    /// Hexahedra at rest with one material each, `[n_hexes]`.
    ///
    /// # Errors
    /// See [`SolidError`].
    pub fn new(mesh: &HexMesh, materials: &[Material]) -> Result<Self, SolidError> {
        check(materials, mesh.n_hexes())?;
        let with_materials = mesh.hex_indices().zip(materials);
        let elements = with_materials.map(|(hex, material)| Element::hexahedron(mesh, hex, Law::new(material)));
        let rest = mesh.nodes().iter().map(|x| x.coords).collect();
        Ok(Self { rest, elements: Elements::Hexahedra(elements.collect()) })
    }

    /// Tetrahedra at rest with one material each, `[n_tets]`.
    ///
    /// # Errors
    /// See [`SolidError`].
    pub fn of_tetrahedra(mesh: &TetMesh, materials: &[Material]) -> Result<Self, SolidError> {
        check(materials, mesh.n_tets())?;
        let laws = materials.iter().enumerate();
        let laws = laws.map(|(tet, material)| (ElementIdx::from_index(tet), Law::divided(material)));
        let elements = match mesh.tets() {
            Tets::Linear(_) => {
                Elements::LinearTetrahedra(laws.map(|(tet, law)| Element::linear(mesh, tet, law)).collect())
            }
            Tets::Quadratic(_) => {
                Elements::QuadraticTetrahedra(laws.map(|(tet, law)| Element::quadratic(mesh, tet, law)).collect())
            }
        };
        Ok(Self { rest: mesh.nodes().iter().map(|x| x.coords).collect(), elements })
    }

    /// Any elements at rest with one material each, `[n_elements]`.
    ///
    /// # Errors
    /// See [`SolidError`].
    pub fn of_volume(mesh: &VolumeMesh, materials: &[Material]) -> Result<Self, SolidError> {
        match mesh {
            VolumeMesh::Hexahedra(mesh) => Self::new(mesh, materials),
            VolumeMesh::Tetrahedra(mesh) => Self::of_tetrahedra(mesh, materials),
        }
    }

    /// Hexahedra at rest, all of one material.
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

    /// Deformation gradient at reference coordinates `xi` of an element.
    pub fn deformation_gradient(
        &self,
        x: &[Vector3<f64>],
        element: impl Into<ElementIdx>,
        xi: [f64; 3],
    ) -> Matrix3<f64> {
        let element = element.into().index();
        with_elements!(&self.elements, list => list[element].deformation_at(x, xi).f())
    }

    /// Cauchy stress \[Pa\] at reference coordinates `xi` of an element (of hexahedra [`GAUSS_POINTS`], or 0 for the centre), with
    /// the pressure of the element's mean dilatation: `P F^T / J`; of the linear material `2 mu eps + lambda tr(eps) I`.
    /// [`Solid::recovered_stress`] is more accurate.
    pub fn cauchy_stress(&self, x: &[Vector3<f64>], element: impl Into<ElementIdx>, xi: [f64; 3]) -> Matrix3<f64> {
        let element = element.into().index();
        with_elements!(&self.elements, list => list[element].cauchy_stress(x, xi))
    }

    /// Cauchy stress \[Pa\] at the centres of all elements, `[n_elements]`.
    pub fn centre_stresses(&self, x: &[Vector3<f64>]) -> Vec<Matrix3<f64>> {
        with_elements!(&self.elements, list => list.iter().map(|e| e.cauchy_stress(x, e.reference().centre)).collect())
    }

    /// Smallest `det F` over the Gauss points of each element, `[n_elements]`.
    pub fn smallest_jacobians(&self, x: &[Vector3<f64>]) -> Vec<f64> {
        with_elements!(&self.elements, list => list.iter().map(|e| e.smallest_jacobian(x)).collect())
    }

    /// The element with the smallest `det F` at a Gauss point.
    pub fn most_compressed(&self, x: &[Vector3<f64>]) -> Option<ElementIdx> {
        let smallest = self.smallest_jacobians(x).into_iter().enumerate();
        smallest.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(element, _)| ElementIdx::from_index(element))
    }

    /// Volume \[m^3\] of the deformed solid.
    pub fn volume(&self, x: &[Vector3<f64>]) -> f64 {
        with_elements!(&self.elements, list => list.iter().map(|e| e.volume(x)).sum())
    }
}

fn check(materials: &[Material], n_elements: usize) -> Result<(), SolidError> {
    if materials.len() != n_elements {
        return Err(SolidError::Count { n_materials: materials.len(), n_elements });
    }
    let refused = materials.iter().enumerate().find_map(|(i, material)| Some((i, material.check().err()?)));
    refused.map_or(Ok(()), |(i, error)| Err(SolidError::Material { element: ElementIdx::from_index(i), error }))
}

impl Energy for Solid {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        with_elements!(&self.elements, list => list.iter().for_each(|e| visit(e.nodes())));
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        with_elements!(&self.elements, list => list.iter().map(|e| e.value(x)).sum())
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        with_elements!(&self.elements, list => {
            for element in list {
                for (node, force) in element.nodes().iter().zip(element.gradient(x)) {
                    gradient[node.index()] += force;
                }
            }
        });
    }

    fn add_hessian(&self, x: &[Vector3<f64>], projection: Projection, hessian: &mut Hessian) {
        with_elements!(&self.elements, list => {
            for element in list {
                let blocks = element.hessian(x, projection);
                hessian.add_stencil(element.nodes(), |a, b| blocks[a][b]);
            }
        });
    }

    fn carried_stresses(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Vec<f64> {
        let mut carried = Vec::new();
        with_elements!(&self.elements, list => list.iter().for_each(|e| e.carried(x, v).append_to(&mut carried)));
        carried
    }

    fn add_carried_hessian(&self, x: &[Vector3<f64>], carried: &[f64], hessian: &mut Hessian) {
        if carried.is_empty() {
            return self.add_hessian(x, Projection::Exact, hessian);
        }
        with_elements!(&self.elements, list => {
            for (element, carried) in list.iter().zip(carried.chunks_exact(carried.len() / list.len())) {
                let blocks = element.carried_hessian(x, &Carried::from_values(carried));
                hessian.add_stencil(element.nodes(), |a, b| blocks[a][b]);
            }
        });
    }

    fn smallest_jacobian(&self, x: &[Vector3<f64>]) -> Option<f64> {
        with_elements!(&self.elements, list => list.iter().map(|e| e.smallest_jacobian(x)).reduce(f64::min))
    }

    fn rest_positions(&self) -> Option<&[Vector3<f64>]> {
        Some(&self.rest)
    }
}
