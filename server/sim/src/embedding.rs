//! Node displacements to skin positions, `s = s_rest + A u` [KMBG09], 64 vertices at a time.
//!
//! The vertices of a cluster share one node list, so a node's displacement is loaded once for 64 rows: four to five times
//! faster than a sparse row per vertex. Contact rows use the same weights, one sparse row per vertex.

use plica_geometry::{CLUSTER_SIZE, Embedding, Skin};

use crate::lanes::{F, LANES, Node};

/// Vertices per inner kernel: six accumulators stay in registers.
const STRIP: usize = 2 * LANES;
const STRIPS: usize = CLUSTER_SIZE / STRIP;
/// Vectors per axis and cluster.
const GROUPS: usize = CLUSTER_SIZE / LANES;

/// Interpolation from internal nodes to the skin. Fixed nodes never move and are left out.
#[derive(Debug, Clone)]
pub(crate) struct SkinEmbedding {
    n_skin: usize,
    clusters: Vec<Cluster>,
    /// First entry of each vertex's sparse row, `[n_skin + 1]`.
    row_starts: Vec<u32>,
    row_nodes: Vec<u32>,
    row_weights: Vec<f32>,
}

#[derive(Debug, Clone)]
struct Cluster {
    nodes: Vec<u32>,
    /// `[strip][node][STRIP]`
    weights: Vec<[F; STRIP / LANES]>,
    rest: [[F; GROUPS]; 3],
}

/// Deformed skin, structure of arrays per cluster, with a bounding box each.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SkinPositions {
    /// World positions `[n_clusters][axis][group]` [m]; padding repeats the last vertex.
    positions: Vec<[[F; GROUPS]; 3]>,
    /// Low and high corner of each cluster [m].
    boxes: Vec<[[f32; 3]; 2]>,
}

impl SkinEmbedding {
    pub(crate) fn new(skin: &Skin, embedding: &Embedding, internal_of_mesh: &[u32], n_free: usize) -> Self {
        let n_skin = skin.n_vertices();
        let free_row = |v: usize| -> Vec<(u32, f32)> {
            let row = embedding.row(v).iter().map(|&(n, w)| (internal_of_mesh[n.index()], w as f32));
            row.filter(|&(n, _)| (n as usize) < n_free).collect()
        };
        let rows: Vec<Vec<(u32, f32)>> = (0..n_skin).map(free_row).collect();
        let row_starts = std::iter::once(0)
            .chain(rows.iter().scan(0, |sum, row| {
                *sum += row.len() as u32;
                Some(*sum)
            }))
            .collect();
        let clusters = (0..n_skin).step_by(CLUSTER_SIZE).map(|first| Cluster::new(skin, &rows, first)).collect();
        Self {
            n_skin,
            clusters,
            row_starts,
            row_nodes: rows.iter().flatten().map(|e| e.0).collect(),
            row_weights: rows.iter().flatten().map(|e| e.1).collect(),
        }
    }

    /// Nodes and weights of one vertex.
    #[inline(always)]
    pub(crate) fn row(&self, vertex: usize) -> (&[u32], &[f32]) {
        let range = self.row_starts[vertex] as usize..self.row_starts[vertex + 1] as usize;
        (&self.row_nodes[range.clone()], &self.row_weights[range])
    }

    pub(crate) fn n_skin(&self) -> usize {
        self.n_skin
    }

    /// Bytes that one application reads and writes.
    pub(crate) fn bytes(&self) -> usize {
        let weights: usize = self.clusters.iter().map(|c| size_of_val(c.weights.as_slice()) + 4 * c.nodes.len()).sum();
        weights + 2 * 12 * CLUSTER_SIZE * self.clusters.len()
    }

    /// `s = s_rest + A u`
    pub(crate) fn apply(&self, u: &[Node], out: &mut SkinPositions) {
        for ((cluster, positions), bounds) in self.clusters.iter().zip(&mut out.positions).zip(&mut out.boxes) {
            cluster.apply(u, positions);
            *bounds = bounding_box(positions);
        }
    }

    /// World positions in published order, `[n_skin]` [m].
    pub(crate) fn copy_positions(&self, skin: &SkinPositions, out: &mut [[f32; 3]]) {
        for (chunk, cluster) in out[..self.n_skin].chunks_mut(CLUSTER_SIZE).zip(&skin.positions) {
            copy_axes(cluster, chunk);
        }
    }

    /// Offsets from rest in published order, `[n_skin]` [m].
    pub(crate) fn copy_offsets(&self, skin: &SkinPositions, out: &mut [[f32; 3]]) {
        let clusters = skin.positions.iter().zip(&self.clusters);
        for (chunk, (deformed, cluster)) in out[..self.n_skin].chunks_mut(CLUSTER_SIZE).zip(clusters) {
            let offsets = std::array::from_fn(|k| std::array::from_fn(|g| deformed[k][g] - cluster.rest[k][g]));
            copy_axes(&offsets, chunk);
        }
    }
}

