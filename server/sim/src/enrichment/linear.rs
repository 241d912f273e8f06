//! Linear correlation, `w = A u`: the baselines that the paper argues against.
//!
//! `A = (U^T M U + lambda I)^-1 U^T M` with the examples' displacements as columns of `U`. `M = I` and `lambda -> 0` is linear regression
//! \[SSH12, Eq. 5\], a larger `lambda` ridge regression, `M = L^-1` with the mesh's graph Laplacian `L` the harmonic regularisation of
//! \[KGBS11\].

use nalgebra::DMatrix;
use plica_geometry::HexMesh;

use super::fade::Trust;
use super::kriging::leave_one_out;
use super::situation::Situation;
use super::ssh12::product;
use crate::lanes::Node;
use crate::solver::NodeOrder;

/// Least `lambda`, in units of the mean of the diagonal: the pseudo-inverse up to rounding.
const PSEUDO_INVERSE: f64 = 1e-10;
/// Candidates of ridge and harmonic regularisation, by leave-one-out error.
const CANDIDATES: [f64; 5] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Linear method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinearKind {
    /// Pseudo-inverse.
    Regression,
    /// Ridge.
    Ridge,
    /// Harmonic regularisation.
    Harmonic,
}

/// Weights by a matrix.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    /// `A`, `[n][n_free]`
    rows: Vec<Node>,
}

impl Linear {
    /// `products` are inner products of the fields to predict, `[n][n]`.
    pub(crate) fn new(
        kind: LinearKind,
        situations: &[Situation<'_>],
        products: &DMatrix<f64>,
        mesh: &HexMesh,
        order: &NodeOrder,
    ) -> Option<Self> {
        let n_free = situations[0].displacements.len();
        let column = |k: usize, s: &Situation<'_>| f64::from(s.displacements[k / 3][k % 3]);
        let u = DMatrix::from_fn(3 * n_free, situations.len(), |k, i| column(k, &situations[i]));
        let weighted = match kind {
            LinearKind::Harmonic => harmonic(mesh, order, &u)?,
            _ => u.clone(),
        };
        let gram = u.transpose() * &weighted;
        let mean = gram.trace() / situations.len() as f64;
        let solve = |share: f64| {
            let n = situations.len();
            Some((&gram + DMatrix::identity(n, n) * (share * mean)).cholesky()?.inverse())
        };
        let inverse = match kind {
            LinearKind::Regression => solve(PSEUDO_INVERSE)?,
            _ => {
                let mut candidates: Vec<_> = CANDIDATES.iter().filter_map(|c| solve(*c)).collect();
                let error = |inverse: &DMatrix<f64>| leave_one_out(inverse, products);
                candidates.sort_by(|a, b| error(a).total_cmp(&error(b)));
                candidates.into_iter().next()?
            }
        };
        let a = inverse * weighted.transpose();
        let node = |i: usize, k: usize| [a[(i, 3 * k)] as f32, a[(i, 3 * k + 1)] as f32, a[(i, 3 * k + 2)] as f32, 0.0];
        let rows = (0..a.nrows()).flat_map(|i| (0..n_free).map(move |k| (i, k))).map(|(i, k)| node(i, k)).collect();
        Some(Self { rows })
    }

    /// Writes `w`, with full trust.
    pub(crate) fn weigh(&self, situation: &Situation<'_>, weights: &mut [f32]) -> Trust {
        let u = situation.displacements;
        for (w, row) in weights.iter_mut().zip(self.rows.chunks_exact(u.len())) {
            *w = product(row, u);
        }
        Trust::FULL
    }
}

/// `L^-1 U`; edges join the corners of hexahedra, fixed nodes are Dirichlet conditions.
fn harmonic(mesh: &HexMesh, order: &NodeOrder, u: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n_free = u.nrows() / 3;
    let mut laplacian = DMatrix::zeros(n_free, n_free);
    for edge in mesh_edges(mesh) {
        let [a, b] = edge.map(|v| order.internal_of_mesh[v] as usize);
        for (from, to) in [(a, b), (b, a)] {
            if from < n_free {
                laplacian[(from, from)] += 1.0;
                if to < n_free {
                    laplacian[(from, to)] -= 1.0;
                }
            }
        }
    }
    // The Laplacian of an object without supports is singular.
    let factor = (laplacian + DMatrix::identity(n_free, n_free) * 1e-6).cholesky()?;
    let mut solved = u.clone();
    for axis in 0..3 {
        let one = DMatrix::from_fn(n_free, u.ncols(), |k, i| u[(3 * k + axis, i)]);
        let one = factor.solve(&one);
        for i in 0..u.ncols() {
            (0..n_free).for_each(|k| solved[(3 * k + axis, i)] = one[(k, i)]);
        }
    }
    Some(solved)
}

fn mesh_edges(mesh: &HexMesh) -> Vec<[usize; 2]> {
    let around = |q: &[usize; 4]| [[q[0], q[1]], [q[1], q[2]], [q[2], q[3]], [q[3], q[0]]];
    let mut edges: Vec<[usize; 2]> = mesh
        .hexes()
        .iter()
        .flat_map(|hex| plica_geometry::HEX_FACES.iter().map(|face| face.map(|corner| hex[corner].index())))
        .flat_map(|quad| around(&quad))
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}
