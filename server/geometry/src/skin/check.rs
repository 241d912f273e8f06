//! Checks of a skin: valid values, a closed manifold.

use std::collections::HashMap;

use super::{Skin, area_vector, triangle_edges};
use crate::index::{TriangleIdx, VertexIdx};

/// Error of a skin's vertices and triangles.
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
        /// Start of the edge.
        from: VertexIdx,
        /// End of the edge.
        to: VertexIdx,
        /// Triangles that run along it.
        n_forward: usize,
        /// Triangles that run against it.
        n_backward: usize,
    },
    /// The triangles at a vertex form no single fan: none at all, or surfaces that touch in a point.
    #[error("the {n_triangles} triangles at vertex {vertex} form no single fan (one closed fan has {n_in_fan})")]
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
    pub(super) fn check_values(&self) -> Result<(), SkinError> {
        let n_vertices = self.n_vertices();
        if self.triangles.is_empty() {
            return Err(SkinError::Empty { n_vertices });
        }
        if let Some(v) = self.positions.iter().position(|x| x.iter().any(|c| !c.is_finite())) {
            let position = self.positions[v].coords.into();
            return Err(SkinError::NonFinite { vertex: VertexIdx::from_index(v), position });
        }
        for (t, corners) in self.triangles.iter().enumerate() {
            let triangle = TriangleIdx::from_index(t);
            if let Some(&vertex) = corners.iter().find(|v| v.index() >= n_vertices) {
                return Err(SkinError::VertexOutOfRange { triangle, vertex, n_vertices });
            }
            let area = area_vector(&self.corner_positions(triangle)).norm();
            let has_area = area > 0.0;
            if !has_area {
                return Err(SkinError::Degenerate { triangle, area });
            }
        }
        Ok(())
    }

    pub(super) fn check_manifold(&self) -> Result<(), SkinError> {
        let mut counts: HashMap<[VertexIdx; 2], usize> = HashMap::with_capacity(3 * self.n_triangles());
        for edge in self.triangles.iter().flat_map(|&t| triangle_edges(t)) {
            *counts.entry(edge).or_insert(0) += 1;
        }
        let count = |edge| counts.get(&edge).copied().unwrap_or(0);
        for [from, to] in self.triangles.iter().flat_map(|&t| triangle_edges(t)) {
            let (n_forward, n_backward) = (count([from, to]), count([to, from]));
            if (n_forward, n_backward) != (1, 1) {
                return Err(SkinError::Edge { from, to, n_forward, n_backward });
            }
        }
        self.check_fans()
    }

    /// Walks once around every vertex: the fan must hold all its triangles.
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
                return Err(SkinError::Vertex { vertex, n_triangles, n_in_fan });
            }
        }
        Ok(())
    }
}

fn fan_length(next_around: &HashMap<[VertexIdx; 2], VertexIdx>, vertex: VertexIdx, start: VertexIdx) -> usize {
    let turn = |&at: &VertexIdx| next_around.get(&[vertex, at]).copied().filter(|&next| next != start);
    std::iter::successors(Some(start), turn).count()
}
