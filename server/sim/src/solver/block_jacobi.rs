//! Block Jacobi: the inverse 3x3 diagonal blocks of the rest matrix.

use super::rest_matrix::RestMatrix;
use crate::lanes::Node;

/// Inverse diagonal blocks, one row of three nodes' worth of floats per axis.
#[derive(Debug, Clone)]
pub(crate) struct BlockJacobi {
    inverse: Vec<[[f32; 4]; 3]>,
}

impl BlockJacobi {
    pub(crate) fn new(matrix: &RestMatrix) -> Self {
        let invert = |i: usize| {
            let inverse = matrix.block(i, i).try_inverse().unwrap_or_else(nalgebra::Matrix3::zeros);
            std::array::from_fn(|c| [inverse[(0, c)] as f32, inverse[(1, c)] as f32, inverse[(2, c)] as f32, 0.0])
        };
        Self { inverse: (0..matrix.rows.len()).map(invert).collect() }
    }

    /// `z = diag(A_0)^-1 r`
    #[inline(always)]
    pub(crate) fn apply(&self, r: &[Node], z: &mut [Node]) {
        for ((z, r), columns) in z.iter_mut().zip(r).zip(&self.inverse) {
            *z =
                std::array::from_fn(|k| columns[0][k].mul_add(r[0], columns[1][k].mul_add(r[1], columns[2][k] * r[2])));
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.inverse.as_slice())
    }
}
