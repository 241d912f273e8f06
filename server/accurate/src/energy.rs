//! Potential energies with gradient and Hessian.

use nalgebra::Vector3;
use plica_geometry::NodeIdx;

use crate::hessian::Hessian;

/// Projection of second derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Projection {
    /// The second derivatives as they are.
    Exact,
    /// Replaced, stencil by stencil, by a positive semi-definite matrix nearby \[SGK19\].
    PositiveSemidefinite,
}

/// A potential energy of nodal positions, `x: [n_nodes]` \[m\]; value in \[J\], gradient in \[N\], Hessian in \[N/m\].
///
/// The gradient is the derivative of the value and the Hessian that of the gradient; a shared harness checks both by finite
/// differences. [`Energy::has_potential`] is false for loads without a potential.
pub trait Energy {
    /// Calls `visit` with the nodes of every stencil, the nodes whose second derivatives may couple for some `x`.
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx]));

    /// The energy \[J\]; infinite where `x` is not admissible (an inverted element of a material that forbids it).
    fn value(&self, x: &[Vector3<f64>]) -> f64;

    /// Adds the derivative of the value \[N\], `[n_nodes]`.
    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]);

    /// Adds the second derivatives \[N/m\].
    fn add_hessian(&self, x: &[Vector3<f64>], projection: Projection, hessian: &mut Hessian);

    /// Whether the gradient is the derivative of the value. A load without a potential has the value 0, and its Hessian is
    /// a symmetric part of the gradient's derivative; [`Energy::add_remainder_product`] has the rest.
    fn has_potential(&self) -> bool {
        true
    }

    /// Adds `(D - H) v` \[N\] for `v: [n_nodes]` \[m\], of loads without a potential: `D` is the derivative of the gradient,
    /// `H` the matrix of [`Energy::add_hessian`] under the same `projection`.
    fn add_remainder_product(
        &self,
        _x: &[Vector3<f64>],
        _v: &[Vector3<f64>],
        _projection: Projection,
        _product: &mut [Vector3<f64>],
    ) {
    }

    /// Stresses and pressures after a step `v: [n_nodes]` \[m\] from `x`, linear in the step, for
    /// [`Energy::add_carried_hessian`]: numbers that may be added and scaled. Empty for energies without any.
    fn carried_stresses(&self, _x: &[Vector3<f64>], _v: &[Vector3<f64>]) -> Vec<f64> {
        Vec::new()
    }

    /// Adds the second derivatives \[N/m\] with stresses that do not belong to `x`: the exact ones where `carried` is empty.
    fn add_carried_hessian(&self, x: &[Vector3<f64>], _carried: &[f64], hessian: &mut Hessian) {
        self.add_hessian(x, Projection::Exact, hessian);
    }

    /// Smallest `det F` over the integration points, for energies that have any.
    fn smallest_jacobian(&self, _x: &[Vector3<f64>]) -> Option<f64> {
        None
    }

    /// Rest positions of all nodes \[m\], for energies that have them: the solver orders its unknowns by them.
    fn rest_positions(&self) -> Option<&[Vector3<f64>]> {
        None
    }
}
