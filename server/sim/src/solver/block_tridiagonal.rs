//! Exact inverse of the rest matrix by block elimination over layers, warped by node rotations.
//!
//! With layers coupled to neighbours only, `A_0 = (I + L) D (I + L^T)`: `D_k = A_kk - L_k A_{k-1,k}`,
//! `L_k = A_{k,k-1} D_{k-1}^-1` \[GVL13, 4.5\]. `D_k^-1`, `L_k` and `L_k^T` are stored as dense panels.
//! Warping: `z = R A_0^-1 R^T r`, `R` the mean rotation of the elements around a node.

use nalgebra::DMatrix;

use super::ordering::NodeOrder;
use super::rest_matrix::RestMatrix;
use crate::lanes::{F, LANES, Node};

/// Dense column-major panel whose rows are padded to a multiple of [`LANES`].
#[derive(Debug, Clone)]
struct Panel {
    n_columns: usize,
    /// Sixteen-row groups per column.
    n_groups: usize,
    /// `[group][column]`, so that a group of rows is swept in one run.
    values: Vec<F>,
}

/// One layer of free nodes.
#[derive(Debug, Clone)]
struct Layer {
    first_node: usize,
    n_nodes: usize,
    /// First float of this layer in the padded vector.
    offset: usize,
    inverse: Panel,
    /// `L_k`; empty for the first layer.
    lower: Panel,
    /// `L_k^T`; empty for the first layer.
    upper: Panel,
}

/// The factorisation.
#[derive(Debug, Clone)]
pub(crate) struct BlockTridiagonal {
    layers: Vec<Layer>,
    padded: usize,
}

/// Scratch: node rotations of this step and two padded vectors.
#[derive(Debug, Clone)]
pub(crate) struct WarpScratch {
    /// Row-major rotation per free node.
    pub(crate) rotations: Vec<[f32; 9]>,
    y: Vec<F>,
    z: Vec<F>,
}

impl WarpScratch {
    pub(crate) fn new(n_free: usize, factor: Option<&BlockTridiagonal>) -> Self {
        let groups = factor.map_or(0, |f| f.padded / LANES);
        Self {
            rotations: vec![[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]; n_free],
            y: vec![F::ZERO; groups],
            z: vec![F::ZERO; groups],
        }
    }
}

impl WarpScratch {
    /// Node rotations from quaternion sums (x, y, z, w) of any length; a vanishing sum means no rotation.
    pub(crate) fn set_rotations(&mut self, quaternions: &[Node]) {
        for (m, q) in self.rotations.iter_mut().zip(quaternions) {
            let squared = q.iter().map(|c| c * c).sum::<f32>();
            let s = if squared > 1e-12 { 2.0 / squared } else { 0.0 };
            let [x, y, z, w] = *q;
            *m = [
                1.0 - s * (y * y + z * z),
                s * (x * y - z * w),
                s * (x * z + y * w),
                s * (x * y + z * w),
                1.0 - s * (x * x + z * z),
                s * (y * z - x * w),
                s * (x * z - y * w),
                s * (y * z + x * w),
                1.0 - s * (x * x + y * y),
            ];
        }
    }
}

impl BlockTridiagonal {
    /// Bytes of the panels that a factorisation over these layers would take.
    pub(crate) fn bytes_for(order: &NodeOrder) -> usize {
        let sizes: Vec<usize> = order.layer_starts.windows(2).map(|w| 3 * (w[1] - w[0])).collect();
        let diagonal: usize = sizes.iter().map(|n| n * n).sum();
        let off_diagonal: usize = sizes.windows(2).map(|w| 2 * w[0] * w[1]).sum();
        4 * (diagonal + off_diagonal)
    }

    /// `None` if a pivot block is singular.
    pub(crate) fn new(matrix: &RestMatrix, order: &NodeOrder) -> Option<Self> {
        let mut layers: Vec<Layer> = Vec::new();
        let mut inverse_before: Option<DMatrix<f64>> = None;
        let mut offset = 0;
        for (k, bounds) in order.layer_starts.windows(2).enumerate() {
            let rows = bounds[0]..bounds[1];
            let mut pivot = dense(matrix, rows.clone(), rows.clone());
            let mut lower = DMatrix::zeros(0, 0);
            if let Some(inverse) = &inverse_before {
                let coupling = dense(matrix, rows.clone(), order.layer_starts[k - 1]..bounds[0]);
                lower = &coupling * inverse;
                pivot -= &lower * coupling.transpose();
            }
            let inverse = pivot.cholesky()?.inverse();
            layers.push(Layer {
                first_node: bounds[0],
                n_nodes: rows.len(),
                offset,
                inverse: Panel::new(&inverse),
                lower: Panel::new(&lower),
                upper: Panel::new(&lower.transpose()),
            });
            offset += (3 * rows.len()).next_multiple_of(LANES);
            inverse_before = Some(inverse);
        }
        Some(Self { layers, padded: offset })
    }

    /// Bytes that one application reads.
    pub(crate) fn bytes(&self) -> usize {
        self.layers.iter().map(|l| 64 * (l.inverse.values.len() + l.lower.values.len() + l.upper.values.len())).sum()
    }

