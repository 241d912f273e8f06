//! The skin at rest, as enrichment asks for it: the nearest vertex, the frame at a contact point.

use nalgebra::{Point3, Vector3};
use plica_geometry::{ContactFrame, ReferenceSkin, Skin, SurfacePoint, TriangleIdx, VertexIdx};

use super::groups::{Groups, Planar};
use crate::lanes::{F, LANES, dot};

/// Tables of the skin at rest.
#[derive(Debug, Clone)]
pub(crate) struct Surface {
    reference: ReferenceSkin,
    /// Triangles around each vertex.
    fans: Vec<Vec<TriangleIdx>>,
    rest: Planar,
    normals: Planar,
    axes: [Vector3<f64>; 2],
}

/// A contact point with its frame on the reference skin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub(crate) point: SurfacePoint,
    pub(crate) corners: [VertexIdx; 3],
    pub(crate) frame: ContactFrame,
}

impl Surface {
    /// Frames lie along the tangential part of the first of `axes` that has one.
    pub(crate) fn new(skin: &Skin, axes: [Vector3<f64>; 2]) -> Self {
        let (reference, groups) = (ReferenceSkin::new(skin), Groups::new(skin.n_vertices()));
        Self {
            fans: fans(skin),
            rest: Planar::new(groups, |v| skin.positions()[v].coords.into()),
            normals: Planar::new(groups, |v| reference.vertex_normals()[v].into()),
            reference,
            axes,
        }
    }

    pub(crate) fn reference(&self) -> &ReferenceSkin {
        &self.reference
    }

    pub(crate) fn groups(&self) -> Groups {
        Groups::new(self.n_vertices())
    }

    pub(crate) fn n_vertices(&self) -> usize {
        self.reference.skin().n_vertices()
    }

    /// Positions at rest \[m\].
    pub(crate) fn rest(&self) -> &Planar {
        &self.rest
    }

    /// Outward unit normals at rest.
    pub(crate) fn normals(&self) -> &Planar {
        &self.normals
    }

    pub(crate) fn axes(&self) -> &[Vector3<f64>; 2] {
        &self.axes
    }

    /// The point of the skin next to a contact point: among the triangles around the nearest vertex.
    pub(crate) fn place(&self, contact_point: &Point3<f64>) -> Place {
        let vertex = self.nearest(contact_point);
        let point = self.reference.nearest_around(contact_point, &self.fans[vertex]);
        let point = point.unwrap_or_else(|| unreachable!("every vertex of a skin has triangles"));
        let corners = self.reference.skin().triangles()[point.triangle.index()];
        Place { corners, frame: self.reference.frame(&point, &self.axes), point }
    }

    /// The vertex nearest to a point, sixteen at a time.
    pub(crate) fn nearest(&self, p: &Point3<f64>) -> usize {
        let p = p.coords.cast::<f32>();
        let (mut least, mut group) = (F::splat(f32::INFINITY), F::ZERO);
        for g in 0..self.groups().n() {
            let d = std::array::from_fn(|k| self.rest.axis(k)[g] - F::splat(p[k]));
            let squared = dot(d, d);
            let is_nearer = squared.simd_lt(least);
            least = least.fast_min(squared);
            group = is_nearer.bitselect(F::splat(g as f32), group);
        }
        let (least, group) = (least.to_array(), group.to_array());
        let lane = (1..LANES).fold(0, |best, lane| if least[lane] < least[best] { lane } else { best });
        (group[lane] as usize * LANES + lane).min(self.n_vertices() - 1)
    }
}

fn fans(skin: &Skin) -> Vec<Vec<TriangleIdx>> {
    let mut fans = vec![Vec::new(); skin.n_vertices()];
    for (t, corners) in skin.triangles().iter().enumerate() {
        corners.iter().for_each(|v| fans[v.index()].push(TriangleIdx::from_index(t)));
    }
    fans
}
