//! Skin at rest as a target of contacts: points on it, thickness of the object behind them, frames around them.

use nalgebra::{Point3, Vector3};

use crate::index::{TriangleIdx, VertexIdx};
use crate::skin::Skin;

/// A tangential part shorter than this share of the stamp axis gives no direction.
const DEGENERATE: f64 = 0.1;
/// Hits nearer than this to the ray's origin are the origin itself \[m\].
const START: f64 = 1e-6;

/// Skin at rest with precomputed tables.
#[derive(Debug, Clone)]
pub struct ReferenceSkin {
    skin: Skin,
    areas: Vec<f64>,
    vertex_areas: Vec<f64>,
    vertex_normals: Vec<Vector3<f64>>,
}

/// A point of the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position \[m\].
    pub position: Point3<f64>,
    /// Triangle that contains it.
    pub triangle: TriangleIdx,
    /// Barycentric weights of the triangle's corners.
    pub weights: [f64; 3],
}

/// Axes at a point of the skin, orthonormal and right-handed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactFrame {
    /// Tangential part of the stamp axis.
    pub tau: Vector3<f64>,
    /// `normal x tau`.
    pub theta: Vector3<f64>,
    /// Outward normal.
    pub normal: Vector3<f64>,
}

impl ReferenceSkin {
    /// Prepares `skin`.
    pub fn new(skin: &Skin) -> Self {
        Self {
            areas: skin.triangle_areas(),
            vertex_areas: skin.vertex_areas(),
            vertex_normals: skin.vertex_normals(),
            skin: skin.clone(),
        }
    }

    /// The skin.
    pub fn skin(&self) -> &Skin {
        &self.skin
    }

    /// A third of the area of the triangles around each vertex, `[n_skin]` \[m2\].
    pub fn vertex_areas(&self) -> &[f64] {
        &self.vertex_areas
    }

    /// Outward unit normals of the vertices, `[n_skin]`.
    pub fn vertex_normals(&self) -> &[Vector3<f64>] {
        &self.vertex_normals
    }

    /// Outward unit normal of a triangle.
    pub fn triangle_normal(&self, triangle: TriangleIdx) -> Vector3<f64> {
        let [a, b, c] = self.skin.corner_positions(triangle);
        (b - a).cross(&(c - a)).normalize()
    }

    /// Triangles that may hold a point of `region` (boxes; none: everywhere), with cumulative areas.
    pub fn eligible(
        &self,
        region: &[[Point3<f64>; 2]],
        faces_tool: impl Fn(&Vector3<f64>) -> bool,
    ) -> Vec<(TriangleIdx, f64)> {
        let touches = |corners: &[Point3<f64>; 3]| {
            let low = corners[0].inf(&corners[1]).inf(&corners[2]);
            let high = corners[0].sup(&corners[1]).sup(&corners[2]);
            region.is_empty() || region.iter().any(|[l, h]| (0..3).all(|k| low[k] <= h[k] && high[k] >= l[k]))
        };
        let mut sum = 0.0;
        let mut eligible = Vec::new();
        for index in (0..self.skin.n_triangles()).map(TriangleIdx::from_index) {
            if touches(&self.skin.corner_positions(index)) && faces_tool(&self.triangle_normal(index)) {
                sum += self.areas[index.index()];
                eligible.push((index, sum));
            }
        }
        eligible
    }

    /// Point of the eligible triangles, uniform by area, from uniform numbers in `0..1`. `None` without triangles.
    pub fn draw(&self, eligible: &[(TriangleIdx, f64)], mut uniform: impl FnMut() -> f64) -> Option<SurfacePoint> {
        let total = eligible.last()?.1;
        let at = uniform() * total;
        let triangle = eligible[eligible.partition_point(|(_, sum)| *sum <= at).min(eligible.len() - 1)].0;
        // The unit square, folded over its diagonal: uniform, and without a root.
        let (mut v, mut w) = (uniform(), uniform());
        if v + w > 1.0 {
            (v, w) = (1.0 - v, 1.0 - w);
        }
        Some(self.point(triangle, [1.0 - v - w, v, w]))
    }

    fn point(&self, triangle: TriangleIdx, weights: [f64; 3]) -> SurfacePoint {
        SurfacePoint { position: mix(&self.skin.corner_positions(triangle), weights), triangle, weights }
    }

