//! Vertex order by clusters: one node list of the embedding serves a whole cluster.

use nalgebra::SVector;

use crate::index::VertexIdx;
use crate::skin::Skin;

/// Vertices per cluster. Cluster `k` of a clustered skin is the vertices `64 k .. 64 k + 64`; only the last may be
/// shorter.
pub const CLUSTER_SIZE: usize = 64;

/// Weight of a unit normal against positions, in cluster widths. On the wedge: from 0 to 1.5 the node lists stay
/// as long (45 nodes) while the clusters that mix top and bottom go from 18 of 108 to 2; beyond, lists grow.
const NORMAL_IN_CLUSTER_WIDTHS: f64 = 1.5;

/// Position and scaled normal, both in metres.
type Feature = SVector<f64, 6>;

impl Skin {
    /// The same surface with its vertices re-ordered so that every run of [`CLUSTER_SIZE`] consecutive vertices is
    /// compact.
    ///
    /// The vertices are bisected recursively, at the multiple of the cluster size with the least spread within both
    /// parts. Spread is measured over positions and normals together, a unit normal weighing 1.5 cluster widths: faces
    /// with opposite normals separate even where they lie close.
    pub fn clustered(self) -> Self {
        let features = self.cluster_features();
        let mut order: Vec<VertexIdx> = (0..self.n_vertices()).map(VertexIdx::from_index).collect();
        bisect(&features, &mut order);
        self.reordered(&order)
    }

    fn cluster_features(&self) -> Vec<Feature> {
        let area: f64 = self.triangle_areas().iter().sum();
        let cluster_width = (area * CLUSTER_SIZE as f64 / self.n_vertices() as f64).sqrt();
        let pairs = self.positions().iter().zip(self.vertex_normals());
        pairs
            .map(|(x, n)| {
                let n = NORMAL_IN_CLUSTER_WIDTHS * cluster_width * n;
                Feature::from([x.x, x.y, x.z, n.x, n.y, n.z])
            })
            .collect()
    }
}

/// Orders `vertices` by recursive bisection.
fn bisect(features: &[Feature], vertices: &mut [VertexIdx]) {
    if vertices.len() <= CLUSTER_SIZE {
        vertices.sort_unstable();
        return;
    }
    let cuts = (0..6).map(|axis| {
        sort_along(features, vertices, axis);
        let (cut, spread) = best_cut(features, vertices);
        (axis, cut, spread)
    });
    let best = cuts.min_by(|a, b| a.2.total_cmp(&b.2));
    let (axis, cut, _) = best.expect("there are six axes");
    sort_along(features, vertices, axis);
    let (left, right) = vertices.split_at_mut(cut);
    bisect(features, left);
    bisect(features, right);
}

fn sort_along(features: &[Feature], vertices: &mut [VertexIdx], axis: usize) {
    let key = |v: &VertexIdx| features[v.index()][axis];
    vertices.sort_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
}

/// The cut, among multiples of the cluster size, with the least spread `sum |f|^2 - |sum f|^2 / n` summed over both
/// sides.
fn best_cut(features: &[Feature], vertices: &[VertexIdx]) -> (usize, f64) {
    let spreads_before = running_spread(features, vertices.iter());
    let mut spreads_after = running_spread(features, vertices.iter().rev());
    spreads_after.reverse();
    let cuts = (CLUSTER_SIZE..vertices.len()).step_by(CLUSTER_SIZE);
    let best = cuts.map(|cut| (cut, spreads_before[cut] + spreads_after[cut])).min_by(|a, b| a.1.total_cmp(&b.1));
    best.expect("more vertices than a cluster holds leave a cut")
}

/// Spread of the first `k` vertices for `k = 0 .. n`.
fn running_spread<'a>(features: &[Feature], vertices: impl Iterator<Item = &'a VertexIdx>) -> Vec<f64> {
    let (mut n, mut sum, mut sum_squared) = (0.0, Feature::zeros(), 0.0);
    let mut spreads = vec![0.0];
    for v in vertices {
        let f = &features[v.index()];
        n += 1.0;
        sum += f;
        sum_squared += f.norm_squared();
        spreads.push(sum_squared - sum.norm_squared() / n);
    }
    spreads
}
