//! Rigid shapes as signed distances: gap, outward normal and curvature.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use plica_geometry::ConvexPolytope;

/// Below this distance from a centre or an axis the direction away from it is rounding \[m\].
const SMALLEST_DISTANCE_M: f64 = 1e-12;

/// A rigid shape in its own frame, with the conventions of the simulation's tools.
#[derive(Debug, Clone, PartialEq)]
pub enum Obstacle {
    /// Ball around the origin.
    Ball {
        /// Radius \[m\].
        radius_m: f64,
    },
    /// All points within a radius of the segment from the origin along +z.
    Capsule {
        /// Radius \[m\].
        radius_m: f64,
        /// Length of the segment \[m\].
        length_m: f64,
    },
    /// All points with `z <= 0`.
    HalfSpace,
    /// Convex polytope.
    Polytope(ConvexPolytope),
    /// All points of any part; their smallest signed distance counts.
    Union(Vec<Obstacle>),
    /// A shape at a pose of its own in the frame.
    Posed(Box<Obstacle>, Isometry3<f64>),
}

/// Signed distance `g` of a point to an obstacle and its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// `g`, negative inside \[m\].
    pub distance_m: f64,
    /// `n = dg/dp`, away from the obstacle; of unit length.
    pub normal: Vector3<f64>,
    /// `d2g/dp2` \[1/m\].
    pub curvature: Matrix3<f64>,
}

impl Obstacle {
    /// Gap of `point` \[m\] when the obstacle is at `pose`; an empty union is infinitely far.
    pub fn gap(&self, pose: &Isometry3<f64>, point: &Point3<f64>) -> Gap {
        let local = self.local_gap(&pose.inverse_transform_point(point));
        let rotation = pose.rotation.to_rotation_matrix();
        let curvature = rotation.matrix() * local.curvature * rotation.matrix().transpose();
        Gap { normal: rotation * local.normal, curvature, ..local }
    }

    /// Signed distance of `point` \[m\] when the obstacle is at `pose` \[m\].
    pub fn distance(&self, pose: &Isometry3<f64>, point: &Point3<f64>) -> f64 {
        self.local_gap(&pose.inverse_transform_point(point)).distance_m
    }

    fn local_gap(&self, point: &Point3<f64>) -> Gap {
        match self {
            Self::Ball { radius_m } => round(&point.coords, *radius_m, None),
            Self::Capsule { radius_m, length_m } => capsule(point, *radius_m, *length_m),
            Self::HalfSpace => flat(point.z, Vector3::z()),
            Self::Polytope(polytope) => {
                let face = polytope.distance(point);
                flat(face.distance_m, face.normal)
            }
            Self::Posed(part, pose) => part.gap(pose, point),
            Self::Union(parts) => {
                let nearest = parts.iter().map(|part| part.local_gap(point));
                let far = flat(f64::INFINITY, Vector3::z());
                nearest.fold(far, |best, gap| if gap.distance_m < best.distance_m { gap } else { best })
            }
        }
    }
}

fn flat(distance_m: f64, normal: Vector3<f64>) -> Gap {
    Gap { distance_m, normal, curvature: Matrix3::zeros() }
}

/// Half-spherical ends and, between them, a cylinder.
fn capsule(point: &Point3<f64>, radius_m: f64, length_m: f64) -> Gap {
    let nearest = point.z.clamp(0.0, length_m);
    let axis = (nearest == point.z).then(Vector3::z);
    round(&(point.coords - Vector3::z() * nearest), radius_m, axis)
}

/// `g = |r| - R`, `n = r / |r|`, `d2g/dp2 = (I - n n^T - a a^T) / |r|` with `r` from the nearest point of a centre (no
/// axis `a`) or of an axis.
fn round(r: &Vector3<f64>, radius_m: f64, axis: Option<Vector3<f64>>) -> Gap {
    let distance = r.norm();
    if distance < SMALLEST_DISTANCE_M {
        let aside = axis.map_or(Vector3::z(), |_| Vector3::x());
        return flat(distance - radius_m, aside);
    }
    let normal = r / distance;
    let straight = axis.map_or(Matrix3::zeros(), |a| a * a.transpose());
    let curvature = (Matrix3::identity() - normal * normal.transpose() - straight) / distance;
    Gap { distance_m: distance - radius_m, normal, curvature }
}
