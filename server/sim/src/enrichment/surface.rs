//! Skin at rest: search for the nearest vertex, frame at a contact point.

use nalgebra::{Point3, Vector3};
use plica_geometry::{CLUSTER_SIZE, ContactFrame, ReferenceSkin, Skin, SurfacePoint, TriangleIdx, VertexIdx};

use super::groups::{Groups, Planar};

/// Tables of the skin at rest.
#[derive(Debug, Clone)]
pub(crate) struct Surface {
    reference: ReferenceSkin,
    /// Triangles around each vertex.
    fans: Vec<Vec<TriangleIdx>>,
    /// Low and high corner of each cluster of vertices \[m\].
    boxes: Vec<[Point3<f64>; 2]>,
    rest: Planar,
    normals: Planar,
    axes: [Vector3<f64>; 2],
}

/// A contact point on the reference skin, with its frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FramedPoint {
    pub(crate) point: SurfacePoint,
    pub(crate) corners: [VertexIdx; 3],
    pub(crate) frame: ContactFrame,
}

/// Nearest vertex found so far.
struct NearestVertex {
    vertex: usize,
    /// Squared distance \[m^2\].
    squared: f64,
}

impl Surface {
    /// Frames lie along the tangential part of the first of `axes` that has one.
    pub(crate) fn new(skin: &Skin, axes: [Vector3<f64>; 2]) -> Self {
        let (reference, groups) = (ReferenceSkin::new(skin), Groups::new(skin.n_vertices()));
        Self {
            fans: fans(skin),
            boxes: skin.positions().chunks(CLUSTER_SIZE).map(bounds).collect(),
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
    pub(crate) fn framed_point(&self, contact_point: &Point3<f64>) -> FramedPoint {
        let vertex = self.nearest(contact_point);
        let point = self.reference.nearest_around(contact_point, &self.fans[vertex]);
        let point = point.unwrap_or_else(|| unreachable!("every vertex of a skin has triangles"));
        let corners = self.reference.skin().triangles()[point.triangle.index()];
        FramedPoint { corners, frame: self.reference.frame(&point, &self.axes), point }
    }

    /// The vertex nearest to a point; skips clusters whose boxes are farther away than the best vertex so far.
    pub(crate) fn nearest(&self, p: &Point3<f64>) -> usize {
        let squared = |[low, high]: &[Point3<f64>; 2]| (p - p.sup(low).inf(high)).norm_squared();
        let first = (0..self.boxes.len()).min_by(|a, b| squared(&self.boxes[*a]).total_cmp(&squared(&self.boxes[*b])));
        let mut best = NearestVertex { vertex: 0, squared: f64::INFINITY };
        self.search_cluster(first.unwrap_or(0), p, &mut best);
        for (cluster, bounds) in self.boxes.iter().enumerate() {
            if squared(bounds) < best.squared {
                self.search_cluster(cluster, p, &mut best);
            }
        }
        best.vertex
    }

    fn search_cluster(&self, cluster: usize, p: &Point3<f64>, best: &mut NearestVertex) {
        let first = cluster * CLUSTER_SIZE;
        for (lane, q) in self.reference.skin().positions()[first..].iter().take(CLUSTER_SIZE).enumerate() {
            let squared = (p - q).norm_squared();
            if squared < best.squared {
                *best = NearestVertex { vertex: first + lane, squared };
            }
        }
    }
}

fn bounds(positions: &[Point3<f64>]) -> [Point3<f64>; 2] {
    let first = positions[0];
    positions.iter().fold([first, first], |[low, high], p| [low.inf(p), high.sup(p)])
}

fn fans(skin: &Skin) -> Vec<Vec<TriangleIdx>> {
    let mut fans = vec![Vec::new(); skin.n_vertices()];
    for (t, corners) in skin.triangles().iter().enumerate() {
        corners.iter().for_each(|v| fans[v.index()].push(TriangleIdx::from_index(t)));
    }
    fans
}

#[cfg(test)]
mod tests {
    use plica_geometry::shapes::{Wedge, wedge_skin};

    use super::*;

    #[test]
    fn the_nearest_vertex_is_nearer_than_all_others() {
        let surface = Surface::new(&wedge_skin(&Wedge::default(), 3e-3).clustered(), [Vector3::x(), Vector3::y()]);
        let positions = surface.reference().skin().positions();
        for k in 0..200 {
            let share = |n: i32| f64::from(k * n % 101) / 100.0;
            let p = Point3::new(0.14 * share(17) - 0.01, 0.08 * share(29) - 0.01, 0.05 * share(43) - 0.005);
            let least = positions.iter().map(|q| (q - p).norm()).fold(f64::INFINITY, f64::min);
            assert!((positions[surface.nearest(&p)] - p).norm() <= least, "{p}");
        }
    }
}
