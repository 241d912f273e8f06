//! Which of many vertices of a convex polytope lies farthest in a direction: a walk along edges.
//!
//! Each step goes to the neighbour that lies farther, until none does. On a convex polytope no other vertex then does, but for
//! rounding, so a hull of thousands of points costs a few dozen products.

use super::V3;

/// Vertices that a walk may begin from.
const STARTS: usize = 24;

/// Vertices with their neighbours along edges.
#[derive(Debug, Clone)]
pub(super) struct VertexGraph {
    /// Spread over the polytope.
    starts: Vec<u32>,
    /// The neighbours of vertex `v` are `neighbours[first[v]..first[v + 1]]`.
    first: Vec<u32>,
    neighbours: Vec<u32>,
}

impl VertexGraph {
    pub(super) fn new(vertices: &[V3], triangles: &[[usize; 3]]) -> Self {
        let sides = |t: &[usize; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        let mut edges: Vec<[u32; 2]> =
            triangles.iter().flat_map(sides).flat_map(|[a, b]| [[a as u32, b as u32], [b as u32, a as u32]]).collect();
        edges.sort_unstable();
        edges.dedup();
        let first = (0..=vertices.len() as u32).map(|v| edges.partition_point(|edge| edge[0] < v) as u32).collect();
        let neighbours = edges.iter().map(|edge| edge[1]).collect();
        Self { starts: spread(vertices), first, neighbours }
    }

    /// The vertex with the largest `d . v`, but for rounding.
    pub(super) fn farthest(&self, vertices: &[V3], d: &V3) -> u32 {
        let value = |v: &u32| d.dot(&vertices[*v as usize]);
        let mut at = self.starts.iter().copied().max_by(|a, b| value(a).total_cmp(&value(b))).unwrap_or(0);
        let mut best = value(&at);
        loop {
            let around = self.first[at as usize] as usize..self.first[at as usize + 1] as usize;
            let before = at;
            for &next in &self.neighbours[around] {
                if value(&next) > best {
                    (best, at) = (value(&next), next);
                }
            }
            if at == before {
                return at;
            }
        }
    }
}

/// Vertices each of which is the farthest from those before it.
fn spread(vertices: &[V3]) -> Vec<u32> {
    let mut nearest = vec![f32::INFINITY; vertices.len()];
    let mut chosen = Vec::new();
    for _ in 0..STARTS.min(vertices.len()) {
        let farthest = (0..vertices.len()).max_by(|a, b| nearest[*a].total_cmp(&nearest[*b])).unwrap_or(0);
        chosen.push(farthest as u32);
        for (distance, v) in nearest.iter_mut().zip(vertices) {
            *distance = distance.min((v - vertices[farthest]).norm_squared());
        }
    }
    chosen
}
