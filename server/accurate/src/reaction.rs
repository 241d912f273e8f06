//! Reaction forces of supports.

use nalgebra::Vector3;

use crate::energy::Energy;

/// Gradient of the sum of `energies` \[N\], `[n_nodes]`: at given coordinates of an equilibrium the force that holds them, at
/// free ones 0 up to the residual.
pub fn reactions(energies: &[&dyn Energy], x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut forces = vec![Vector3::zeros(); x.len()];
    energies.iter().for_each(|energy| energy.add_gradient(x, &mut forces));
    forces
}
