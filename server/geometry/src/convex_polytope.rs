//! Convex polytope: hull of points as face planes, vertices and surface triangles.

use nalgebra::{Point3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::try_convex_hull;

/// Largest difference between unit normals of facets that count as one face.
const COPLANAR: f64 = 3e-5;
/// Smallest depth of a solid below each of its faces, as a share of its extent.
const FLAT: f64 = 1e-9;

/// Convex hull of points, which is the intersection of the half-spaces below its faces.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexPolytope {
    points: Vec<Point3<f64>>,
    planes: Vec<FacePlane>,
    vertices: Vec<Point3<f64>>,
    triangles: Vec<[usize; 3]>,
}

/// Half-space `normal . p <= offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacePlane {
    /// Outward unit normal.
    pub normal: Vector3<f64>,
    /// Distance of the plane from the origin along the normal \[m\].
    pub offset_m: f64,
    /// Index of one of the face's triangles.
    pub triangle: usize,
}

/// Signed distance of a point to the face plane farthest below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaceDistance {
    /// Signed distance, negative inside \[m\].
    pub distance_m: f64,
    /// Outward unit normal of the face.
    pub normal: Vector3<f64>,
}

/// Points without a solid hull: they lie in a plane, or a coordinate is not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the hull of {n_points} points has no volume")]
pub struct HullError {
    /// Points given.
    pub n_points: usize,
}

impl ConvexPolytope {
    /// Convex hull of `points` \[m\].
    ///
    /// # Errors
    /// See [`HullError`].
    pub fn hull(points: Vec<Point3<f64>>) -> Result<Self, HullError> {
        let flat = HullError { n_points: points.len() };
        if !points.iter().all(|p| p.coords.iter().all(|c| c.is_finite())) {
            return Err(flat);
        }
        let given: Vec<_> = points.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let (vertices, triangles) = try_convex_hull(&given).map_err(|_| flat)?;
        let vertices: Vec<_> = vertices.iter().map(|v| Point3::new(v.x, v.y, v.z)).collect();
        let triangles: Vec<_> = triangles.iter().map(|t| t.map(|v| v as usize)).collect();
        let planes = face_planes(&points, &vertices, &triangles);
        if is_solid(&planes, &vertices) { Ok(Self { points, planes, vertices, triangles }) } else { Err(flat) }
    }

    /// Box around the origin, from half of each edge \[m\].
    ///
    /// # Errors
    /// [`HullError`]: an edge has no length or is not finite.
    pub fn cuboid(half_extents_m: [f64; 3]) -> Result<Self, HullError> {
        let corner = |i: usize| {
            let side = |axis: usize| if i >> axis & 1 == 0 { -half_extents_m[axis] } else { half_extents_m[axis] };
            Point3::new(side(0), side(1), side(2))
        };
        Self::hull((0..8).map(corner).collect())
    }

    /// All given points, inside the hull too \[m\].
    pub fn points(&self) -> &[Point3<f64>] {
        &self.points
    }

    /// One plane per face; coplanar triangles share theirs.
    pub fn planes(&self) -> &[FacePlane] {
        &self.planes
    }

    /// Vertices of the hull \[m\].
    pub fn vertices(&self) -> &[Point3<f64>] {
        &self.vertices
    }

    /// Surface triangles as indices into [`Self::vertices`], counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// `max_f (n_f . p - o_f)` over the faces `f`, and the normal of the largest.
    ///
    /// Exact inside and where a face is nearest; too small outside of edges and corners, where faces are mitred. Convex and
    /// piecewise linear.
    pub fn distance(&self, point: &Point3<f64>) -> FaceDistance {
        let below_all = FaceDistance { distance_m: f64::NEG_INFINITY, normal: Vector3::z() };
        self.planes.iter().fold(below_all, |best, plane| {
            let distance_m = plane.normal.dot(&point.coords) - plane.offset_m;
            if distance_m > best.distance_m { FaceDistance { distance_m, normal: plane.normal } } else { best }
        })
    }
}

/// Distinct normals of the triangles, each with the smallest offset that leaves no point above the plane.
fn face_planes(points: &[Point3<f64>], vertices: &[Point3<f64>], triangles: &[[usize; 3]]) -> Vec<FacePlane> {
    let mut planes: Vec<FacePlane> = Vec::new();
    for (triangle, corners) in triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|v| vertices[v]);
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        if planes.iter().all(|plane| (plane.normal - normal).norm_squared() > COPLANAR * COPLANAR) {
            let offset_m = points.iter().map(|p| normal.dot(&p.coords)).fold(f64::NEG_INFINITY, f64::max);
            planes.push(FacePlane { normal, offset_m, triangle });
        }
    }
    planes
}

/// Whether a closed surface of at least four faces has depth below each of them.
fn is_solid(planes: &[FacePlane], vertices: &[Point3<f64>]) -> bool {
    let extent = vertices.iter().map(|v| (v - vertices[0]).norm()).fold(0.0, f64::max);
    let depth =
        |plane: &FacePlane| vertices.iter().map(|v| plane.offset_m - plane.normal.dot(&v.coords)).fold(0.0, f64::max);
    planes.len() >= 4 && planes.iter().all(|plane| depth(plane) > FLAT * extent)
}
