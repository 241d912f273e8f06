//! Sparse symmetric matrix: lower triangle by columns, on a fixed pattern of node pairs.

use nalgebra::{Matrix3, Vector3};
use plica_geometry::NodeIdx;

use crate::constraints::Constraints;

/// Calls its argument with the nodes of every stencil.
pub(crate) type VisitStencils<'a> = dyn Fn(&mut dyn FnMut(&[NodeIdx])) + 'a;

/// Second derivatives of a sum of energies \[N/m\].
///
/// The matrix is kept over the nodes that have a free coordinate. Rows and columns of given coordinates are those of the
/// identity; their contribution to the right-hand side, `-H_free,given dx_given`, is in `lift`.
#[derive(Debug, Clone)]
pub struct Hessian {
    /// Block row and column of each node; `u32::MAX` for nodes with all coordinates given.
    block_of_node: Vec<u32>,
    node_of_block: Vec<u32>,
    is_given: Vec<[bool; 3]>,
    /// Start of each block column in `block_rows`.
    column_starts: Vec<usize>,
    /// Block rows of each block column, increasing, the diagonal first.
    block_rows: Vec<u32>,
    /// Start of the values of scalar column `3 b` for each block column `b`.
    value_starts: Vec<usize>,
    values: Vec<f64>,
    /// Motion of each node's given coordinates in this step \[m\].
    given_motion: Vec<Vector3<f64>>,
    /// `-H_free,given dx_given`, `[n_nodes]` \[N\].
    lift: Vec<Vector3<f64>>,
    has_motion: bool,
    /// Frames other than x, y, z; rows and columns of their nodes are along their axes.
    frames: Vec<Matrix3<f64>>,
    /// Frame of each node, `NO_FRAME` for most.
    frame_of_node: Vec<u32>,
}

const NO_FRAME: u32 = u32::MAX;
const GIVEN: u32 = u32::MAX;

impl Hessian {
    /// All-zero matrix that couples the nodes of every stencil.
    pub(crate) fn new(constraints: &Constraints, visit_stencils: &VisitStencils<'_>) -> Self {
        let n_nodes = constraints.n_nodes();
        let is_given: Vec<_> = (0..n_nodes).map(|n| constraints.is_given(n)).collect();
        let mut block_of_node = vec![GIVEN; n_nodes];
        let mut node_of_block = Vec::new();
        for (node, given) in is_given.iter().enumerate() {
            if *given != [true; 3] {
                block_of_node[node] = node_of_block.len() as u32;
                node_of_block.push(node as u32);
            }
        }
        let columns = pattern(&block_of_node, node_of_block.len(), visit_stencils);
        let mut column_starts = vec![0];
        let mut value_starts = vec![0];
        for rows in &columns {
            column_starts.push(column_starts[column_starts.len() - 1] + rows.len());
            // Columns 3 b, 3 b + 1, 3 b + 2 hold 3, 2, 1 values of the diagonal block and 3 of every other.
            value_starts.push(value_starts[value_starts.len() - 1] + 6 + 9 * (rows.len() - 1));
        }
        let n_values = value_starts[columns.len()];
        let mut frame_of_node = vec![NO_FRAME; n_nodes];
        for (i, node) in constraints.frames().keys().enumerate() {
            frame_of_node[*node] = i as u32;
        }
        Self {
            block_of_node,
            node_of_block,
            is_given,
            column_starts,
            block_rows: columns.concat(),
            value_starts,
            values: vec![0.0; n_values],
            given_motion: vec![Vector3::zeros(); n_nodes],
            lift: vec![Vector3::zeros(); n_nodes],
            has_motion: false,
            frames: constraints.frames().values().copied().collect(),
            frame_of_node,
        }
    }

    /// `H v` for vectors at the nodes; 0 at given coordinates, and those of `v` count as 0.
    pub fn multiply(&self, v: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut product = vec![Vector3::zeros(); self.block_of_node.len()];
        let v: Vec<_> = v.iter().enumerate().map(|(node, v)| self.along_axes(node, v)).collect();
        for column in 0..self.n_blocks() {
            let j = self.node_of_block(column);
            for place in 0..self.column_starts[column + 1] - self.column_starts[column] {
                let i = self.node_of_block(self.block_rows[self.column_starts[column] + place] as usize);
                let block = self.block(column, place);
                product[i] += block * v[j];
                if place > 0 {
                    product[j] += block.transpose() * v[i];
                }
            }
        }
        product.iter().enumerate().map(|(node, v)| self.combine_axes(node, v)).collect()
    }

