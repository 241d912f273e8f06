//! Node displacements to skin positions, `s = s_rest + A u` \[KMBG09\], 64 vertices at a time.
//!
//! The vertices of half a cluster share one node list, so a node's displacement is loaded once for 32 rows: four to five
//! times faster than a sparse row per vertex. Weights are 16-bit fixed-point, which halves what is read: the stage is bound by
//! memory. The rounding is at most 2.3e-5 of a displacement per weight, and a row keeps its sum to within that. Contact
//! rows use the same rounded weights, one sparse row per vertex.

use plica_geometry::{CLUSTER_SIZE, Embedding, Skin};

use crate::lanes::{F, LANES, Node};
use wide::{i16x16, i32x16};

/// Vertices per inner kernel: six accumulators stay in registers.
const STRIP: usize = if cfg!(target_feature = "avx512f") { 4 } else { 2 } * LANES;
const STRIPS: usize = CLUSTER_SIZE / STRIP;
/// Vectors per axis and strip.
const WIDE: usize = STRIP / LANES;
/// Vectors per axis and cluster.
const GROUPS: usize = CLUSTER_SIZE / LANES;

/// Interpolation from internal nodes to the skin. Fixed nodes never move and are left out.
#[derive(Debug, Clone)]
pub(crate) struct SkinEmbedding {
    n_skin: usize,
    /// Weight of one unit of the fixed-point tables.
    unit: f32,
    clusters: Vec<Cluster>,
    /// First entry of each vertex's sparse row, `[n_skin + 1]`.
    row_starts: Vec<u32>,
    row_nodes: Vec<u32>,
    row_weights: Vec<f32>,
}

#[derive(Debug, Clone)]
struct Cluster {
    strips: [Strip; STRIPS],
    rest: [[F; GROUPS]; 3],
}

/// Vertices that share a node list.
#[derive(Debug, Clone)]
struct Strip {
    nodes: Vec<u32>,
    /// `[node][STRIP]`, in units of the embedding's `unit`.
    weights: Vec<[i16x16; WIDE]>,
}

/// Deformed skin, structure of arrays per cluster, with a bounding box each.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SkinPositions {
    /// World positions `[n_clusters][axis][group]` \[m\]; padding repeats the last vertex.
    positions: Vec<[[F; GROUPS]; 3]>,
    /// Low and high corner of each cluster \[m\].
    boxes: Vec<[[f32; 3]; 2]>,
}

