//! Contact surface: quadrature points on boundary faces.

use std::ops::{Add, Mul, Sub};

use nalgebra::{Point3, Vector3};
use plica_geometry::{HexMesh, NodeIdx};

use crate::constraints::Constraints;

/// Reference coordinates of the four corners of a face.
const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// A point of a bilinear face, `p = sum_a N_a x_a`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPoint {
    /// Corners of the face.
    pub nodes: [NodeIdx; 4],
    /// `N_a`; they sum to 1.
    pub shares: [f64; 4],
    /// Reference area of the point \[m^2\].
    pub area_m2: f64,
    /// Square root of the face's reference area \[m\].
    pub size_m: f64,
}

impl ContactPoint {
    /// `p` for nodal positions `x: [n_nodes]` \[m\].
    pub fn position(&self, x: &[Vector3<f64>]) -> Point3<f64> {
        let sum = |sum, (node, share): (&NodeIdx, f64)| sum + x[node.index()] * share;
        Point3::from(self.nodes.iter().zip(self.shares).fold(Vector3::zeros(), sum))
    }
}

/// Value of a field on the surface.
pub(super) trait FieldValue:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self>
{
}

impl FieldValue for f64 {}
impl FieldValue for Vector3<f64> {}

/// The 2 x 2 Gauss points of faces. Each lies in the stencil of one element, so contact adds no entries to the pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactSurface {
    points: Vec<ContactPoint>,
    /// `sum_q A_q N_a(q)`, `[n_nodes]` \[m^2\]; 0 off the surface.
    node_areas_m2: Vec<f64>,
}

impl ContactSurface {
    /// Points of `quads`, whose reference positions are those of `mesh`.
    pub fn new(mesh: &HexMesh, quads: &[[NodeIdx; 4]]) -> Self {
        let points: Vec<_> = quads.iter().flat_map(|quad| face_points(mesh, *quad)).collect();
        let mut node_areas_m2 = vec![0.0; mesh.n_nodes()];
        for point in &points {
            for (node, share) in point.nodes.iter().zip(point.shares) {
                node_areas_m2[node.index()] += point.area_m2 * share;
            }
        }
        Self { points, node_areas_m2 }
    }

    /// Points of the boundary faces of `mesh` with a free coordinate.
    pub fn of_boundary(mesh: &HexMesh, constraints: &Constraints) -> Self {
        let mut quads = mesh.boundary_quads();
        quads.retain(|quad| quad.iter().any(|node| constraints.is_given(node.index()) != [true; 3]));
        Self::new(mesh, &quads)
    }

    /// The points, four per face.
    pub fn points(&self) -> &[ContactPoint] {
        &self.points
    }

    /// `P v = S (2 v - S v)`, the part of `values: [n_points]` that is continuous over the surface. Rows of `S` average:
    /// `v_a = sum_q A_q N_a v_q / sum_q A_q N_a` at the nodes, interpolated back to the points.
    pub(super) fn continuous_part<T: FieldValue>(&self, values: &[T]) -> Vec<T> {
        let averaged = self.average(values);
        let sharpened: Vec<T> = values.iter().zip(averaged).map(|(v, average)| *v * 2.0 - average).collect();
        self.average(&sharpened)
    }

    fn average<T: FieldValue>(&self, values: &[T]) -> Vec<T> {
        let mut at_nodes = vec![T::default(); self.node_areas_m2.len()];
        for (point, value) in self.points.iter().zip(values) {
            for (node, share) in point.nodes.iter().zip(point.shares) {
                let weight = point.area_m2 * share / self.node_areas_m2[node.index()];
                at_nodes[node.index()] = at_nodes[node.index()] + *value * weight;
            }
        }
        let interpolate = |point: &ContactPoint| {
            let shares = point.nodes.iter().zip(point.shares);
            shares.fold(T::default(), |sum, (node, share)| sum + at_nodes[node.index()] * share)
        };
        self.points.iter().map(interpolate).collect()
    }

    /// Calls `visit` with the nodes of every face.
    pub(super) fn visit_faces(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.points.iter().step_by(CORNERS.len()).for_each(|point| visit(&point.nodes));
    }
}

fn face_points(mesh: &HexMesh, nodes: [NodeIdx; 4]) -> [ContactPoint; 4] {
    let corners = nodes.map(|node| mesh.nodes()[node.index()].coords);
    let gauss = CORNERS.map(|corner| corner.map(|c| c / 3.0_f64.sqrt()));
    let size_m = gauss.iter().map(|xi| area_element(&corners, *xi)).sum::<f64>().sqrt();
    gauss.map(|xi| ContactPoint { nodes, shares: shape_functions(xi), area_m2: area_element(&corners, xi), size_m })
}

/// `N_a(xi) = 1/4 (1 + xi_a xi) (1 + eta_a eta)`.
fn shape_functions([xi, eta]: [f64; 2]) -> [f64; 4] {
    CORNERS.map(|[a, b]| 0.25 * (1.0 + a * xi) * (1.0 + b * eta))
}

/// `|dX/dxi x dX/deta|` \[m^2\].
fn area_element(corners: &[Vector3<f64>; 4], [xi, eta]: [f64; 2]) -> f64 {
    let along = |derivative: &dyn Fn([f64; 2]) -> f64| {
        CORNERS.iter().zip(corners).fold(Vector3::zeros(), |sum, (c, x)| sum + x * derivative(*c))
    };
    let along_xi = along(&|[a, b]| 0.25 * a * (1.0 + b * eta));
    let along_eta = along(&|[a, b]| 0.25 * b * (1.0 + a * xi));
    along_xi.cross(&along_eta).norm()
}