    /// `z = R A_0^-1 R^T r`
    #[inline(always)]
    pub(crate) fn apply_warped(&self, r: &[Node], z: &mut [Node], scratch: &mut WarpScratch) {
        self.load(r, &scratch.rotations, &mut scratch.y);
        self.solve(&mut scratch.y, &mut scratch.z);
        self.store(z, &scratch.rotations, &scratch.z);
    }

    /// `y = R^T r` in padded layout.
    #[inline(always)]
    fn load(&self, r: &[Node], rotations: &[[f32; 9]], y: &mut [F]) {
        let y: &mut [f32] = bytemuck::cast_slice_mut(y);
        for layer in &self.layers {
            let nodes = layer.first_node..layer.first_node + layer.n_nodes;
            let target = y[layer.offset..].chunks_exact_mut(3);
            for ((out, r), m) in target.zip(&r[nodes.clone()]).zip(&rotations[nodes]) {
                for c in 0..3 {
                    out[c] = m[c] * r[0] + m[3 + c] * r[1] + m[6 + c] * r[2];
                }
            }
        }
    }

    /// `z = R x` from padded layout.
    #[inline(always)]
    fn store(&self, z: &mut [Node], rotations: &[[f32; 9]], x: &[F]) {
        let x: &[f32] = bytemuck::cast_slice(x);
        for layer in &self.layers {
            let nodes = layer.first_node..layer.first_node + layer.n_nodes;
            let source = x[layer.offset..].chunks_exact(3);
            for ((z, x), m) in z[nodes.clone()].iter_mut().zip(source).zip(&rotations[nodes]) {
                let turned = |c: usize| m[3 * c] * x[0] + m[3 * c + 1] * x[1] + m[3 * c + 2] * x[2];
                *z = [turned(0), turned(1), turned(2), 0.0];
            }
        }
    }

    /// `z = A_0^-1 y`; `y` is overwritten by the forward sweep.
    #[inline(always)]
    fn solve(&self, y: &mut [F], z: &mut [F]) {
        for pair in self.layers.windows(2) {
            let (before, rest) = y.split_at_mut(pair[1].offset / LANES);
            pair[1].lower.subtract_product(&before[pair[0].offset / LANES..], rest);
        }
        z.fill(F::ZERO);
        for layer in &self.layers {
            let at = layer.offset / LANES;
            layer.inverse.add_product(&y[at..], &mut z[at..]);
        }
        for pair in self.layers.windows(2).rev() {
            let (before, rest) = z.split_at_mut(pair[1].offset / LANES);
            pair[1].upper.subtract_product(rest, &mut before[pair[0].offset / LANES..]);
        }
    }
}

impl Panel {
    fn new(m: &DMatrix<f64>) -> Self {
        let (n_rows, n_columns) = m.shape();
        let n_groups = n_rows.div_ceil(LANES);
        let mut values = Vec::with_capacity(n_groups * n_columns);
        for group in 0..n_groups {
            for column in 0..n_columns {
                let entry = |lane: usize| m.get((group * LANES + lane, column)).map_or(0.0, |&v| v as f32);
                values.push(F::new(std::array::from_fn(entry)));
            }
        }
        Self { n_columns, n_groups, values }
    }

    /// `y += P x`
    #[inline(always)]
    fn add_product(&self, x: &[F], y: &mut [F]) {
        self.sweep(x, |group, sum| y[group] += sum);
    }

    /// `y -= P x`
    #[inline(always)]
    fn subtract_product(&self, x: &[F], y: &mut [F]) {
        self.sweep(x, |group, sum| y[group] -= sum);
    }

    /// Hands `(P x)` out in groups of sixteen rows; four partial sums hide the latency of the additions.
    #[inline(always)]
    fn sweep(&self, x: &[F], mut emit: impl FnMut(usize, F)) {
        if self.n_columns == 0 {
            return;
        }
        let x: &[f32] = &bytemuck::cast_slice(x)[..self.n_columns];
        for group in 0..self.n_groups {
            let columns = &self.values[group * self.n_columns..][..self.n_columns];
            let mut sums = [F::ZERO; 4];
            let (quads, rest) = columns.as_chunks::<4>();
            let (x_quads, x_rest) = x.as_chunks::<4>();
            for (c, x) in quads.iter().zip(x_quads) {
                for k in 0..4 {
                    sums[k] = c[k].mul_add(F::splat(x[k]), sums[k]);
                }
            }
            for (c, x) in rest.iter().zip(x_rest) {
                sums[0] = c.mul_add(F::splat(*x), sums[0]);
            }
            emit(group, (sums[0] + sums[1]) + (sums[2] + sums[3]));
        }
    }
}

/// Dense copy of a block of rows and columns of nodes.
fn dense(matrix: &RestMatrix, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(3 * rows.len(), 3 * columns.len());
    for i in rows.clone() {
        for (&j, block) in matrix.rows[i].range(columns.clone()) {
            m.fixed_view_mut::<3, 3>(3 * (i - rows.start), 3 * (j - columns.start)).copy_from(block);
        }
    }
    m
}
