//! A closed, outward-facing triangle surface, checked once on construction.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use crate::index::{TriangleIdx, VertexIdx};

/// Vertices and triangles of a closed manifold whose triangles are counter-clockwise seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    positions: Vec<Point3<f64>>,
    triangles: Vec<[VertexIdx; 3]>,
}

/// Why vertices and triangles do not make a skin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SkinError {
    /// No triangle.
    #[error("the skin has no triangles ({n_vertices} vertices)")]
    Empty {
        /// Number of vertices.
        n_vertices: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has the non-finite position [{}, {}, {}]", position[0], position[1], position[2])]
    NonFinite {
        /// The vertex.
        vertex: VertexIdx,
        /// Its position \[m\].
        position: [f64; 3],
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}, but there are {n_vertices} vertices")]
    VertexOutOfRange {
        /// The triangle.
        triangle: TriangleIdx,
        /// The vertex named.
        vertex: VertexIdx,
        /// Number of vertices.
        n_vertices: usize,
    },
    /// A triangle has no area.
    #[error("triangle {triangle} has the area {area:e} m^2, it must be positive")]
    Degenerate {
        /// The triangle.
        triangle: TriangleIdx,
        /// Its area \[m^2\].
        area: f64,
    },
    /// An edge does not have exactly one triangle on either side, in opposite directions.
    #[error(
        "edge {from} -> {to} runs {n_forward} times forward and {n_backward} times backward, it must be once each: \
         the skin is open, inconsistently turned or not manifold"
    )]
    Edge {
        /// Where the edge starts.
        from: VertexIdx,
        /// Where it ends.
        to: VertexIdx,
        /// Triangles that run along it.
        n_forward: usize,
        /// Triangles that run against it.
        n_backward: usize,
    },
    /// The triangles at a vertex form no single fan: none at all, or surfaces that touch in a point.
    #[error(
        "the {n_triangles} triangles at vertex {vertex} form no single fan (one closed fan has {n_in_fan})"
    )]
    Vertex {
        /// The vertex.
        vertex: VertexIdx,
        /// Triangles that have it as a corner.
        n_triangles: usize,
        /// Triangles in one fan around it.
        n_in_fan: usize,
    },
    /// The skin encloses no positive volume: it faces inward.
    #[error("the skin encloses {volume:e} m^3, it must be positive: the triangles face inward")]
    Inward {
        /// The signed volume \[m^3\].
        volume: f64,
    },
}

impl Skin {
    /// Checks and takes `positions` \[m\] and `triangles` (counter-clockwise seen from outside).
    ///
    /// # Errors
    /// See [`SkinError`]; the first fault found is named with its numbers.
    pub fn new(
        positions: Vec<Point3<f64>>,
        triangles: Vec<[VertexIdx; 3]>,
    ) -> Result<Self, SkinError> {
        let skin = Self {
            positions,
            triangles,
        };
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
        let corners =
            (0..self.n_triangles()).map(|t| self.corner_positions(TriangleIdx::from_index(t)));
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
        let mut edges: Vec<_> = self
            .triangles
            .iter()
            .flat_map(|&t| triangle_edges(t))
            .filter(|e| e[0] < e[1])
            .collect();
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
        self.triangles
            .iter()
            .map(|&t| triangle_edges(t).map(find))
            .collect()
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
        let positions = order
            .iter()
            .map(|old| self.positions[old.index()])
            .collect();
        let mut triangles: Vec<_> = self
            .triangles
            .iter()
            .map(|t| t.map(|v| new_of_old[v.index()]))
            .collect();
        triangles.sort_by_key(|t| t.iter().min().copied());
        Self {
            positions,
            triangles,
        }
    }

    fn check_values(&self) -> Result<(), SkinError> {
        let n_vertices = self.n_vertices();
        if self.triangles.is_empty() {
            return Err(SkinError::Empty { n_vertices });
        }
        if let Some(v) = self
            .positions
            .iter()
            .position(|x| x.iter().any(|c| !c.is_finite()))
        {
            let position = self.positions[v].coords.into();
            return Err(SkinError::NonFinite {
                vertex: VertexIdx::from_index(v),
                position,
            });
        }
        for (t, corners) in self.triangles.iter().enumerate() {
            let triangle = TriangleIdx::from_index(t);
            if let Some(&vertex) = corners.iter().find(|v| v.index() >= n_vertices) {
                return Err(SkinError::VertexOutOfRange {
                    triangle,
                    vertex,
                    n_vertices,
                });
            }
            let area = area_vector(&self.corner_positions(triangle)).norm();
            let has_area = area > 0.0;
            if !has_area {
                return Err(SkinError::Degenerate { triangle, area });
            }
        }
        Ok(())
    }

    fn check_manifold(&self) -> Result<(), SkinError> {
        let mut counts: HashMap<[VertexIdx; 2], usize> =
            HashMap::with_capacity(3 * self.n_triangles());
        for edge in self.triangles.iter().flat_map(|&t| triangle_edges(t)) {
            *counts.entry(edge).or_insert(0) += 1;
        }
        let count = |edge| counts.get(&edge).copied().unwrap_or(0);
        for [from, to] in self.triangles.iter().flat_map(|&t| triangle_edges(t)) {
            let (n_forward, n_backward) = (count([from, to]), count([to, from]));
            if (n_forward, n_backward) != (1, 1) {
                return Err(SkinError::Edge {
                    from,
                    to,
                    n_forward,
                    n_backward,
                });
            }
        }
        self.check_fans()
    }

    /// Walks once around every vertex: the triangles met must be all that it has.
    fn check_fans(&self) -> Result<(), SkinError> {
        let mut next_around = HashMap::with_capacity(3 * self.n_triangles());
        let mut fans = vec![(0, None); self.n_vertices()];
        for &[a, b, c] in &self.triangles {
            for [v, from, to] in [[a, b, c], [b, c, a], [c, a, b]] {
                next_around.insert([v, from], to);
                let (n_triangles, start) = &mut fans[v.index()];
                *n_triangles += 1;
                start.get_or_insert(from);
            }
        }
        for (i, &(n_triangles, start)) in fans.iter().enumerate() {
            let vertex = VertexIdx::from_index(i);
            let n_in_fan = start.map_or(0, |start| fan_length(&next_around, vertex, start));
            if n_triangles == 0 || n_in_fan != n_triangles {
                return Err(SkinError::Vertex {
                    vertex,
                    n_triangles,
                    n_in_fan,
                });
            }
        }
        Ok(())
    }
}

fn fan_length(
    next_around: &HashMap<[VertexIdx; 2], VertexIdx>,
    vertex: VertexIdx,
    start: VertexIdx,
) -> usize {
    let turn = |&at: &VertexIdx| {
        next_around
            .get(&[vertex, at])
            .copied()
            .filter(|&next| next != start)
    };
    std::iter::successors(Some(start), turn).count()
}

fn triangle_edges([a, b, c]: [VertexIdx; 3]) -> [[VertexIdx; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// `1/2 (x_1 - x_0) x (x_2 - x_0)`: along the outward normal, as long as the area.
fn area_vector(x: &[Point3<f64>; 3]) -> Vector3<f64> {
    0.5 * (x[1] - x[0]).cross(&(x[2] - x[0]))
}
