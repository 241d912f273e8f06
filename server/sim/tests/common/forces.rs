//! Elastic forces of the run-time element kernels, from one tick short enough to exclude all other effects.

use nalgebra::Vector3;
use plica_sim::*;

use super::{Run, Scene};

/// Length of the tick [s]: `A = M` to seven digits.
const INSTANT_S: f64 = 1e-6;
/// Ticks in which the rotations, one warm step each, reach those of the displacements.
const WARM_UP: usize = 24;

/// A model without dampers and tools, with very short ticks.
pub fn instantaneous(scene: Scene) -> Model {
    let scene = scene.timestep(INSTANT_S).with(|d| {
        d.mass_damping_per_s = 0.0;
        d.solver = SolverOptions { tolerance: 1e-6, max_iterations: 200, ..d.solver };
    });
    Model::new(scene.description).unwrap()
}

/// `f = M v / h` after one tick from rest at these displacements, `[n_nodes]` [N]; zero at fixed nodes.
pub fn elastic_forces(model: &Model, displacements: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut run = Run::new(model.clone());
    for _ in 0..WARM_UP {
        run.state.set_node_displacements(model, displacements);
        run.tick(&[]);
    }
    let masses = node_masses(model.description());
    run.state.node_velocities(model).iter().zip(masses).map(|(v, m)| v * (m / INSTANT_S)).collect()
}

/// Lumped mass of each node, `[n_nodes]` [kg].
pub fn node_masses(d: &ModelDescription) -> Vec<f64> {
    let mut masses = vec![0.0; d.mesh.n_nodes()];
    for (hex, material) in d.mesh.hexes().iter().zip(&d.materials) {
        let shares = lumped_mass(&hex.map(|n| d.mesh.nodes()[n.index()]), material.density_kg_per_m3);
        hex.iter().zip(shares).for_each(|(n, share)| masses[n.index()] += share);
    }
    masses
}
