//! One hexahedron: 2 x 2 x 2 Gauss points and a mean dilatation.

use nalgebra::{Matrix3, Vector3};
use plica_geometry::{HexIdx, HexMesh, NodeIdx, isoparametric};

use super::GAUSS_POINTS;
use crate::energy::Projection;
use crate::material::{Deformation, Law, MaterialModel, Tangent};

/// Gradients `dN_a/dX` \[1/m\] and weight `det(dX/dxi)` \[m^3\] of a Gauss point.
#[derive(Debug, Clone)]
pub(super) struct GaussPoint {
    pub(super) gradients: [Vector3<f64>; 8],
    pub(super) weight: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Element {
    nodes: [NodeIdx; 8],
    rest: [Vector3<f64>; 8],
    points: [GaussPoint; 8],
    volume: f64,
    law: Law,
}

/// An element's deformation at its Gauss points, and its mean dilatation.
struct State {
    points: [Deformation; 8],
    dilatation: f64,
}

/// Blocks `[a][b]`, `b <= a`, of the symmetric `24 x 24` matrix; those above the diagonal are not set.
pub(super) type Blocks = [[Matrix3<f64>; 8]; 8];

impl Element {
    pub(super) fn new(mesh: &HexMesh, hex: HexIdx, law: Law) -> Self {
        let rest = mesh.corner_positions(hex).map(|corner| corner.coords);
        let points = GAUSS_POINTS.map(|xi| gauss_point(&rest, xi));
        let volume = points.iter().map(|q| q.weight).sum();
        Self { nodes: mesh.hexes()[hex.index()], rest, points, volume, law }
    }

    pub(super) fn nodes(&self) -> &[NodeIdx; 8] {
        &self.nodes
    }

    /// Gauss points with their deformation.
    pub(super) fn points_at(&self, x: &[Vector3<f64>]) -> impl Iterator<Item = (&GaussPoint, Deformation)> {
        let u = self.displacements(x);
        self.points.iter().map(move |point| (point, deformation(&u, &point.gradients)))
    }

    pub(super) fn shear_modulus(&self) -> f64 {
        self.law.mu
    }

    pub(super) fn value(&self, x: &[Vector3<f64>]) -> f64 {
        let state = self.state(x);
        let local: f64 = self.points.iter().zip(&state.points).map(|(q, d)| q.weight * self.law.local_value(d)).sum();
        local + self.volume * self.law.volumetric_value(state.dilatation)
    }

    /// `dW/dx_a = sum_q w_q (dpsi/dF + U' C) dN_a/dX`, with `C = dJ/dF`.
    pub(super) fn gradient(&self, x: &[Vector3<f64>]) -> [Vector3<f64>; 8] {
        let state = self.state(x);
        let pressure = self.law.volumetric(state.dilatation).slope;
        let mut forces = [Vector3::zeros(); 8];
        for (q, d) in self.points.iter().zip(&state.points) {
            let stress = (self.law.local_stress(d) + self.law.dilatation_gradient(d) * pressure) * q.weight;
            forces.iter_mut().zip(&q.gradients).for_each(|(force, g)| *force += stress * g);
        }
        forces
    }

    /// `d^2 W/dx_a dx_b = sum_q w_q (d^2 psi/dF^2 + U' d^2 J/dF^2)[dN_a/dX, dN_b/dX] + V U'' c_a c_b^T`,
    /// `c_a = sum_q w_q/V C dN_a/dX`.
    pub(super) fn hessian(&self, x: &[Vector3<f64>], projection: Projection) -> Blocks {
        let state = self.state(x);
        let volumetric = self.law.volumetric(state.dilatation);
        let mut blocks = [[Matrix3::zeros(); 8]; 8];
        let mut mean = [Vector3::zeros(); 8];
        for (q, d) in self.points.iter().zip(&state.points) {
            let tangent = Tangent::new(&self.law, d, volumetric.slope, projection);
            tangent.add_blocks(&q.gradients, q.weight, &mut blocks);
            let c = self.law.dilatation_gradient(d) * q.weight;
            mean.iter_mut().zip(&q.gradients).for_each(|(mean, g)| *mean += c * g);
        }
        let curvature = volumetric.curvature(projection) / self.volume;
        for a in 0..8 {
            for b in 0..=a {
                blocks[a][b] += mean[a] * (mean[b] * curvature).transpose();
            }
        }
        blocks
    }

    pub(super) fn smallest_jacobian(&self, x: &[Vector3<f64>]) -> f64 {
        self.state(x).points.iter().map(Deformation::jacobian).fold(f64::INFINITY, f64::min)
    }

    pub(super) fn volume(&self, x: &[Vector3<f64>]) -> f64 {
        self.state(x).points.iter().zip(&self.points).map(|(d, q)| q.weight * d.jacobian()).sum()
    }

    pub(super) fn deformation_at(&self, x: &[Vector3<f64>], xi: [f64; 3]) -> Deformation {
        deformation(&self.displacements(x), &gauss_point(&self.rest, xi).gradients)
    }

    pub(super) fn cauchy_stress(&self, x: &[Vector3<f64>], xi: [f64; 3]) -> Matrix3<f64> {
        let pressure = self.law.volumetric(self.state(x).dilatation).slope;
        let d = self.deformation_at(x, xi);
        let local = self.law.local_stress(&d);
        let local =
            if self.law.model == MaterialModel::Linear { local } else { local * d.f().transpose() / d.jacobian() };
        local + Matrix3::from_diagonal_element(pressure)
    }

    fn state(&self, x: &[Vector3<f64>]) -> State {
        let u = self.displacements(x);
        let points: [Deformation; 8] = std::array::from_fn(|q| deformation(&u, &self.points[q].gradients));
        let sum: f64 = points.iter().zip(&self.points).map(|(d, q)| q.weight * self.law.dilatation(d)).sum();
        State { points, dilatation: sum / self.volume }
    }

    fn displacements(&self, x: &[Vector3<f64>]) -> [Vector3<f64>; 8] {
        std::array::from_fn(|a| x[self.nodes[a].index()] - self.rest[a])
    }
}

/// `G = sum_a u_a (dN_a/dX)^T`.
fn deformation(u: &[Vector3<f64>; 8], gradients: &[Vector3<f64>; 8]) -> Deformation {
    Deformation::new(u.iter().zip(gradients).fold(Matrix3::zeros(), |sum, (u, g)| sum + u * g.transpose()))
}

fn gauss_point(rest: &[Vector3<f64>; 8], xi: [f64; 3]) -> GaussPoint {
    let jacobian = isoparametric::jacobian(&rest.map(Into::into), xi);
    let inverse = jacobian.try_inverse().unwrap_or_else(Matrix3::zeros);
    let gradients = isoparametric::shape_gradients(xi).map(|g| inverse.tr_mul(&Vector3::from(g)));
    GaussPoint { gradients, weight: jacobian.determinant() }
}