impl SkinPositions {
    /// The skin at rest.
    pub(crate) fn at_rest(embedding: &SkinEmbedding) -> Self {
        let positions: Vec<_> = embedding.clusters.iter().map(|c| c.rest).collect();
        let boxes = positions.iter().map(bounding_box).collect();
        Self { positions, boxes }
    }

    /// Position of a vertex [m].
    #[inline(always)]
    pub(crate) fn vertex(&self, v: usize) -> [f32; 3] {
        let (cluster, lane) = (&self.positions[v / CLUSTER_SIZE], v % CLUSTER_SIZE);
        std::array::from_fn(|k| bytemuck::cast_slice::<F, f32>(&cluster[k])[lane])
    }

    /// Low and high corner of each cluster [m].
    pub(crate) fn boxes(&self) -> &[[[f32; 3]; 2]] {
        &self.boxes
    }

    /// The coordinates of one cluster by axis, `[3][CLUSTER_SIZE]` [m].
    #[inline(always)]
    pub(crate) fn cluster(&self, cluster: usize) -> [&[f32]; 3] {
        std::array::from_fn(|k| bytemuck::cast_slice::<F, f32>(&self.positions[cluster][k]))
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.positions.copy_from_slice(&other.positions);
        self.boxes.copy_from_slice(&other.boxes);
    }
}

impl Cluster {
    fn new(skin: &Skin, rows: &[Vec<(u32, f32)>], first: usize) -> Self {
        let last = rows.len() - 1;
        let vertex_of_lane: [usize; CLUSTER_SIZE] = std::array::from_fn(|lane| (first + lane).min(last));
        let mut nodes: Vec<u32> = vertex_of_lane.iter().flat_map(|&v| rows[v].iter().map(|e| e.0)).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let weight = |vertex: usize, node: u32| rows[vertex].iter().find(|e| e.0 == node).map_or(0.0, |e| e.1);
        let mut weights = Vec::with_capacity(STRIPS * nodes.len());
        for strip in 0..STRIPS {
            for &node in &nodes {
                weights.push(std::array::from_fn(|group| {
                    let first_lane = strip * STRIP + group * LANES;
                    F::new(std::array::from_fn(|lane| weight(vertex_of_lane[first_lane + lane], node)))
                }));
            }
        }
        let rest = std::array::from_fn(|k| {
            std::array::from_fn(|g| {
                F::new(std::array::from_fn(|l| skin.positions()[vertex_of_lane[g * LANES + l]][k] as f32))
            })
        });
        Self { nodes, weights, rest }
    }

    #[inline(always)]
    fn apply(&self, u: &[Node], out: &mut [[F; GROUPS]; 3]) {
        const WIDE: usize = STRIP / LANES;
        for (strip, weights) in self.weights.chunks_exact(self.nodes.len().max(1)).enumerate() {
            let mut sum: [[F; WIDE]; 3] =
                std::array::from_fn(|k| std::array::from_fn(|g| self.rest[k][strip * WIDE + g]));
            for (&node, w) in self.nodes.iter().zip(weights) {
                let displacement = &u[node as usize];
                for k in 0..3 {
                    let uk = F::splat(displacement[k]);
                    for g in 0..WIDE {
                        sum[k][g] = w[g].mul_add(uk, sum[k][g]);
                    }
                }
            }
            for k in 0..3 {
                out[k][strip * WIDE..(strip + 1) * WIDE].copy_from_slice(&sum[k]);
            }
        }
        if self.nodes.is_empty() {
            *out = self.rest;
        }
    }
}

#[inline(always)]
fn bounding_box(positions: &[[F; GROUPS]; 3]) -> [[f32; 3]; 2] {
    let reduce = |axis: &[F; GROUPS], better: fn(F, F) -> F, scalar: fn(f32, f32) -> f32| {
        let lanes = axis.iter().copied().reduce(better).unwrap_or(F::ZERO).to_array();
        lanes.into_iter().reduce(scalar).unwrap_or(0.0)
    };
    [
        std::array::from_fn(|k| reduce(&positions[k], F::fast_min, f32::min)),
        std::array::from_fn(|k| reduce(&positions[k], F::fast_max, f32::max)),
    ]
}

fn copy_axes(cluster: &[[F; GROUPS]; 3], out: &mut [[f32; 3]]) {
    let axes: [&[f32]; 3] = std::array::from_fn(|k| bytemuck::cast_slice(&cluster[k]));
    for (lane, vertex) in out.iter_mut().enumerate() {
        *vertex = [axes[0][lane], axes[1][lane], axes[2][lane]];
    }
}
