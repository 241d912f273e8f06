//! The tie of the accurate surface to a coarse imprint.

use nalgebra::{Matrix3, Vector3};
use plica_geometry::{Embedding, NodeIdx, VertexIdx};

use crate::energy::{Energy, Projection};
use crate::hessian::Hessian;

/// Version of the tie's definition: solutions depend on it, so databases record it.
pub const TIE_VERSION: u32 = 1;

/// Stiffness of a tie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TieOptions {
    /// Young's modulus of the tied material \[Pa\].
    pub young_modulus_pa: f64,
    /// `l` \[m\]: stretch of the tie under a pressure of `E`.
    pub compliance_m: f64,
    /// Gap at which a vertex leaves the tie \[m\].
    pub band_m: f64,
    /// Share of the stiffness that is left there.
    pub rim_floor: f64,
}

impl TieOptions {
    /// Defaults of the scenes, for a material with the given Young's modulus \[Pa\].
    pub fn for_modulus(young_modulus_pa: f64) -> Self {
        Self { young_modulus_pa, compliance_m: 2e-5, band_m: 1e-3, rim_floor: 1e-4 }
    }

    /// Share of the full stiffness at a gap \[m\]: 1 in contact, then falling by equal factors over equal distances,
    /// `rim_floor^(gap/band)`, and 0 from `band_m` on. Equal steps of the logarithm, because the surface follows a vertex
    /// as long as the tie is stiffer than the material: a linear fall would keep nearly all of the rim stiff and then
    /// release it abruptly.
    pub fn share(&self, gap_m: f64) -> f64 {
        if gap_m >= self.band_m {
            0.0
        } else if gap_m <= 0.0 {
            1.0
        } else {
            self.rim_floor.powf(gap_m / self.band_m)
        }
    }
}

/// Target position of a surface vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TieTarget {
    /// The vertex: a row of the embedding.
    pub vertex: VertexIdx,
    /// Its gap to the tool \[m\], negative inside.
    pub gap_m: f64,
    /// Its area at rest \[m^2\].
    pub area_m2: f64,
    /// Its position on the coarse imprint, `s_v` \[m\].
    pub position: Vector3<f64>,
}

/// `W = 1/2 sum_v k_v |A_v x - s_v|^2`, `k_v = E/l area_v share(gap_v)`: `A x = s` in the sense of weighted least squares.
///
/// (As hard conditions these rows would be linearly dependent: more vertices than nodes.) Stiffness is counted per
/// area, so that the solution does not depend on the density of the vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Tie {
    rows: Vec<Row>,
}

#[derive(Debug, Clone, PartialEq)]
struct Row {
    nodes: Vec<NodeIdx>,
    weights: Vec<f64>,
    stiffness: f64,
    target: Vector3<f64>,
}

impl Tie {
    /// Ties rows of `embedding` \[of the accurate mesh\] to `targets`; targets beyond the band are left out. With
    /// trilinear
    /// rows every stencil lies within one hexahedron, so that a [`crate::Solver`] of the solid serves any tie.
    ///
    /// # Panics
    /// If a target names a row that the embedding does not have.
    pub fn new(embedding: &Embedding, targets: &[TieTarget], options: &TieOptions) -> Self {
        let per_area = options.young_modulus_pa / options.compliance_m;
        let tied = targets.iter().filter(|t| options.share(t.gap_m) > 0.0);
        let rows = tied.map(|t| {
            let (nodes, weights) = embedding.row(t.vertex.index()).iter().copied().unzip();
            let stiffness = per_area * t.area_m2 * options.share(t.gap_m);
            Row { nodes, weights, stiffness, target: t.position }
        });
        Self { rows: rows.collect() }
    }

    /// Number of tied vertices.
    pub fn n_tied(&self) -> usize {
        self.rows.len()
    }

    /// Force of the tie on the solid \[N\].
    pub fn force(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        -self.rows.iter().map(|row| row.miss(x) * row.stiffness).sum::<Vector3<f64>>()
    }

    /// Distances `|A_v x - s_v|` \[m\] of the tied vertices, with their stiffnesses \[N/m\].
    pub fn misses(&self, x: &[Vector3<f64>]) -> impl Iterator<Item = (f64, f64)> {
        self.rows.iter().map(|row| (row.miss(x).norm(), row.stiffness))
    }
}

impl Row {
    fn miss(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.nodes.iter().zip(&self.weights).fold(-self.target, |sum, (node, w)| sum + x[node.index()] * *w)
    }
}

impl Energy for Tie {
    fn visit_stencils(&self, visit: &mut dyn FnMut(&[NodeIdx])) {
        self.rows.iter().for_each(|row| visit(&row.nodes));
    }

    fn value(&self, x: &[Vector3<f64>]) -> f64 {
        self.rows.iter().map(|row| 0.5 * row.stiffness * row.miss(x).norm_squared()).sum()
    }

    fn add_gradient(&self, x: &[Vector3<f64>], gradient: &mut [Vector3<f64>]) {
        for row in &self.rows {
            let force = row.miss(x) * row.stiffness;
            row.nodes.iter().zip(&row.weights).for_each(|(node, w)| gradient[node.index()] += force * *w);
        }
    }

    fn add_hessian(&self, _x: &[Vector3<f64>], _projection: Projection, hessian: &mut Hessian) {
        for row in &self.rows {
            let w = &row.weights;
            hessian.add_stencil(&row.nodes, |a, b| Matrix3::from_diagonal_element(row.stiffness * w[a] * w[b]));
        }
    }
}
