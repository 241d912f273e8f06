//! Sparse Cholesky factorisation, by faer: the symbolic part once, the numbers often.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use nalgebra::Vector3;

use crate::hessian::Hessian;
use crate::ordering::nested_dissection;

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
    /// Analyses the pattern of `hessian`; `rest_positions` of all nodes \[m\], if known, serve to order the unknowns.
    pub(crate) fn new(hessian: &Hessian, rest_positions: Option<&[Vector3<f64>]>) -> Result<Self, FactorError> {
        let n = hessian.n_unknowns();
        let (starts, rows) = hessian.scalar_pattern();
        let error = FactorError { n_unknowns: n, n_values: rows.len() };
        let pattern = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        let symbolic = analyse(hessian, pattern.as_ref(), rest_positions).map_err(|_| error)?;
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

    /// `H^-1 right_hand_side` for vectors at the nodes; 0 at nodes with all coordinates given.
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

/// The better of two orders: approximate minimum degree \[ADD96\], and nested dissection where positions are known. The second
/// wins on every solid mesh but the smallest.
fn analyse(
    hessian: &Hessian,
    pattern: SymbolicSparseColMatRef<'_, usize>,
    rest_positions: Option<&[Vector3<f64>]>,
) -> Result<SymbolicCholesky<usize>, FaerError> {
    let analyse = |order: SymmetricOrdering<'_, usize>| {
        factorize_symbolic_cholesky(pattern, Side::Lower, order, CholeskySymbolicParams::default())
    };
    let by_degree = analyse(SymmetricOrdering::Amd)?;
    let Some(rest_positions) = rest_positions else { return Ok(by_degree) };
    let order = scalar_order(hessian, rest_positions);
    let mut places = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, &unknown)| places[unknown] = place);
    let by_dissection = analyse(SymmetricOrdering::Custom(PermRef::new_checked(&order, &places, order.len())))?;
    Ok(if by_dissection.len_val() < by_degree.len_val() { by_dissection } else { by_degree })
}

/// The three unknowns of each node one after another, nodes in the order of their elimination.
fn scalar_order(hessian: &Hessian, rest_positions: &[Vector3<f64>]) -> Vec<usize> {
    let positions: Vec<_> = (0..hessian.n_blocks()).map(|b| rest_positions[hessian.node_of_block(b)]).collect();
    let blocks = nested_dissection(&positions, &hessian.block_neighbours());
    blocks.iter().flat_map(|b| [3 * b, 3 * b + 1, 3 * b + 2]).collect()
}
