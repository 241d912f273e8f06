//! Guard against elements that turn over.

use nalgebra::Vector3;
use plica_geometry::NodeIdx;

use super::element::Element;
use super::{Elements, Solid, with_elements};
use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;
use crate::material::Tangent;

/// `W = sum_q w_q k/(3 J_0) max(0, J_0 - J_q)^3`, `k` being `stiffness_ratio` times the shear modulus of the element: 0 where no
/// Gauss point is compressed below `J_0`.
///
/// An element with mean dilatation keeps its volume and may all the same turn over at one corner, as at the rim of a tie, where
/// half a face is held and half is free. The stable Neo-Hookean material allows it at a finite energy; a body does not. The
/// guard is smooth, twice over, and finite for every `x`, so that a solve may begin with elements turned over.
#[derive(Debug, Clone, Copy)]
pub struct TurnGuard<'a> {
    /// Elements.
    pub solid: &'a Solid,
    /// `J_0`, relative volume of a Gauss point at which the guard begins.
    pub floor: f64,
    /// Stiffness over the shear modulus.
    pub stiffness_ratio: f64,
}

impl Energy for TurnGuard<'_> {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.solid.visit_stencils(visit);
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        with_elements!(&self.solid.elements, list => list.iter().map(|element| self.element_value(element, x)).sum())
    }

    /// `dW/dx_a = -sum_q w_q k/J_0 (J_0 - J)^2 C dN_a/dX`, `C = dJ/dF`.
    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        with_elements!(&self.solid.elements, list => list.iter().for_each(|e| self.add_element_gradient(e, x, gradient)));
    }

    /// `sum_q w_q (2 k/J_0 (J_0 - J) C (x) C - k/J_0 (J_0 - J)^2 d^2 J/dF^2)`.
    fn add_hessian(&self, x: &[Vector3<f64>], projection: Projection, hessian: &mut Hessian) {
        with_elements!(&self.solid.elements, list => {
            list.iter().for_each(|e| self.add_element_hessian(e, x, projection, hessian));
        });
    }
}

impl TurnGuard<'_> {
    /// `k/J_0` \[Pa\]
    fn factor<const N: usize, const Q: usize>(&self, element: &Element<N, Q>) -> f64 {
        self.stiffness_ratio * element.shear_modulus() / self.floor
    }

    fn element_value<const N: usize, const Q: usize>(&self, element: &Element<N, Q>, x: &[Vector3<f64>]) -> f64 {
        let cubes = element.points_at(x).map(|(point, d)| point.weight * (self.floor - d.jacobian()).max(0.0).powi(3));
        self.factor(element) / 3.0 * cubes.sum::<f64>()
    }

    fn add_element_gradient<const N: usize, const Q: usize>(
        &self,
        element: &Element<N, Q>,
        x: &[Vector3<f64>],
        gradient: &mut [Vector3<f64>],
    ) {
        for (point, d) in element.points_at(x).filter(|(_, d)| d.jacobian() < self.floor) {
            let slope = -self.factor(element) * (self.floor - d.jacobian()).powi(2);
            let stress = d.cofactor() * (point.weight * slope);
            let nodes = element.nodes().iter().zip(&point.gradients);
            nodes.for_each(|(node, g)| gradient[node.index()] += stress * g);
        }
    }

    fn add_element_hessian<const N: usize, const Q: usize>(
        &self,
        element: &Element<N, Q>,
        x: &[Vector3<f64>],
        projection: Projection,
        hessian: &mut Hessian,
    ) {
        let factor = self.factor(element);
        for (point, d) in element.points_at(x).filter(|(_, d)| d.jacobian() < self.floor) {
            let depth = self.floor - d.jacobian();
            let tangent = Tangent::of_volume(&d, -factor * depth * depth, 2.0 * factor * depth, projection);
            let block = |a: usize, b: usize| tangent.block(&point.gradients[a], &point.gradients[b]) * point.weight;
            hessian.add_stencil(element.nodes(), block);
        }
    }
}