    /// Adds the second derivatives of one stencil: `block(a, b)` couples `nodes[a]` and `nodes[b]` and is called once
    /// per unordered pair; `block(b, a)` is its transpose.
    ///
    /// # Panics
    /// If a pair of nodes is not in the pattern: its energy did not name it in `visit_stencils`.
    pub fn add_stencil(&mut self, nodes: &[NodeIdx], block: impl Fn(usize, usize) -> Matrix3<f64>) {
        for a in 0..nodes.len() {
            for b in 0..=a {
                self.add_block(nodes[a], nodes[b], &block(a, b));
            }
        }
    }

    /// Adds `block` to rows of `row` and columns of `column`, and its transpose the other way round (once, if they are one
    /// node: then the block is symmetric).
    ///
    /// # Panics
    /// If the pair is not in the pattern.
    pub fn add_block(&mut self, row: NodeIdx, column: NodeIdx, block: &Matrix3<f64>) {
        let (row, column) = (row.index(), column.index());
        if self.has_motion {
            self.add_lift(row, column, block);
            if row != column {
                self.add_lift(column, row, &block.transpose());
            }
        }
        let (i, j) = (self.block_of_node[row], self.block_of_node[column]);
        if i == GIVEN || j == GIVEN {
            return;
        }
        let turned = self.turned(row, column, block);
        let block = turned.as_ref().unwrap_or(block);
        if i >= j { self.add_lower(i, j, block) } else { self.add_lower(j, i, &block.transpose()) }
    }

    /// Components of a vector at a node along the axes of its frame.
    pub(crate) fn along_axes(&self, node: usize, v: &Vector3<f64>) -> Vector3<f64> {
        self.frame(node).map_or(*v, |frame| frame.tr_mul(v))
    }

    /// The vector with the given components along the axes of a node's frame.
    pub(crate) fn combine_axes(&self, node: usize, v: &Vector3<f64>) -> Vector3<f64> {
        self.frame(node).map_or(*v, |frame| frame * v)
    }

    fn frame(&self, node: usize) -> Option<&Matrix3<f64>> {
        self.frames.get(self.frame_of_node[node] as usize)
    }

    /// The block along the axes of its nodes, where they differ from x, y, z.
    fn turned(&self, row: usize, column: usize, block: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        match (self.frame(row), self.frame(column)) {
            (None, None) => None,
            (Some(left), None) => Some(left.tr_mul(block)),
            (None, Some(right)) => Some(block * right),
            (Some(left), Some(right)) => Some(left.tr_mul(block) * right),
        }
    }

    /// Sets all values to 0, and the motion of given coordinates in this step \[m\], `[n_nodes]`.
    pub(crate) fn clear(&mut self, given_motion: Option<&[Vector3<f64>]>) {
        self.values.fill(0.0);
        self.lift.fill(Vector3::zeros());
        self.has_motion = given_motion.is_some();
        match given_motion {
            Some(motion) => self.given_motion.copy_from_slice(motion),
            None => self.given_motion.fill(Vector3::zeros()),
        }
    }

    /// Turns rows and columns of given coordinates into those of the identity times `scale`. To be called once, last.
    pub(crate) fn finish(&mut self, scale: f64) {
        for block in 0..self.n_blocks() {
            self.finish_column(block, scale);
        }
    }

    /// Adds `shift` to the diagonal.
    pub(crate) fn add_diagonal(&mut self, shift: f64) {
        for block in 0..self.n_blocks() {
            for k in 0..3 {
                let at = self.diagonal(block, k);
                self.values[at] += shift;
            }
        }
    }

    /// Mean of the diagonal \[N/m\].
    pub(crate) fn mean_diagonal(&self) -> f64 {
        let sum: f64 = (0..self.n_blocks())
            .flat_map(|b| (0..3).map(move |k| (b, k)))
            .map(|(b, k)| self.values[self.diagonal(b, k)])
            .sum();
        sum / self.n_unknowns().max(1) as f64
    }

    pub(crate) fn n_blocks(&self) -> usize {
        self.node_of_block.len()
    }

    /// Rows of the matrix: three per node with a free coordinate.
    pub(crate) fn n_unknowns(&self) -> usize {
        3 * self.n_blocks()
    }

    pub(crate) fn node_of_block(&self, block: usize) -> usize {
        self.node_of_block[block] as usize
    }

    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    pub(crate) fn lift(&self) -> &[Vector3<f64>] {
        &self.lift
    }

