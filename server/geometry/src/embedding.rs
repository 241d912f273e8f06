//! Constant sparse interpolation from mesh nodes to points: `s = A x`, one row of weights per point.

use nalgebra::{Matrix4, Point3, Vector3, Vector4};

use crate::hex_mesh::HexMesh;
use crate::index::{NodeIdx, VertexIdx};
use crate::isoparametric::shape_functions;
use crate::locate::{Location, Locator};
use crate::neighbourhood::Neighbourhoods;

/// Default support of moving least squares, in cells.
pub const DEFAULT_SUPPORT_CELLS: f64 = 1.75;

/// Largest distance of a point outside the mesh, in cells.
pub const MAX_OUTSIDE_CELLS: f64 = 0.5;

/// Least ratio of the extreme eigenvalues of the moment matrix; below it a row falls back to trilinear.
const MIN_RECIPROCAL_CONDITION: f64 = 1e-4;

/// Kind of weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EmbeddingKind {
    /// Moving least squares with a linear basis: smooth across element borders, does not pass through the nodes.
    MovingLeastSquares {
        /// Radius of the weight function in cells, a cell being the mesh's mean longest edge.
        support_cells: f64,
    },
    /// Shape functions of the containing hexahedron: continuous, with kinks at element borders.
    Trilinear,
}

impl Default for EmbeddingKind {
    fn default() -> Self {
        Self::MovingLeastSquares { support_cells: DEFAULT_SUPPORT_CELLS }
    }
}

/// Error of embedding points.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EmbeddingError {
    /// A point's coordinate is NaN or infinite.
    #[error("point {point} has the non-finite position [{}, {}, {}]", position[0], position[1], position[2])]
    NonFinite {
        /// The point.
        point: VertexIdx,
        /// Its position \[m\].
        position: [f64; 3],
    },
    /// A point is too far outside the mesh.
    #[error(
        "point {point} at [{}, {}, {}] is outside the mesh by more than {limit_m} m (half a cell)",
        position[0], position[1], position[2]
    )]
    Outside {
        /// The point.
        point: VertexIdx,
        /// Its position \[m\].
        position: [f64; 3],
        /// Largest distance outside the mesh \[m\].
        limit_m: f64,
    },
    /// The support is not a positive finite number.
    #[error("the support of moving least squares is {support_cells} cells, it must be positive and finite")]
    Support {
        /// Value.
        support_cells: f64,
    },
}

/// The matrix `A`, `[n_rows, n_nodes]`. Rows sum to 1 and reproduce linear fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedding {
    n_nodes: usize,
    row_starts: Vec<usize>,
    entries: Vec<(NodeIdx, f64)>,
    fallbacks: Vec<VertexIdx>,
}

impl Embedding {
    /// Weights of every point of `points` \[m\] in `mesh`.
    ///
    /// Moving least squares \[KMBG09\]: with `d_a` the distance along the mesh (see below), `h` the support radius,
    /// `y_a = (x_a - x) / h` and `p(y) = (1, y)`,
    ///
    /// `phi_a(x) = w(d_a / h) p(0)^T M(x)^-1 p(y_a)`, `M(x) = sum_a w(d_a / h) p(y_a) p(y_a)^T`,
    /// `w(t) = (1 - t^2)^3` for `t < 1`, else 0.
    ///
    /// The radius is one number for the whole mesh, `support_cells` times its mean longest edge: a radius that
    /// changes from element to element makes weights jump. `d_a` is the distance to `x`, except across a gap,
    /// where it is the distance around the gap's end. A row falls back to trilinear where `M` is ill-conditioned
    /// (nodes within the radius are few or nearly coplanar); such rows are listed by [`Self::fallbacks`].
    ///
    /// Points may lie up to half a cell outside the mesh; there trilinear weights are those of the nearest
    /// hexahedron, extrapolated.
    ///
    /// # Errors
    /// See [`EmbeddingError`].
    pub fn new(mesh: &HexMesh, points: &[Point3<f64>], kind: EmbeddingKind) -> Result<Self, EmbeddingError> {
        let cell_m = mesh.mean_longest_edge();
        let radius_m = match kind {
            EmbeddingKind::MovingLeastSquares { support_cells } => checked_support(support_cells)? * cell_m,
            EmbeddingKind::Trilinear => 0.0,
        };
        let locator = Locator::new(mesh);
        let mut neighbourhoods = Neighbourhoods::new(mesh, radius_m);
        let mut embedding = Self::empty(mesh.n_nodes(), points.len());
        for (i, x) in points.iter().enumerate() {
            let point = VertexIdx::from_index(i);
            let location = located(&locator, x, point, MAX_OUTSIDE_CELLS * cell_m)?;
            match kind {
                EmbeddingKind::Trilinear => embedding.push(trilinear_row(mesh, &location)),
                EmbeddingKind::MovingLeastSquares { .. } => {
                    let near = neighbourhoods.around(x, location.hex);
                    let row = moving_least_squares_row(mesh, x, radius_m, &near);
                    if row.is_none() {
                        embedding.fallbacks.push(point);
                    }
                    embedding.push(row.unwrap_or_else(|| trilinear_row(mesh, &location)));
                }
            }
        }
        Ok(embedding)
    }

    /// Number of rows: points.
    pub fn n_rows(&self) -> usize {
        self.row_starts.len() - 1
    }

