//! Forces per volume, such as weight.

use nalgebra::Vector3;
use plica_geometry::{HexIdx, HexMesh, NodeIdx, isoparametric};

use super::NodalForces;
use crate::solid::GAUSS_POINTS;

/// Dead forces of a force per rest volume, `f_a = int N_a b dV` by 2 x 2 x 2 Gauss points; `hexes` with `b` \[N/m^3\] of each.
///
/// # Panics
/// If a hexahedron is not of the mesh.
pub fn body_forces(mesh: &HexMesh, hexes: impl IntoIterator<Item = (HexIdx, Vector3<f64>)>) -> NodalForces {
    let mut forces = vec![Vector3::zeros(); mesh.n_nodes()];
    for (hex, per_volume) in hexes {
        let corners = mesh.corner_positions(hex);
        for xi in GAUSS_POINTS {
            let volume = isoparametric::jacobian(&corners, xi).determinant();
            for (node, share) in mesh.hexes()[hex.index()].iter().zip(isoparametric::shape_functions(xi)) {
                forces[node.index()] += per_volume * (share * volume);
            }
        }
    }
    let loaded = forces.into_iter().enumerate().filter(|(_, force)| *force != Vector3::zeros());
    NodalForces::new(loaded.map(|(node, force)| (NodeIdx::from_index(node), force)).collect())
}