    /// Blocks coupled with each block.
    pub(crate) fn block_neighbours(&self) -> Vec<Vec<u32>> {
        let mut neighbours = vec![Vec::new(); self.n_blocks()];
        for column in 0..self.n_blocks() {
            for &row in &self.block_rows[self.column_starts[column] + 1..self.column_starts[column + 1]] {
                neighbours[column].push(row);
                neighbours[row as usize].push(column as u32);
            }
        }
        neighbours
    }

    /// Column starts and rows of the scalar lower triangle, for the factorisation.
    pub(crate) fn scalar_pattern(&self) -> (Vec<usize>, Vec<usize>) {
        let mut starts = vec![0];
        let mut rows = Vec::with_capacity(self.values.len());
        for block in 0..self.n_blocks() {
            for k in 0..3 {
                rows.extend((k..3).map(|r| 3 * block + r));
                let below = &self.block_rows[self.column_starts[block] + 1..self.column_starts[block + 1]];
                rows.extend(below.iter().flat_map(|&b| (0..3).map(move |r| 3 * b as usize + r)));
                starts.push(rows.len());
            }
        }
        (starts, rows)
    }

    /// Values per scalar column `3 b + k`.
    fn column_length(&self, block: usize, k: usize) -> usize {
        3 * (self.column_starts[block + 1] - self.column_starts[block]) - k
    }

    /// Where the values of scalar column `3 b + k` start.
    fn column_start(&self, block: usize, k: usize) -> usize {
        self.value_starts[block] + (0..k).map(|c| self.column_length(block, c)).sum::<usize>()
    }

    fn diagonal(&self, block: usize, k: usize) -> usize {
        self.column_start(block, k)
    }

    /// Block at an entry of a block column; the diagonal block is completed from its lower triangle.
    fn block(&self, column: usize, place: usize) -> Matrix3<f64> {
        let value = |r: usize, k: usize| self.values[self.column_start(column, k) + 3 * place - k + r];
        if place == 0 { Matrix3::from_fn(|r, k| value(r.max(k), r.min(k))) } else { Matrix3::from_fn(value) }
    }

    fn add_lower(&mut self, row: u32, column: u32, block: &Matrix3<f64>) {
        let column = column as usize;
        let rows = &self.block_rows[self.column_starts[column]..self.column_starts[column + 1]];
        let Ok(place) = rows.binary_search(&row) else {
            panic!(
                "nodes {} and {} are coupled by an energy that did not say so",
                self.node_of_block(row as usize),
                self.node_of_block(column)
            )
        };
        for k in 0..3 {
            let start = self.column_start(column, k);
            if place == 0 {
                (k..3).for_each(|r| self.values[start + r - k] += block[(r, k)]);
            } else {
                (0..3).for_each(|r| self.values[start + 3 * place - k + r] += block[(r, k)]);
            }
        }
    }

    fn add_lift(&mut self, row: usize, column: usize, block: &Matrix3<f64>) {
        let motion = self.given_motion[column];
        if motion != Vector3::zeros() {
            self.lift[row] -= block * motion;
        }
    }

    fn finish_column(&mut self, block: usize, scale: f64) {
        let given = self.is_given[self.node_of_block(block)];
        for k in 0..3 {
            let start = self.column_start(block, k);
            for r in k..3 {
                if r == k && given[k] {
                    self.values[start] = scale;
                } else if given[k] || given[r] {
                    self.values[start + r - k] = 0.0;
                }
            }
            for place in 1..self.column_starts[block + 1] - self.column_starts[block] {
                let row = self.block_rows[self.column_starts[block] + place] as usize;
                let given_row = self.is_given[self.node_of_block(row)];
                for r in (0..3).filter(|&r| given[k] || given_row[r]) {
                    self.values[start + 3 * place - k + r] = 0.0;
                }
            }
        }
    }
}

/// Block rows of each block column, at and below the diagonal, increasing.
fn pattern(block_of_node: &[u32], n_blocks: usize, visit_stencils: &VisitStencils<'_>) -> Vec<Vec<u32>> {
    let mut columns: Vec<Vec<u32>> = (0..n_blocks as u32).map(|b| vec![b]).collect();
    visit_stencils(&mut |nodes| {
        for a in nodes {
            for b in nodes {
                let (i, j) = (block_of_node[a.index()], block_of_node[b.index()]);
                if i != GIVEN && j != GIVEN && i > j {
                    columns[j as usize].push(i);
                }
            }
        }
    });
    for rows in &mut columns {
        rows.sort_unstable();
        rows.dedup();
    }
    columns
}
