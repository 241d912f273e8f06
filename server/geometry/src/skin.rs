//! A closed, outward-facing triangle surface, checked once on construction.

mod check;

use nalgebra::{Point3, Vector3};

use crate::index::{TriangleIdx, VertexIdx};
pub use check::SkinError;

/// Vertices and triangles of a closed manifold whose triangles are counter-clockwise seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    positions: Vec<Point3<f64>>,
    triangles: Vec<[VertexIdx; 3]>,
}

impl Skin {
    /// Checks and takes `positions` \[m\] and `triangles` (counter-clockwise seen from outside).
    ///
    /// # Errors
    /// See [`SkinError`]; the first fault found is named with its numbers.
    pub fn new(positions: Vec<Point3<f64>>, triangles: Vec<[VertexIdx; 3]>) -> Result<Self, SkinError> {
        let skin = Self { positions, triangles };
        skin.check_values()?;
        skin.check_manifold()?;
        let volume = skin.volume();
        let is_outward = volume > 0.0;
        if !is_outward {
            return Err(SkinError::Inward { volume });
        }
        Ok(skin)
    }

    /// Number of vertices.
    pub fn n_vertices(&self) -> usize {
        self.positions.len()
    }

    /// Number of triangles.
    pub fn n_triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Rest positions \[m\], `[n_vertices]`.
    pub fn positions(&self) -> &[Point3<f64>] {
        &self.positions
    }

    /// Corner vertices, counter-clockwise seen from outside, `[n_triangles]`.
    pub fn triangles(&self) -> &[[VertexIdx; 3]] {
        &self.triangles
    }

    /// Corner positions of one triangle \[m\].
    pub fn corner_positions(&self, triangle: TriangleIdx) -> [Point3<f64>; 3] {
        self.triangles[triangle.index()].map(|v| self.positions[v.index()])
    }

    /// Outward unit normals `[n_vertices]`: triangle normals weighted by the triangle's angle at the vertex, so
    /// that they do not depend on how a flat face is cut into triangles.
    pub fn vertex_normals(&self) -> Vec<Vector3<f64>> {
        let mut normals = vec![Vector3::zeros(); self.n_vertices()];
        for (t, corners) in self.triangles.iter().enumerate() {
            let x = self.corner_positions(TriangleIdx::from_index(t));
            let normal = area_vector(&x).normalize();
            for k in 0..3 {
                let angle = (x[(k + 1) % 3] - x[k]).angle(&(x[(k + 2) % 3] - x[k]));
                normals[corners[k].index()] += angle * normal;
            }
        }
        normals.iter().map(Vector3::normalize).collect()
    }

    /// Triangle areas \[m^2\], `[n_triangles]`.
    pub fn triangle_areas(&self) -> Vec<f64> {
        let corners = (0..self.n_triangles()).map(|t| self.corner_positions(TriangleIdx::from_index(t)));
        corners.map(|x| area_vector(&x).norm()).collect()
    }

    /// A third of the area of the triangles around each vertex \[m^2\], `[n_vertices]`.
    pub fn vertex_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.n_vertices()];
        for (corners, area) in self.triangles.iter().zip(self.triangle_areas()) {
            corners.iter().for_each(|v| areas[v.index()] += area / 3.0);
        }
        areas
    }

    /// Enclosed volume \[m^3\]: `V = 1/6 sum_t x_0 . (x_1 x x_2)`, taken about the first vertex.
    pub fn volume(&self) -> f64 {
        let origin = self.positions[0];
        let from_origin = |v: VertexIdx| self.positions[v.index()] - origin;
        let corners = self.triangles.iter().map(|t| t.map(from_origin));
        corners.map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
    }

    /// Every edge once, smaller vertex first, in increasing order, `[n_edges]`.
    pub fn edges(&self) -> Vec<[VertexIdx; 2]> {
        let mut edges: Vec<_> =
            self.triangles.iter().flat_map(|&t| triangle_edges(t)).filter(|e| e[0] < e[1]).collect();
        edges.sort_unstable();
        edges
    }

    /// For every triangle the positions of its edges in [`Self::edges`]: edge 0 joins corners 0 and 1, edge 1
    /// corners 1 and 2, edge 2 corners 2 and 0, `[n_triangles, 3]`.
    pub fn triangle_edges(&self) -> Vec<[u32; 3]> {
        let edges = self.edges();
        let find = |[a, b]: [VertexIdx; 2]| {
            let found = edges.binary_search(&[a.min(b), a.max(b)]);
            found.expect("a closed skin holds every edge in both directions") as u32
        };
        self.triangles.iter().map(|&t| triangle_edges(t).map(find)).collect()
    }

    /// `V - E + F`: 2 for a surface without handles.
    pub fn euler_characteristic(&self) -> i64 {
        self.n_vertices() as i64 - self.n_triangles() as i64 / 2
    }

    /// The same surface with its vertices in another order: `order[new] = old`. Triangles are listed by their
    /// smallest new vertex.
    ///
    /// # Panics
    /// If `order` is no permutation of the vertices.
    pub(crate) fn reordered(self, order: &[VertexIdx]) -> Self {
        assert_eq!(order.len(), self.n_vertices(), "one entry per vertex");
        let mut new_of_old = vec![VertexIdx(u32::MAX); order.len()];
        for (new, old) in order.iter().enumerate() {
            new_of_old[old.index()] = VertexIdx::from_index(new);
        }
        let positions = order.iter().map(|old| self.positions[old.index()]).collect();
        let mut triangles: Vec<_> = self.triangles.iter().map(|t| t.map(|v| new_of_old[v.index()])).collect();
        triangles.sort_by_key(|t| t.iter().min().copied());
        Self { positions, triangles }
    }
}

fn triangle_edges([a, b, c]: [VertexIdx; 3]) -> [[VertexIdx; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// `1/2 (x_1 - x_0) x (x_2 - x_0)`: along the outward normal, as long as the area.
fn area_vector(x: &[Point3<f64>; 3]) -> Vector3<f64> {
    0.5 * (x[1] - x[0]).cross(&(x[2] - x[0]))
}
