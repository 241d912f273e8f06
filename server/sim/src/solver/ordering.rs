//! Internal numbering of nodes: free nodes first, layer by layer along the object, then fixed nodes.

use plica_geometry::HexMesh;

/// Free nodes in layers such that only equal and neighbouring layers are coupled; fixed nodes follow.
#[derive(Debug, Clone)]
pub(crate) struct NodeOrder {
    /// Mesh node of each internal node, `[n_nodes]`.
    pub(crate) mesh_of_internal: Vec<u32>,
    /// Internal node of each mesh node, `[n_nodes]`.
    pub(crate) internal_of_mesh: Vec<u32>,
    /// First internal node of each layer, and the number of free nodes as the last entry.
    pub(crate) layer_starts: Vec<usize>,
}

impl NodeOrder {
    /// Breadth-first layers from the end of the longest axis, as in Cuthill-McKee orderings.
    pub(crate) fn new(mesh: &HexMesh, fixed: &[bool]) -> Self {
        let neighbours = neighbours(mesh);
        let mut layer_of = vec![usize::MAX; mesh.n_nodes()];
        let mut layers: Vec<Vec<usize>> = Vec::new();
        loop {
            let mut layer = end_nodes(mesh, |n| !fixed[n] && layer_of[n] == usize::MAX);
            if layer.is_empty() {
                break;
            }
            while !layer.is_empty() {
                layer.iter().for_each(|&n| layer_of[n] = layers.len());
                let mut next: Vec<usize> = layer
                    .iter()
                    .flat_map(|&n| &neighbours[n])
                    .copied()
                    .filter(|&m| !fixed[m] && layer_of[m] == usize::MAX)
                    .collect();
                next.sort_unstable();
                next.dedup();
                layers.push(std::mem::replace(&mut layer, next));
            }
        }
        Self::from_layers(&layers, fixed)
    }

    /// Number of free nodes.
    pub(crate) fn n_free(&self) -> usize {
        *self.layer_starts.last().unwrap_or(&0)
    }

    fn from_layers(layers: &[Vec<usize>], fixed: &[bool]) -> Self {
        let mut layer_starts = vec![0];
        let mut order: Vec<u32> = Vec::with_capacity(fixed.len());
        for layer in layers {
            order.extend(layer.iter().map(|&n| n as u32));
            layer_starts.push(order.len());
        }
        order.extend((0..fixed.len()).filter(|&n| fixed[n]).map(|n| n as u32));
        let mut internal_of_mesh = vec![0; order.len()];
        for (internal, &node) in order.iter().enumerate() {
            internal_of_mesh[node as usize] = internal as u32;
        }
        Self { mesh_of_internal: order, internal_of_mesh, layer_starts }
    }
}

/// Nodes that share a hexahedron with each node.
fn neighbours(mesh: &HexMesh) -> Vec<Vec<usize>> {
    let mut sets = vec![Vec::new(); mesh.n_nodes()];
    for hex in mesh.hexes() {
        for a in hex {
            sets[a.index()].extend(hex.iter().map(|b| b.index()));
        }
    }
    for set in &mut sets {
        set.sort_unstable();
        set.dedup();
    }
    sets
}

/// The candidates at the low end of the longest axis of their bounding box.
fn end_nodes(mesh: &HexMesh, is_candidate: impl Fn(usize) -> bool) -> Vec<usize> {
    let candidates: Vec<usize> = (0..mesh.n_nodes()).filter(|&n| is_candidate(n)).collect();
    let extent = |axis: usize| {
        let values = candidates.iter().map(|&n| mesh.nodes()[n][axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
    };
    let axis = (0..3)
        .max_by(|&a, &b| {
            let length = |axis| extent(axis).1 - extent(axis).0;
            length(a).total_cmp(&length(b))
        })
        .unwrap_or(0);
    let (low, high) = extent(axis);
    let tolerance = 1e-6 * (high - low);
    candidates.into_iter().filter(|&n| mesh.nodes()[n][axis] <= low + tolerance).collect()
}
