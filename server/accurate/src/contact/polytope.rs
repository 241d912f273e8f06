//! Convex polytopes as intersections of half-spaces.

use nalgebra::{Point3, Vector3};

/// Share of the extent by which a point may lie above a face and count as part of it.
const FLAT: f64 = 1e-9;

/// Intersection of half-spaces `normal . p <= offset`.
///
/// Its distance is the largest one to a face plane: exact inside and where a face is nearest, and too small outside of
/// edges and corners, where faces go on mitred. It is convex and piecewise linear.
#[derive(Debug, Clone, PartialEq)]
pub struct Polytope {
    planes: Vec<(Vector3<f64>, f64)>,
}

/// Why planes or points do not make a polytope.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PolytopeError {
    /// No plane, or a number that is not finite, or a normal without length.
    #[error("{n_planes} planes, of which the first unusable one is number {first_unusable}")]
    Planes {
        /// Planes given.
        n_planes: usize,
        /// The first that has no direction or is not finite; `n_planes` if there is none at all.
        first_unusable: usize,
    },
    /// The points do not span a volume.
    #[error("the hull of {n_points} points spans no volume")]
    Flat {
        /// Points given.
        n_points: usize,
    },
}

impl Polytope {
    /// From planes: outward normals of any length, and a point of each plane \[m\].
    ///
    /// # Errors
    /// [`PolytopeError::Planes`].
    pub fn new(planes: &[(Vector3<f64>, Point3<f64>)]) -> Result<Self, PolytopeError> {
        let n_planes = planes.len();
        let is_usable = |(n, p): &(Vector3<f64>, Point3<f64>)| {
            n.norm().is_finite() && n.norm() > 0.0 && p.coords.iter().all(|c| c.is_finite())
        };
        let first_unusable = planes.iter().position(|plane| !is_usable(plane));
        if n_planes == 0 || first_unusable.is_some() {
            return Err(PolytopeError::Planes { n_planes, first_unusable: first_unusable.unwrap_or(n_planes) });
        }
        let unit = |(n, p): &(Vector3<f64>, Point3<f64>)| (n.normalize(), n.normalize().dot(&p.coords));
        Ok(Self { planes: planes.iter().map(unit).collect() })
    }

    /// Box around the origin, from half of each edge \[m\].
    ///
    /// # Errors
    /// [`PolytopeError::Planes`]: an edge that is not finite.
    pub fn cuboid(half_extents_m: [f64; 3]) -> Result<Self, PolytopeError> {
        let face = |side: usize| {
            let sign = if side.is_multiple_of(2) { 1.0 } else { -1.0 };
            let normal = Vector3::ith(side / 2, sign);
            (normal, Point3::from(normal * half_extents_m[side / 2]))
        };
        Self::new(&(0..6).map(face).collect::<Vec<_>>())
    }

    /// Convex hull of `points` \[m\]: every plane through three of them with none above. Meant for tools of up to a few
    /// hundred points; the time grows with the third power of their number, and with the fourth at worst.
    ///
    /// # Errors
    /// [`PolytopeError::Flat`]: they lie in a plane, or are not finite.
    pub fn hull(points: &[Point3<f64>]) -> Result<Self, PolytopeError> {
        let flat = PolytopeError::Flat { n_points: points.len() };
        let extent = points.iter().map(|p| (p - points[0]).norm()).fold(0.0, f64::max);
        let mut planes: Vec<(Vector3<f64>, f64)> = Vec::new();
        for (i, a) in points.iter().enumerate() {
            for (j, b) in points.iter().enumerate().skip(i + 1) {
                for c in &points[j + 1..] {
                    let Some(plane) = face_through([a, b, c], points, extent) else { continue };
                    let is_new = planes.iter().all(|p| (p.0 - plane.0).norm() > FLAT.sqrt());
                    if is_new {
                        planes.push(plane);
                    }
                }
            }
        }
        let is_solid = planes.len() >= 4 && points.iter().all(|p| p.coords.iter().all(|c| c.is_finite()));
        if is_solid { Ok(Self { planes }) } else { Err(flat) }
    }

    /// Largest signed distance to a face plane \[m\], and the face's outward normal.
    pub fn distance(&self, point: &Point3<f64>) -> (f64, Vector3<f64>) {
        let distances = self.planes.iter().map(|(normal, offset)| (normal.dot(&point.coords) - offset, *normal));
        distances.fold((f64::NEG_INFINITY, Vector3::z()), |best, face| if face.0 > best.0 { face } else { best })
    }

    /// Outward unit normals and offsets \[m\] of the faces.
    pub fn planes(&self) -> &[(Vector3<f64>, f64)] {
        &self.planes
    }
}

/// The plane through three points, if all points lie on one side of it and some of them off it; its offset leaves none above.
fn face_through(corners: [&Point3<f64>; 3], points: &[Point3<f64>], extent: f64) -> Option<(Vector3<f64>, f64)> {
    let [a, b, c] = corners;
    let across = (b - a).cross(&(c - a));
    if across.norm() <= FLAT.sqrt() * extent * extent {
        return None;
    }
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for p in points {
        let height = across.dot(&(p - a)) / across.norm();
        low = low.min(height);
        high = high.max(height);
        if low < -FLAT * extent && high > FLAT * extent {
            return None;
        }
    }
    let sign = if high <= FLAT * extent { 1.0 } else { -1.0 };
    let normal = across.normalize() * sign;
    let has_depth = low.min(-high) < -FLAT * extent;
    has_depth.then(|| (normal, points.iter().map(|p| normal.dot(&p.coords)).fold(f64::NEG_INFINITY, f64::max)))
}
