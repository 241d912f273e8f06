//! Sparse Cholesky factorisation, by faer: the symbolic part once, the numbers often.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
use nalgebra::Vector3;

use crate::hessian::Hessian;

/// The factorisation of a [`Hessian`] and its memory.
pub(crate) struct Factor {
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    memory: MemBuffer,
    solution: Vec<f64>,
}

/// The analysis ran out of memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("no memory to factorise a matrix with {n_unknowns} unknowns and {n_values} values")]
pub struct FactorError {
    /// Rows of the matrix.
    pub n_unknowns: usize,
    /// Values in its lower triangle.
    pub n_values: usize,
}

/// The matrix is not positive definite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Indefinite;

impl Factor {
    pub(crate) fn new(hessian: &Hessian) -> Result<Self, FactorError> {
        let n = hessian.n_unknowns();
        let (starts, rows) = hessian.scalar_pattern();
        let error = FactorError { n_unknowns: n, n_values: rows.len() };
        let pattern = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        let (order, params) = (SymmetricOrdering::Amd, CholeskySymbolicParams::default());
        let symbolic = factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, order, params).map_err(|_| error)?;
        let factorise = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let solve = symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        let memory = MemBuffer::try_new(factorise.or(solve)).map_err(|_| error)?;
        let values = vec![0.0; symbolic.len_val()];
        Ok(Self { pattern, symbolic, values, memory, solution: vec![0.0; n] })
    }

    /// Values of the factor.
    pub(crate) fn n_values(&self) -> usize {
        self.values.len()
    }

    pub(crate) fn factorise(&mut self, hessian: &Hessian) -> Result<(), Indefinite> {
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), hessian.values());
        let stack = MemStack::new(&mut self.memory);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.values,
                matrix,
                Side::Lower,
                Default::default(),
                Par::Seq,
                stack,
                Default::default(),
            )
            .map(|_| ())
            .map_err(|_| Indefinite)
    }

    /// `H^-1 right_hand_side` for vectors at the nodes; 0 at nodes that are given altogether.
    pub(crate) fn solve(&mut self, hessian: &Hessian, right_hand_side: &[Vector3<f64>], out: &mut [Vector3<f64>]) {
        for (block, values) in self.solution.chunks_exact_mut(3).enumerate() {
            values.copy_from_slice(right_hand_side[hessian.node_of_block(block)].as_slice());
        }
        let n = self.solution.len();
        let factor = LltRef::new(&self.symbolic, &self.values);
        let rhs = MatMut::from_column_major_slice_mut(&mut self.solution, n, 1);
        factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut self.memory));
        out.fill(Vector3::zeros());
        for (block, values) in self.solution.chunks_exact(3).enumerate() {
            out[hessian.node_of_block(block)] = Vector3::new(values[0], values[1], values[2]);
        }
    }
}