    /// The nearest point of the skin.
    pub fn nearest(&self, p: &Point3<f64>) -> SurfacePoint {
        let indices = (0..self.skin.n_triangles()).map(TriangleIdx::from_index);
        let points = indices.map(|t| self.point(t, closest_weights(p, &self.skin.corner_positions(t))));
        let nearer = |a: SurfacePoint, b: SurfacePoint| {
            if (b.position - p).norm_squared() < (a.position - p).norm_squared() { b } else { a }
        };
        points.reduce(nearer).expect("a skin has triangles")
    }

    /// The nearest point of the triangles around a vertex.
    pub fn nearest_around(&self, p: &Point3<f64>, around: &[TriangleIdx]) -> Option<SurfacePoint> {
        let points = around.iter().map(|&t| self.point(t, closest_weights(p, &self.skin.corner_positions(t))));
        points.min_by(|a, b| (a.position - p).norm_squared().total_cmp(&(b.position - p).norm_squared()))
    }

    /// A vertex as a point of the skin.
    pub fn vertex(&self, v: VertexIdx) -> Option<SurfacePoint> {
        let triangle = self.skin.triangles().iter().position(|corners| corners.contains(&v))?;
        let weights = self.skin.triangles()[triangle].map(|c| f64::from(u8::from(c == v)));
        Some(self.point(TriangleIdx::from_index(triangle), weights))
    }

    /// Normal at a point, interpolated from the corners: continuous across edges.
    pub fn normal(&self, point: &SurfacePoint) -> Vector3<f64> {
        let corners = self.skin.triangles()[point.triangle.index()];
        let sum: Vector3<f64> =
            corners.iter().zip(point.weights).map(|(v, w)| self.vertex_normals[v.index()] * w).sum();
        sum.try_normalize(1e-9).unwrap_or_else(|| self.triangle_normal(point.triangle))
    }

    /// A field given at vertices, `[n_skin]`, at a point.
    pub fn interpolate(&self, point: &SurfacePoint, field: &[Vector3<f64>]) -> Vector3<f64> {
        let corners = self.skin.triangles()[point.triangle.index()];
        corners.iter().zip(point.weights).map(|(v, w)| field[v.index()] * w).sum()
    }

    /// Thickness of the object from `start`, a point of the skin, along the unit vector `direction` \[m\].
    pub fn thickness(&self, start: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let indices = (0..self.skin.n_triangles()).map(TriangleIdx::from_index);
        let hits = indices.filter_map(|t| ray_hits(start, direction, &self.skin.corner_positions(t)));
        hits.filter(|distance| *distance > START).reduce(f64::min)
    }

    /// Axes at a point: `tau` along the tangential part of the first axis that has one.
    pub fn frame(&self, point: &SurfacePoint, axes: &[Vector3<f64>; 2]) -> ContactFrame {
        frame_around(&self.normal(point), axes)
    }
}

/// Axes around a unit normal: `tau` along the tangential part of the first axis that has one.
pub fn frame_around(normal: &Vector3<f64>, axes: &[Vector3<f64>; 2]) -> ContactFrame {
    let tangential = |axis: &Vector3<f64>| (axis - normal * normal.dot(axis)).try_normalize(DEGENERATE * axis.norm());
    let tau = axes.iter().find_map(tangential).unwrap_or_else(|| any_tangent(normal));
    ContactFrame { tau, theta: normal.cross(&tau), normal: *normal }
}

/// Tangent for an axis or two along the normal: from the coordinate axis farthest from the normal.
fn any_tangent(normal: &Vector3<f64>) -> Vector3<f64> {
    let axis = Vector3::ith(normal.iamin(), 1.0);
    (axis - normal * normal.dot(&axis)).normalize()
}

fn mix(corners: &[Point3<f64>; 3], weights: [f64; 3]) -> Point3<f64> {
    Point3::from(corners.iter().zip(weights).map(|(c, w)| c.coords * w).sum::<Vector3<f64>>())
}