impl SkinEmbedding {
    pub(crate) fn new(skin: &Skin, embedding: &Embedding, internal_of_mesh: &[u32], n_free: usize) -> Self {
        let n_skin = skin.n_vertices();
        let largest = (0..n_skin).flat_map(|v| embedding.row(v)).map(|e| e.1.abs()).fold(1.0, f64::max);
        let unit = largest / f64::from(i16::MAX);
        let free_row = |v: usize| -> Vec<(u32, i16)> {
            let row = round_keeping_sum(embedding.row(v).iter().map(|e| e.1 / unit));
            let nodes = embedding.row(v).iter().map(|e| internal_of_mesh[e.0.index()]);
            nodes.zip(row).filter(|&(n, w)| (n as usize) < n_free && w != 0).collect()
        };
        let rows: Vec<Vec<(u32, i16)>> = (0..n_skin).map(free_row).collect();
        let row_starts = std::iter::once(0)
            .chain(rows.iter().scan(0, |sum, row| {
                *sum += row.len() as u32;
                Some(*sum)
            }))
            .collect();
        let clusters = (0..n_skin).step_by(CLUSTER_SIZE).map(|first| Cluster::new(skin, &rows, first)).collect();
        Self {
            n_skin,
            unit: unit as f32,
            clusters,
            row_starts,
            row_nodes: rows.iter().flatten().map(|e| e.0).collect(),
            row_weights: rows.iter().flatten().map(|e| f32::from(e.1) * unit as f32).collect(),
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
        let strips = self.clusters.iter().flat_map(|c| &c.strips);
        let weights: usize = strips.map(|s| size_of_val(s.weights.as_slice()) + 4 * s.nodes.len()).sum();
        weights + 2 * 12 * CLUSTER_SIZE * self.clusters.len()
    }

    /// `s = s_rest + A u`
    pub(crate) fn apply(&self, u: &[Node], out: &mut SkinPositions) {
        for ((cluster, positions), bounds) in self.clusters.iter().zip(&mut out.positions).zip(&mut out.boxes) {
            cluster.apply(u, self.unit, positions);
            *bounds = bounding_box(positions);
        }
    }

    /// World positions in published order, `[n_skin]` \[m\].
    pub(crate) fn copy_positions(&self, skin: &SkinPositions, out: &mut [[f32; 3]]) {
        for (chunk, cluster) in out[..self.n_skin].chunks_mut(CLUSTER_SIZE).zip(&skin.positions) {
            copy_axes(cluster, chunk);
        }
    }

    /// Offsets from rest in published order, `[n_skin]` \[m\].
    pub(crate) fn copy_offsets(&self, skin: &SkinPositions, out: &mut [[f32; 3]]) {
        let clusters = skin.positions.iter().zip(&self.clusters);
        for (chunk, (deformed, cluster)) in out[..self.n_skin].chunks_mut(CLUSTER_SIZE).zip(clusters) {
            let offsets = std::array::from_fn(|k| std::array::from_fn(|g| deformed[k][g] - cluster.rest[k][g]));
            copy_axes(&offsets, chunk);
        }
    }

    /// Offsets with a fourth component of zero.
    pub(crate) fn copy_padded_offsets(&self, skin: &SkinPositions, out: &mut [Node]) {
        let clusters = skin.positions.iter().zip(&self.clusters);
        for (chunk, (deformed, cluster)) in out[..self.n_skin].chunks_mut(CLUSTER_SIZE).zip(clusters) {
            for (g, vertices) in chunk.chunks_mut(LANES).enumerate() {
                let [x, y, z] = std::array::from_fn(|k| (deformed[k][g] - cluster.rest[k][g]).to_array());
                for (lane, vertex) in vertices.iter_mut().enumerate() {
                    *vertex = [x[lane], y[lane], z[lane], 0.0];
                }
            }
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

    /// Position of a vertex \[m\].
    #[inline(always)]
    pub(crate) fn vertex(&self, v: usize) -> [f32; 3] {
        let (cluster, lane) = (&self.positions[v / CLUSTER_SIZE], v % CLUSTER_SIZE);
        std::array::from_fn(|k| bytemuck::cast_slice::<F, f32>(&cluster[k])[lane])
    }

    /// Low and high corner of each cluster \[m\].
    pub(crate) fn boxes(&self) -> &[[[f32; 3]; 2]] {
        &self.boxes
    }

    /// The coordinates of one cluster by axis, `[3][CLUSTER_SIZE]` \[m\].
    #[inline(always)]
    pub(crate) fn cluster(&self, cluster: usize) -> [&[f32]; 3] {
        std::array::from_fn(|k| bytemuck::cast_slice::<F, f32>(&self.positions[cluster][k]))
    }

    /// One axis of sixteen vertices \[m\].
    #[inline(always)]
    pub(crate) fn group(&self, axis: usize, group: usize) -> F {
        self.positions[group / GROUPS][axis][group % GROUPS]
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.positions.copy_from_slice(&other.positions);
        self.boxes.copy_from_slice(&other.boxes);
    }
}

impl Cluster {
    fn new(skin: &Skin, rows: &[Vec<(u32, i16)>], first: usize) -> Self {
        let last = rows.len() - 1;
        let vertex_of_lane: [usize; CLUSTER_SIZE] = std::array::from_fn(|lane| (first + lane).min(last));
        let strips = std::array::from_fn(|strip| Strip::new(rows, &vertex_of_lane[strip * STRIP..][..STRIP]));
        let rest = std::array::from_fn(|k| {
            std::array::from_fn(|g| {
                F::new(std::array::from_fn(|l| skin.positions()[vertex_of_lane[g * LANES + l]][k] as f32))
            })
        });
        Self { strips, rest }
    }

    #[inline(always)]
    fn apply(&self, u: &[Node], unit: f32, out: &mut [[F; GROUPS]; 3]) {
        for (index, strip) in self.strips.iter().enumerate() {
            let sum = strip.weighted_sum(u);
            for k in 0..3 {
                for g in 0..WIDE {
                    let at = index * WIDE + g;
                    out[k][at] = sum[k][g].mul_add(F::splat(unit), self.rest[k][at]);
                }
            }
        }
    }
}

impl Strip {
    fn new(rows: &[Vec<(u32, i16)>], vertices: &[usize]) -> Self {
        let mut nodes: Vec<u32> = vertices.iter().flat_map(|&v| rows[v].iter().map(|e| e.0)).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let weight = |vertex: usize, node: u32| rows[vertex].iter().find(|e| e.0 == node).map_or(0, |e| e.1);
        let of_node = |&node: &u32| -> [i16x16; WIDE] {
            std::array::from_fn(|g| i16x16::new(std::array::from_fn(|lane| weight(vertices[g * LANES + lane], node))))
        };
        Self { weights: nodes.iter().map(of_node).collect(), nodes }
    }

    /// `sum_a w_a u_a` in fixed-point units.
    #[inline(always)]
    fn weighted_sum(&self, u: &[Node]) -> [[F; WIDE]; 3] {
        let mut sum = [[F::ZERO; WIDE]; 3];
        for (&node, w) in self.nodes.iter().zip(&self.weights) {
            let displacement = &u[node as usize];
            for g in 0..WIDE {
                let weight = F::from_i32x16(i32x16::from_i16x16(w[g]));
                for k in 0..3 {
                    sum[k][g] = weight.mul_add(F::splat(displacement[k]), sum[k][g]);
                }
            }
        }
        sum
    }
}

/// Rounds with the error carried to the next entry, so that the sum is rounded once.
fn round_keeping_sum(values: impl Iterator<Item = f64>) -> impl Iterator<Item = i16> {
    values.scan(0.0, |left_over, value| {
        let rounded = (value + *left_over).round();
        *left_over += value - rounded;
        Some(rounded as i16)
    })
}

#[inline(always)]
fn bounding_box(positions: &[[F; GROUPS]; 3]) -> [[f32; 3]; 2] {
    [
        std::array::from_fn(|k| reduce(&positions[k], F::fast_min, |a, b| if a < b { a } else { b })),
        std::array::from_fn(|k| reduce(&positions[k], F::fast_max, |a, b| if a > b { a } else { b })),
    ]
}

/// Halves the lanes until one is left.
#[inline(always)]
fn reduce(axis: &[F; GROUPS], vector: impl Fn(F, F) -> F, scalar: impl Fn(f32, f32) -> f32) -> f32 {
    let mut lanes = axis[1..].iter().fold(axis[0], |a, b| vector(a, *b)).to_array();
    for width in [8, 4, 2, 1] {
        for lane in 0..width {
            lanes[lane] = scalar(lanes[lane], lanes[lane + width]);
        }
    }
    lanes[0]
}

fn copy_axes(cluster: &[[F; GROUPS]; 3], out: &mut [[f32; 3]]) {
    let axes: [&[f32]; 3] = std::array::from_fn(|k| bytemuck::cast_slice(&cluster[k]));
    for (lane, vertex) in out.iter_mut().enumerate() {
        *vertex = [axes[0][lane], axes[1][lane], axes[2][lane]];
    }
}
