//! Forces per volume, such as weight.

use nalgebra::Vector3;
use plica_geometry::{ElementIdx, HexIdx, HexMesh, NodeIdx, TetMesh, VolumeMesh, isoparametric, tetrahedron};

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
    nodal(forces)
}

/// The same on elements of any kind; on tetrahedra by 4 Gauss points.
///
/// # Panics
/// If an element is not of the mesh.
pub fn volume_forces(mesh: &VolumeMesh, elements: impl IntoIterator<Item = (ElementIdx, Vector3<f64>)>) -> NodalForces {
    match mesh {
        VolumeMesh::Hexahedra(mesh) => {
            body_forces(mesh, elements.into_iter().map(|(element, force)| (HexIdx(element.0), force)))
        }
        VolumeMesh::Tetrahedra(mesh) => on_tetrahedra(mesh, elements),
    }
}

fn on_tetrahedra(mesh: &TetMesh, tets: impl IntoIterator<Item = (ElementIdx, Vector3<f64>)>) -> NodalForces {
    let mut forces = vec![Vector3::zeros(); mesh.n_nodes()];
    for (tet, per_volume) in tets {
        let (nodes, positions) = (mesh.nodes_of(tet), mesh.positions_of(tet));
        for xi in tetrahedron::QUADRATURE {
            let volume = tetrahedron::jacobian(&positions, xi).determinant() / 24.0;
            for (node, share) in nodes.iter().zip(tetrahedron::shapes(nodes.len(), xi)) {
                forces[node.index()] += per_volume * (share * volume);
            }
        }
    }
    nodal(forces)
}

/// The forces that are not 0.
fn nodal(forces: Vec<Vector3<f64>>) -> NodalForces {
    let loaded = forces.into_iter().enumerate().filter(|(_, force)| *force != Vector3::zeros());
    NodalForces::new(loaded.map(|(node, force)| (NodeIdx::from_index(node), force)).collect())
}
