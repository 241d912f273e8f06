//! Assembly of a Hessian from energies.

use nalgebra::Vector3;

use crate::constraints::Constraints;
use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;

/// All-zero Hessian with the pattern of `energies`.
pub(crate) fn empty_hessian(constraints: &Constraints, energies: &[&dyn Energy]) -> Hessian {
    Hessian::new(constraints, &|visit| energies.iter().for_each(|energy| energy.visit_stencils(visit)))
}

impl Hessian {
    /// Second derivatives of the sum of `energies` at `x: [n_nodes]` \[m\], on the coordinates that are free.
    ///
    /// # Panics
    /// If the lengths of `x` and `constraints` differ.
    pub fn assemble(
        energies: &[&dyn Energy],
        constraints: &Constraints,
        x: &[Vector3<f64>],
        projection: Projection,
    ) -> Self {
        assert_eq!(x.len(), constraints.n_nodes(), "nodes");
        let mut hessian = empty_hessian(constraints, energies);
        energies.iter().for_each(|energy| energy.add_hessian(x, projection, &mut hessian));
        hessian.finish(0.0);
        hessian
    }
}
