//! Hexahedra that hang together by an edge or a corner only.

use super::faces::{FaceOfHex, faces};
use super::grid::{join, root};
use crate::hex_mesh::HexMesh;

/// Nodes at which hexahedra meet without sharing a face.
pub(super) struct Hinges {
    /// Between parts that share no face anywhere.
    pub(super) hinged: Vec<u32>,
    /// Within a part.
    pub(super) pinched: Vec<u32>,
    pub(super) n_parts: usize,
}

/// Parts are hexahedra joined by faces. Around a node, those of its hexahedra belong together that share a face with this node.
pub(super) fn find(mesh: &HexMesh, first_of_node: &[u32]) -> Hinges {
    let n_hexes = mesh.n_hexes() as u32;
    let mut parts: Vec<u32> = (0..n_hexes).collect();
    // Corner `k` of hexahedron `h` is item `8 h + k`: corners at one node, joined across faces.
    let mut fans: Vec<u32> = (0..8 * n_hexes).collect();
    let corner = |hex: u32, node: u32| {
        let at = mesh.hexes()[hex as usize].iter().position(|n| first_of_node[n.index()] == node);
        at.map(|k| 8 * hex + k as u32)
    };
    let faces = faces(mesh, first_of_node);
    for shared in faces.chunk_by(|a, b| a.nodes == b.nodes) {
        for pair in shared.windows(2) {
            let [FaceOfHex { nodes, hex: a, .. }, FaceOfHex { hex: b, .. }] = pair else { continue };
            join(&mut parts, *a, *b);
            for &node in nodes {
                if let (Some(one), Some(other)) = (corner(*a, node), corner(*b, node)) {
                    join(&mut fans, one, other);
                }
            }
        }
    }
    let mut fan_of_node: Vec<Option<u32>> = vec![None; mesh.n_nodes()];
    let (mut hinged, mut pinched) = (Vec::new(), Vec::new());
    for (item, node) in (0..).zip(mesh.hexes().iter().flatten()) {
        let node = first_of_node[node.index()];
        let fan = root(&mut fans, item);
        match fan_of_node[node as usize] {
            None => fan_of_node[node as usize] = Some(fan),
            Some(first) if first == fan => {}
            Some(first) => {
                let is_one_part = root(&mut parts, first / 8) == root(&mut parts, item / 8);
                if is_one_part { pinched.push(node) } else { hinged.push(node) }
            }
        }
    }
    let n_parts = (0..n_hexes).filter(|&hex| root(&mut parts, hex) == hex).count();
    for nodes in [&mut hinged, &mut pinched] {
        nodes.sort_unstable();
        nodes.dedup();
    }
    pinched.retain(|node| hinged.binary_search(node).is_err());
    Hinges { hinged, pinched, n_parts }
}
