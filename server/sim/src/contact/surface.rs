//! Topology of the skin for contact detection: edges and triangles by cluster, rest geometry, effective masses.

use plica_geometry::{CLUSTER_SIZE, Skin};

use super::V3;
use crate::embedding::SkinPositions;

/// Constant tables of the skin.
#[derive(Debug, Clone)]
pub(crate) struct SkinSurface {
    pub(crate) rest: Vec<V3>,
    /// Area share of each vertex \[m2\].
    pub(crate) vertex_areas: Vec<f32>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) edges: Vec<[u32; 2]>,
    /// The two triangles of each edge.
    pub(crate) edge_triangles: Vec<[u32; 2]>,
    /// Triangles around each vertex, `vertex_triangle_starts[v]..vertex_triangle_starts[v + 1]`.
    vertex_triangle_starts: Vec<u32>,
    vertex_triangles: Vec<u32>,
    /// Edges and triangles whose first vertex lies in each cluster, as index ranges into the two lists below.
    cluster_edges: Vec<Vec<u32>>,
    cluster_triangles: Vec<Vec<u32>>,
    /// Longest edge at rest of each cluster's edges and triangles \[m\].
    cluster_longest_edge: Vec<f32>,
    /// Length of each edge at rest \[m\].
    pub(crate) edge_lengths: Vec<f32>,
    /// `tr(J A_0^-1 J^T) / 3` of each vertex \[1/kg\].
    pub(crate) inverse_mass: Vec<f32>,
    /// Static stiffness of each vertex \[N/m\].
    pub(crate) static_stiffness: Vec<f32>,
}

impl SkinSurface {
    /// `inverse_mass` and `static_stiffness` are `[n_skin]`.
    pub(crate) fn new(skin: &Skin, inverse_mass: Vec<f32>, static_stiffness: Vec<f32>) -> Self {
        let rest: Vec<V3> = skin.positions().iter().map(|p| p.coords.cast()).collect();
        let triangles: Vec<[u32; 3]> = skin.triangles().iter().map(|t| t.map(|v| v.0)).collect();
        let edges: Vec<[u32; 2]> = skin.edges().iter().map(|e| e.map(|v| v.0)).collect();
        let n_clusters = rest.len().div_ceil(CLUSTER_SIZE);
        let mut edge_triangles = vec![[u32::MAX; 2]; edges.len()];
        for (t, sides) in skin.triangle_edges().iter().enumerate() {
            for &e in sides {
                let slot = usize::from(edge_triangles[e as usize][0] != u32::MAX);
                edge_triangles[e as usize][slot] = t as u32;
            }
        }
        let mut around = vec![Vec::new(); rest.len()];
        let mut cluster_triangles = vec![Vec::new(); n_clusters];
        for (t, corners) in triangles.iter().enumerate() {
            corners.iter().for_each(|&v| around[v as usize].push(t as u32));
            cluster_triangles[corners[0] as usize / CLUSTER_SIZE].push(t as u32);
        }
        let mut cluster_edges = vec![Vec::new(); n_clusters];
        for (e, ends) in edges.iter().enumerate() {
            cluster_edges[ends[0] as usize / CLUSTER_SIZE].push(e as u32);
        }
        let mut vertex_triangle_starts = vec![0];
        for list in &around {
            vertex_triangle_starts.push(vertex_triangle_starts[vertex_triangle_starts.len() - 1] + list.len() as u32);
        }
        let length = |e: &[u32; 2]| (rest[e[0] as usize] - rest[e[1] as usize]).norm();
        let edge_lengths: Vec<f32> = edges.iter().map(length).collect();
        let mut cluster_longest_edge = vec![0.0_f32; n_clusters];
        for (t, sides) in skin.triangle_edges().iter().enumerate() {
            let longest = sides.iter().map(|&e| edge_lengths[e as usize]).fold(0.0, f32::max);
            for v in triangles[t] {
                let cluster = &mut cluster_longest_edge[v as usize / CLUSTER_SIZE];
                *cluster = cluster.max(longest);
            }
        }
        Self {
            cluster_longest_edge,
            edge_lengths,
            vertex_areas: skin.vertex_areas().iter().map(|&a| a as f32).collect(),
            vertex_triangles: around.concat(),
            rest,
            triangles,
            edges,
            edge_triangles,
            vertex_triangle_starts,
            cluster_edges,
            cluster_triangles,
            inverse_mass,
            static_stiffness,
        }
    }

    /// Longest edge at rest of the triangles at a cluster's vertices \[m\].
    pub(crate) fn longest_edge(&self, cluster: usize) -> f32 {
        self.cluster_longest_edge[cluster]
    }

    pub(crate) fn edges_of_cluster(&self, cluster: usize) -> &[u32] {
        &self.cluster_edges[cluster]
    }

    pub(crate) fn triangles_of_cluster(&self, cluster: usize) -> &[u32] {
        &self.cluster_triangles[cluster]
    }

    pub(crate) fn triangles_around(&self, vertex: usize) -> &[u32] {
        &self.vertex_triangles
            [self.vertex_triangle_starts[vertex] as usize..self.vertex_triangle_starts[vertex + 1] as usize]
    }

    /// Outward normal of a deformed triangle, not normalised.
    pub(crate) fn triangle_normal(&self, skin: &SkinPositions, triangle: usize) -> V3 {
        let [a, b, c] = self.corners(skin, triangle);
        (b - a).cross(&(c - a))
    }

    /// Deformed corners of a triangle \[m\].
    pub(crate) fn corners(&self, skin: &SkinPositions, triangle: usize) -> [V3; 3] {
        self.triangles[triangle].map(|v| V3::from(skin.vertex(v as usize)))
    }
}