    /// Number of columns: nodes of the mesh.
    pub fn n_nodes(&self) -> usize {
        self.n_nodes
    }

    /// Nodes of row `v` with their weights, in increasing order of node.
    pub fn row(&self, v: usize) -> &[(NodeIdx, f64)] {
        &self.entries[self.row_starts[v]..self.row_starts[v + 1]]
    }

    /// `A x` for nodal vectors `[n_nodes]`: one vector per point.
    ///
    /// # Panics
    /// If `nodal` does not hold `n_nodes` vectors.
    pub fn apply(&self, nodal: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        assert_eq!(nodal.len(), self.n_nodes, "one vector per node");
        (0..self.n_rows())
            .map(|v| self.row(v).iter().fold(Vector3::zeros(), |sum, &(node, w)| sum + w * nodal[node.index()]))
            .collect()
    }

    /// `A^T y` for vectors at the points `[n_rows]` (forces, say): one vector per node.
    ///
    /// # Panics
    /// If `pointwise` does not hold `n_rows` vectors.
    pub fn apply_transpose(&self, pointwise: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        assert_eq!(pointwise.len(), self.n_rows(), "one vector per point");
        let mut nodal = vec![Vector3::zeros(); self.n_nodes];
        for (v, y) in pointwise.iter().enumerate() {
            for &(node, w) in self.row(v) {
                nodal[node.index()] += w * y;
            }
        }
        nodal
    }

    /// Rows of moving least squares that fell back to trilinear, in increasing order.
    pub fn fallbacks(&self) -> &[VertexIdx] {
        &self.fallbacks
    }

    /// Nodes with weight in each run of `run_length` rows (the last may be shorter), in increasing order: the node list
    /// of every skin cluster.
    pub fn node_lists(&self, run_length: usize) -> Vec<Vec<NodeIdx>> {
        let runs = (0..self.n_rows()).step_by(run_length);
        runs.map(|first| {
            let last = (first + run_length).min(self.n_rows());
            let entries = &self.entries[self.row_starts[first]..self.row_starts[last]];
            let mut nodes: Vec<NodeIdx> = entries.iter().map(|&(node, _)| node).collect();
            nodes.sort_unstable();
            nodes.dedup();
            nodes
        })
        .collect()
    }

    fn empty(n_nodes: usize, n_rows: usize) -> Self {
        let mut row_starts = Vec::with_capacity(n_rows + 1);
        row_starts.push(0);
        Self { n_nodes, row_starts, entries: Vec::new(), fallbacks: Vec::new() }
    }

    fn push(&mut self, row: Vec<(NodeIdx, f64)>) {
        self.entries.extend(row);
        self.row_starts.push(self.entries.len());
    }
}

fn checked_support(support_cells: f64) -> Result<f64, EmbeddingError> {
    let valid = support_cells.is_finite() && support_cells > 0.0;
    valid.then_some(support_cells).ok_or(EmbeddingError::Support { support_cells })
}

fn located(locator: &Locator<'_>, x: &Point3<f64>, point: VertexIdx, limit_m: f64) -> Result<Location, EmbeddingError> {
    let position = x.coords.into();
    if x.iter().any(|c| !c.is_finite()) {
        return Err(EmbeddingError::NonFinite { point, position });
    }
    locator.locate(x, limit_m).ok_or(EmbeddingError::Outside { point, position, limit_m })
}

fn trilinear_row(mesh: &HexMesh, location: &Location) -> Vec<(NodeIdx, f64)> {
    let mut row: Vec<_> = mesh.hexes()[location.hex.index()].into_iter().zip(shape_functions(location.xi)).collect();
    row.retain(|&(_, weight)| weight != 0.0);
    row.sort_unstable_by_key(|&(node, _)| node);
    row
}

/// `w(t) = (1 - t^2)^3`: 1 at the point, and value, slope and curvature 0 at the rim.
fn weight(t: f64) -> f64 {
    (1.0 - t * t).max(0.0).powi(3)
}

fn moving_least_squares_row(
    mesh: &HexMesh,
    x: &Point3<f64>,
    radius_m: f64,
    near: &[(NodeIdx, f64)],
) -> Option<Vec<(NodeIdx, f64)>> {
    let basis = |node: NodeIdx| {
        let y = (mesh.nodes()[node.index()] - x) / radius_m;
        Vector4::new(1.0, y.x, y.y, y.z)
    };
    let moment = near.iter().fold(Matrix4::zeros(), |m, &(node, d)| {
        let p = basis(node);
        m + weight(d / radius_m) * p * p.transpose()
    });
    let b = solve_well_conditioned(&moment, &Vector4::x())?;
    Some(near.iter().map(|&(node, d)| (node, weight(d / radius_m) * b.dot(&basis(node)))).collect())
}

/// `M^-1 e`, with one step of iterative refinement; `None` where `M` is ill-conditioned.
fn solve_well_conditioned(moment: &Matrix4<f64>, e: &Vector4<f64>) -> Option<Vector4<f64>> {
    let eigenvalues = moment.symmetric_eigenvalues();
    let is_well_conditioned = eigenvalues.min() > MIN_RECIPROCAL_CONDITION * eigenvalues.max();
    let factor = is_well_conditioned.then(|| moment.cholesky()).flatten()?;
    let b = factor.solve(e);
    Some(b + factor.solve(&(e - moment * b)))
}
