//! One element: Gauss points and a mean dilatation.

use nalgebra::{Matrix3, Vector3};
use plica_geometry::{HexIdx, HexMesh, NodeIdx, isoparametric};

use super::GAUSS_POINTS;
use super::carried::Carried;
use crate::energy::Projection;
use crate::material::{Deformation, Law, MaterialModel, Tangent};

/// Below this `det F` no second Piola-Kirchhoff stress is formed.
const LEAST_JACOBIAN: f64 = 1e-3;

/// Gradients `dN_a/dX` \[1/m\] and weight \[m^3\] of a Gauss point.
#[derive(Debug, Clone)]
pub(super) struct GaussPoint<const N: usize> {
    pub(super) gradients: [Vector3<f64>; N],
    pub(super) weight: f64,
}

/// Reference element of `N` nodes with `Q` Gauss points.
#[derive(Debug)]
pub(super) struct Reference<const N: usize, const Q: usize> {
    /// Reference coordinates of the Gauss points.
    pub(super) points: [[f64; 3]; Q],
    /// Weight of each.
    pub(super) weight: f64,
    /// `N_a`.
    pub(super) shapes: fn([f64; 3]) -> [f64; N],
    /// `dN_a/dxi`.
    pub(super) shape_gradients: fn([f64; 3]) -> [[f64; 3]; N],
    /// Reference coordinates of the centre.
    pub(super) centre: [f64; 3],
}

const HEXAHEDRON: Reference<8, 8> = Reference {
    points: GAUSS_POINTS,
    weight: 1.0,
    shapes: isoparametric::shape_functions,
    shape_gradients: isoparametric::shape_gradients,
    centre: [0.0; 3],
};

/// `N` nodes, `Q` Gauss points.
#[derive(Debug, Clone)]
pub(super) struct Element<const N: usize, const Q: usize> {
    reference: &'static Reference<N, Q>,
    nodes: [NodeIdx; N],
    rest: [Vector3<f64>; N],
    points: [GaussPoint<N>; Q],
    volume: f64,
    law: Law,
}

/// An element's deformation at its Gauss points, and its mean dilatation.
struct State<const Q: usize> {
    points: [Deformation; Q],
    dilatation: f64,
}

/// Blocks `[a][b]`, `b <= a`, of the symmetric `3 N x 3 N` matrix; those above the diagonal are not set.
pub(super) type Blocks<const N: usize> = [[Matrix3<f64>; N]; N];

impl Element<8, 8> {
    /// A hexahedron.
    pub(super) fn hexahedron(mesh: &HexMesh, hex: HexIdx, law: Law) -> Self {
        let rest = mesh.corner_positions(hex).map(|corner| corner.coords);
        Self::new(&HEXAHEDRON, mesh.hexes()[hex.index()], rest, law)
    }
}

impl<const N: usize, const Q: usize> Element<N, Q> {
    pub(super) fn new(
        reference: &'static Reference<N, Q>,
        nodes: [NodeIdx; N],
        rest: [Vector3<f64>; N],
        law: Law,
    ) -> Self {
        let points = reference.points.map(|xi| reference.gauss_point(&rest, xi));
        let volume = points.iter().map(|q| q.weight).sum();
        Self { reference, nodes, rest, points, volume, law }
    }

    pub(super) fn nodes(&self) -> &[NodeIdx; N] {
        &self.nodes
    }

    pub(super) fn law(&self) -> &Law {
        &self.law
    }

    pub(super) fn reference(&self) -> &Reference<N, Q> {
        self.reference
    }

    /// `dX/dxi` \[m\] at the centre.
    pub(super) fn jacobian_at_centre(&self) -> Matrix3<f64> {
        jacobian(&self.rest, &(self.reference.shape_gradients)(self.reference.centre))
    }

    /// Position at rest \[m\] of reference coordinates.
    pub(super) fn rest_at(&self, xi: [f64; 3]) -> Vector3<f64> {
        self.rest.iter().zip((self.reference.shapes)(xi)).map(|(x, n)| x * n).sum()
    }