/// Distance along the ray to the triangle \[MT97\].
fn ray_hits(origin: &Point3<f64>, direction: &Vector3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(&ac);
    let determinant = ab.dot(&p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - a;
    let q = s.cross(&ab);
    let (v, w) = (s.dot(&p) / determinant, direction.dot(&q) / determinant);
    (v >= 0.0 && w >= 0.0 && v + w <= 1.0).then(|| ac.dot(&q) / determinant)
}

/// Barycentric weights of the point of the triangle that is nearest to `p` \[Ericson05, 5.1.5\].
fn closest_weights(p: &Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> [f64; 3] {
    let (ab, ac, ap, bp, cp) = (b - a, c - a, p - a, p - b, p - c);
    let (d1, d2, d3, d4, d5, d6) = (ab.dot(&ap), ac.dot(&ap), ab.dot(&bp), ac.dot(&bp), ab.dot(&cp), ac.dot(&cp));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    [1.0 - vb / sum - vc / sum, vb / sum, vc / sum]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;
    use crate::shapes::{Wedge, wedge_skin};

    fn wedge() -> ReferenceSkin {
        ReferenceSkin::new(&wedge_skin(&Wedge::default(), 4e-3))
    }

    #[test]
    fn points_are_uniform_by_area_and_lie_in_the_region() {
        let skin = wedge();
        let region = [[Point3::new(0.02, 0.012, -1.0), Point3::new(0.08, 0.048, 1.0)]];
        let eligible = skin.eligible(&region, |n| n.z > 0.2);
        // A Weyl sequence: its steps are equidistributed.
        let mut n = 0.0;
        let mut uniform = || {
            n += 1.0;
            (n * 0.569_840_290_998_053_2_f64 + n * n * 0.754_877_666_246_692_7) % 1.0
        };
        let (mut left, mut all) = (0, 0);
        while all < 4000 {
            let p = skin.draw(&eligible, &mut uniform).unwrap().position;
            if (0.02..0.08).contains(&p.x) && (0.012..0.048).contains(&p.y) {
                assert!((p.z - Wedge::default().height_m(p.x)).abs() < 1e-12, "{p}");
                all += 1;
                left += i32::from(p.x < 0.035);
            }
        }
        // A quarter of the region, within four standard deviations.
        assert!((f64::from(left) / 4000.0 - 0.25).abs() < 4.0 * (0.25_f64 * 0.75 / 4000.0).sqrt(), "{left}");
    }

    #[test]
    fn thickness_is_the_height_of_the_wedge() {
        let skin = wedge();
        for (x, y) in [(0.0137, 0.0211), (0.05, 0.03), (0.11, 0.04)] {
            let top = Point3::new(x, y, Wedge::default().height_m(x));
            let down = skin.thickness(&top, &-Vector3::z()).unwrap();
            assert!((down - top.z).abs() < 1e-12);
            assert_eq!(skin.thickness(&top, &Vector3::z()), None);
        }
    }

    #[test]
    fn the_nearest_point_is_found_over_faces_edges_and_corners() {
        let skin = wedge();
        let near = |p| skin.nearest(&p).position;
        assert!((near(Point3::new(0.05, 0.03, -0.01)) - Point3::new(0.05, 0.03, 0.0)).norm() < 1e-12);
        assert!((near(Point3::new(-0.01, 0.03, -0.01)) - Point3::new(0.0, 0.03, 0.0)).norm() < 1e-12);
        assert!((near(Point3::new(-1.0, -1.0, -1.0)) - Point3::origin()).norm() < 1e-12);
        let inside = Point3::new(0.0611, 0.0301, 0.02);
        let found = skin.nearest(&inside);
        assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!((found.position - inside).norm() < 0.005);
    }

    #[test]
    fn frames_are_orthonormal_and_follow_the_stamp_axis() {
        let skin = wedge();
        let axes = [Vector3::x(), Vector3::y()];
        let top = skin.nearest(&Point3::new(0.05, 0.03, 0.0275));
        let frame = skin.frame(&top, &axes);
        let slope = Vector3::new(1.0, 0.0, -0.25).normalize();
        assert!((frame.tau - slope).norm() < 1e-9 && (frame.theta - Vector3::y()).norm() < 1e-9, "{frame:?}");
        let end = skin.frame(&skin.nearest(&Point3::new(0.12, 0.03, 0.005)), &axes);
        assert!((end.tau - Vector3::y()).norm() < 1e-9, "the second axis stands in: {end:?}");
        let parallel = skin.frame(&top, &[frame.normal, frame.normal]);
        assert!((parallel.tau.norm() - 1.0).abs() < 1e-12 && parallel.tau.dot(&parallel.normal).abs() < 1e-12);
    }
}
