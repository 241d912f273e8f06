//! Nodes that may carry weight at a point: near it, and connected to it through the mesh.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Point3;

use crate::hex_mesh::HexMesh;
use crate::index::{HexIdx, NodeIdx};

/// Finds the nodes within a radius of a point along the mesh.
pub(crate) struct Neighbourhoods<'a> {
    mesh: &'a HexMesh,
    neighbours: Vec<Vec<NodeIdx>>,
    radius_m: f64,
    seen: Vec<bool>,
    queue: BinaryHeap<Reached>,
}

impl<'a> Neighbourhoods<'a> {
    pub(crate) fn new(mesh: &'a HexMesh, radius_m: f64) -> Self {
        let (neighbours, seen) = (mesh.node_neighbours(), vec![false; mesh.n_nodes()]);
        Self { mesh, neighbours, radius_m, seen, queue: BinaryHeap::new() }
    }

    /// Nodes within the radius of `x` with their chain distance \[m\], in increasing order of node.
    ///
    /// `d_a = min over chains (b_0, .., b_k = a) of max_j |x - x_(b_j)|`
    ///
    /// where a chain starts at a corner of `hex`, the hexahedron that contains `x`, and successive nodes share a
    /// hexahedron. Wherever the mesh is convex this is the plain distance `|x - x_a|`; across a gap it is the
    /// distance to the far end of the gap, so that nodes on the other side count only where the joint itself is
    /// within the radius, and they enter with weight zero.
    pub(crate) fn around(&mut self, x: &Point3<f64>, hex: HexIdx) -> Vec<(NodeIdx, f64)> {
        let mut found: Vec<(NodeIdx, f64)> = Vec::new();
        for node in self.mesh.hexes()[hex.index()] {
            self.reach(x, node, 0.0);
        }
        while let Some(Reached { distance_m, node }) = self.queue.pop() {
            if std::mem::replace(&mut self.seen[node.index()], true) {
                continue;
            }
            found.push((node, distance_m));
            for i in 0..self.neighbours[node.index()].len() {
                self.reach(x, self.neighbours[node.index()][i], distance_m);
            }
        }
        found.iter().for_each(|(node, _)| self.seen[node.index()] = false);
        found.sort_unstable_by_key(|&(node, _)| node);
        found
    }

    fn reach(&mut self, x: &Point3<f64>, node: NodeIdx, chain_m: f64) {
        let distance_m = (x - self.mesh.nodes()[node.index()]).norm().max(chain_m);
        if distance_m < self.radius_m && !self.seen[node.index()] {
            self.queue.push(Reached { distance_m, node });
        }
    }
}

/// A node at the end of a chain; the nearest leaves the queue first, ties by node.
#[derive(PartialEq)]
struct Reached {
    distance_m: f64,
    node: NodeIdx,
}

impl Eq for Reached {}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance_m.total_cmp(&self.distance_m).then_with(|| other.node.cmp(&self.node))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