    /// Gauss points with their deformation.
    pub(super) fn points_at(&self, x: &[Vector3<f64>]) -> impl Iterator<Item = (&GaussPoint<N>, Deformation)> {
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
    pub(super) fn gradient(&self, x: &[Vector3<f64>]) -> [Vector3<f64>; N] {
        let state = self.state(x);
        let pressure = self.law.volumetric(state.dilatation).slope;
        let mut forces = [Vector3::zeros(); N];
        for (q, d) in self.points.iter().zip(&state.points) {
            let stress = (self.law.local_stress(d) + self.law.dilatation_gradient(d) * pressure) * q.weight;
            forces.iter_mut().zip(&q.gradients).for_each(|(force, g)| *force += stress * g);
        }
        forces
    }

    /// `d^2 W/dx_a dx_b = sum_q w_q (d^2 psi/dF^2 + U' d^2 J/dF^2)[dN_a/dX, dN_b/dX] + V U'' c_a c_b^T`,
    /// `c_a = sum_q w_q/V C dN_a/dX`.
    pub(super) fn hessian(&self, x: &[Vector3<f64>], projection: Projection) -> Blocks<N> {
        let state = self.state(x);
        let volumetric = self.law.volumetric(state.dilatation);
        let mut blocks = [[Matrix3::zeros(); N]; N];
        let mut mean = [Vector3::zeros(); N];
        for (q, d) in self.points.iter().zip(&state.points) {
            let tangent = Tangent::new(&self.law, d, volumetric.slope, projection);
            tangent.add_blocks(&q.gradients, q.weight, &mut blocks);
            let c = self.law.dilatation_gradient(d) * q.weight;
            mean.iter_mut().zip(&q.gradients).for_each(|(mean, g)| *mean += c * g);
        }
        let curvature = volumetric.curvature(projection) / self.volume;
        for a in 0..N {
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
        deformation(&self.displacements(x), &self.reference.gauss_point(&self.rest, xi).gradients)
    }

    pub(super) fn cauchy_stress(&self, x: &[Vector3<f64>], xi: [f64; 3]) -> Matrix3<f64> {
        let pressure = self.law.volumetric(self.state(x).dilatation).slope;
        let d = self.deformation_at(x, xi);
        let local = self.law.local_stress(&d);
        let local =
            if self.law.model == MaterialModel::Linear { local } else { local * d.f().transpose() / d.jacobian() };
        local + Matrix3::from_diagonal_element(pressure)
    }

    /// Pressure `p + dp` and stresses `S + dS` after a step `v` from `x`, linear in `v`: `dp = U'' dj`, and with `P = F S`,
    /// `dS = F^-1 (dP - dF S)`. Stresses are not finite where `F` is near to singular, and for the linear material.
    pub(super) fn carried(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Carried<Q> {
        let state = self.state(x);
        let volumetric = self.law.volumetric(state.dilatation);
        let steps: [Vector3<f64>; N] = std::array::from_fn(|a| v[self.nodes[a].index()]);
        let changes: [Matrix3<f64>; Q] = std::array::from_fn(|q| gradient(&steps, &self.points[q].gradients));
        let along = |q: usize| self.law.dilatation_gradient(&state.points[q]).dot(&changes[q]) * self.points[q].weight;
        let mean = (0..Q).map(along).sum::<f64>() / self.volume;
        let pressure_step = volumetric.curvature(Projection::Exact) * mean;
        let stresses = std::array::from_fn(|q| {
            let (d, gradients) = (&state.points[q], &self.points[q].gradients);
            let Some((inverse, stress)) = self.second_stress(d, volumetric.slope) else {
                return Matrix3::repeat(f64::NAN);
            };
            let tangent = Tangent::new(&self.law, d, volumetric.slope, Projection::Exact);
            let column = |i: usize| {
                let axis = Vector3::from_fn(|k, _| if k == i { 1.0 } else { 0.0 });
                gradients.iter().zip(&steps).map(|(g, v)| tangent.block(&axis, g) * v).sum::<Vector3<f64>>()
            };
            let change = Matrix3::from_columns(&[column(0), column(1), column(2)])
                + self.law.dilatation_gradient(d) * pressure_step;
            stress + inverse * (change - changes[q] * stress)
        });
        Carried { pressure: volumetric.slope + pressure_step, stresses }
    }

    /// [`Element::hessian`] with the pressure and the stresses of `carried` in place of those at `x`: `U'` is its pressure, and
    /// `sum_q w_q g_a . (S' - S) g_b 1` is added.
    pub(super) fn carried_hessian(&self, x: &[Vector3<f64>], carried: &Carried<Q>) -> Blocks<N> {
        let state = self.state(x);
        let mut blocks = [[Matrix3::zeros(); N]; N];
        let mut mean = [Vector3::zeros(); N];
        for ((q, d), stress) in self.points.iter().zip(&state.points).zip(&carried.stresses) {
            let tangent = Tangent::new(&self.law, d, carried.pressure, Projection::Exact);
            tangent.add_blocks(&q.gradients, q.weight, &mut blocks);
            let c = self.law.dilatation_gradient(d) * q.weight;
            mean.iter_mut().zip(&q.gradients).for_each(|(mean, g)| *mean += c * g);
            let here = self.second_stress(d, carried.pressure);
            let Some((_, here)) = here.filter(|_| stress.iter().all(|s| s.is_finite())) else { continue };
            let difference = (stress - here) * q.weight;
            for a in 0..N {
                for b in 0..=a {
                    let stiffness = q.gradients[a].dot(&(difference * q.gradients[b]));
                    blocks[a][b] += Matrix3::from_diagonal_element(stiffness);
                }
            }
        }
        let curvature = self.law.volumetric(state.dilatation).curvature(Projection::Exact) / self.volume;
        for a in 0..N {
            for b in 0..=a {
                blocks[a][b] += mean[a] * (mean[b] * curvature).transpose();
            }
        }
        blocks
    }

    /// `F^-1`, and `S = F^-1 P` made symmetric to rounding; `None` where `F` is near to singular, and for the linear material.
    fn second_stress(&self, d: &Deformation, pressure: f64) -> Option<(Matrix3<f64>, Matrix3<f64>)> {
        if self.law.model == MaterialModel::Linear || d.jacobian() < LEAST_JACOBIAN {
            return None;
        }
        let inverse = d.f().try_inverse()?;
        let stress = inverse * (self.law.local_stress(d) + self.law.dilatation_gradient(d) * pressure);
        Some((inverse, (stress + stress.transpose()) * 0.5))
    }

    fn state(&self, x: &[Vector3<f64>]) -> State<Q> {
        let u = self.displacements(x);
        let points: [Deformation; Q] = std::array::from_fn(|q| deformation(&u, &self.points[q].gradients));
        let sum: f64 = points.iter().zip(&self.points).map(|(d, q)| q.weight * self.law.dilatation(d)).sum();
        State { points, dilatation: sum / self.volume }
    }

    fn displacements(&self, x: &[Vector3<f64>]) -> [Vector3<f64>; N] {
        std::array::from_fn(|a| x[self.nodes[a].index()] - self.rest[a])
    }
}

impl<const N: usize, const Q: usize> Reference<N, Q> {
    fn gauss_point(&self, rest: &[Vector3<f64>; N], xi: [f64; 3]) -> GaussPoint<N> {
        let by_xi = (self.shape_gradients)(xi);
        let jacobian = jacobian(rest, &by_xi);
        let inverse = jacobian.try_inverse().unwrap_or_else(Matrix3::zeros);
        let gradients = by_xi.map(|g| inverse.tr_mul(&Vector3::from(g)));
        GaussPoint { gradients, weight: jacobian.determinant() * self.weight }
    }
}

/// `dX/dxi = sum_a X_a (dN_a/dxi)^T`.
fn jacobian<const N: usize>(rest: &[Vector3<f64>; N], by_xi: &[[f64; 3]; N]) -> Matrix3<f64> {
    rest.iter().zip(by_xi).fold(Matrix3::zeros(), |sum, (x, g)| sum + x * Vector3::from(*g).transpose())
}

/// `G = sum_a u_a (dN_a/dX)^T`.
fn deformation<const N: usize>(u: &[Vector3<f64>; N], gradients: &[Vector3<f64>; N]) -> Deformation {
    Deformation::new(gradient(u, gradients))
}

fn gradient<const N: usize>(u: &[Vector3<f64>; N], gradients: &[Vector3<f64>; N]) -> Matrix3<f64> {
    u.iter().zip(gradients).fold(Matrix3::zeros(), |sum, (u, g)| sum + u * g.transpose())
}
