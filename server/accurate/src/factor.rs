//! Sparse Cholesky factorisation, by faer: the symbolic part once, the numbers often.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal::SupernodalLdltRef,
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
    /// Whether the values are those of `L D L^T`, for a matrix that need not be positive definite.
    is_indefinite: bool,
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
        let indefinite = symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        let solve = symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        let memory = MemBuffer::try_new(factorise.or(indefinite).or(solve)).map_err(|_| error)?;
        let values = vec![0.0; symbolic.len_val()];
        Ok(Self { pattern, symbolic, values, memory, solution: vec![0.0; n], is_indefinite: false })
    }

    /// Values of the factor.
    pub(crate) fn n_values(&self) -> usize {
        self.values.len()
    }

    pub(crate) fn factorise(&mut self, hessian: &Hessian) -> Result<(), Indefinite> {
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), hessian.values());
        let stack = MemStack::new(&mut self.memory);
        self.is_indefinite = false;
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

    /// `L D L^T` without exchange of rows; the number of negative entries of `D`, which by Sylvester's law of inertia is that of
    /// negative eigenvalues \[GVL13, 8.1.5\]. The caller judges by a residual whether the factor is accurate.
    pub(crate) fn factorise_indefinite(&mut self, hessian: &Hessian) -> Result<usize, Indefinite> {
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), hessian.values());
        let stack = MemStack::new(&mut self.memory);
        self.is_indefinite = true;
        self.symbolic
            .factorize_numeric_ldlt(
                &mut self.values,
                matrix,
                Side::Lower,
                Default::default(),
                Par::Seq,
                stack,
                Default::default(),
            )
            .map_err(|_| Indefinite)?;
        Ok(self.count_negative())
    }

    fn count_negative(&self) -> usize {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(columns) => {
                let starts = &columns.col_ptr()[..columns.ncols()];
                starts.iter().filter(|&&start| self.values[start] < 0.0).count()
            }
            SymbolicCholeskyRaw::Supernodal(nodes) => {
                let factor = SupernodalLdltRef::new(nodes, &self.values);
                let of_node = |s: usize| {
                    let block = factor.supernode(s).val();
                    (0..block.ncols()).filter(|&k| block[(k, k)] < 0.0).count()
                };
                (0..nodes.n_supernodes()).map(of_node).sum()
            }
        }
    }

    /// `H^-1 right_hand_side` for vectors at the nodes; 0 at nodes with all coordinates given.
    pub(crate) fn solve(&mut self, hessian: &Hessian, right_hand_side: &[Vector3<f64>], out: &mut [Vector3<f64>]) {
        for (block, values) in self.solution.chunks_exact_mut(3).enumerate() {
            let node = hessian.node_of_block(block);
            values.copy_from_slice(hessian.along_axes(node, &right_hand_side[node]).as_slice());
        }
        let n = self.solution.len();
        let rhs = MatMut::from_column_major_slice_mut(&mut self.solution, n, 1);
        let stack = MemStack::new(&mut self.memory);
        if self.is_indefinite {
            LdltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack);
        } else {
            LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack);
        }
        out.fill(Vector3::zeros());
        for (block, values) in self.solution.chunks_exact(3).enumerate() {
            let node = hessian.node_of_block(block);
            out[node] = hessian.combine_axes(node, &Vector3::new(values[0], values[1], values[2]));
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
