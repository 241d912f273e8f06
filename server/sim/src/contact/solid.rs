//! Tool and plane shapes as signed distances. Everything that the run-time phase asks of a shape is exact and cheap: the
//! general convex shape is an intersection of half-spaces, whose hull the collision library computes once.

use nalgebra::Point3;
use parry3d::math::Vector;
use parry3d::shape::ConvexPolyhedron;

use super::{M3, V3};
use crate::description::ToolShape;

/// A shape in its own frame.
#[derive(Debug, Clone)]
pub(crate) enum Solid {
    /// All points within `radius` of the segment `a b`; a ball if they coincide.
    Round { a: V3, b: V3, radius: f32 },
    /// Union of convex polytopes.
    Polytopes(Vec<Polytope>),
    /// The half-space below `normal . x = 0`.
    HalfSpace { normal: V3 },
}

/// Intersection of half-spaces `normal . x <= offset`.
#[derive(Debug, Clone)]
pub(crate) struct Polytope {
    planes: Vec<(V3, f32)>,
    pub(crate) vertices: Vec<V3>,
    pub(crate) center: V3,
}

/// Where a shape is: `world <- shape`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placement {
    pub(crate) rotation: M3,
    pub(crate) origin: V3,
}

impl Placement {
    pub(crate) fn to_world(self, p: V3) -> V3 {
        self.rotation * p + self.origin
    }

    pub(crate) fn to_local(self, p: V3) -> V3 {
        self.rotation.tr_mul(&(p - self.origin))
    }
}

impl Solid {
    /// `None` if the points of a hull do not span a volume.
    pub(crate) fn new(shape: &ToolShape) -> Option<Self> {
        match shape {
            ToolShape::Ball { radius_m } => {
                Some(Self::Round { a: V3::zeros(), b: V3::zeros(), radius: *radius_m as f32 })
            }
            ToolShape::Capsule { radius_m, length_m } => {
                Some(Self::Round { a: V3::zeros(), b: V3::z() * *length_m as f32, radius: *radius_m as f32 })
            }
            ToolShape::Cuboid { half_extents_m } => {
                let h = half_extents_m;
                let corner = |i: usize| {
                    let sign = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
                    Point3::new(sign(0) * h[0], sign(1) * h[1], sign(2) * h[2])
                };
                Some(Self::Polytopes(vec![Polytope::hull(&(0..8).map(corner).collect::<Vec<_>>())?]))
            }
            ToolShape::ConvexHull { points_m } => Some(Self::Polytopes(vec![Polytope::hull(points_m)?])),
            ToolShape::Compound { hulls_m } => {
                Some(Self::Polytopes(hulls_m.iter().map(|h| Polytope::hull(h)).collect::<Option<_>>()?))
            }
        }
    }

    /// Whether a contact point is looked for along the tool's axis (z) rather than around the touching skin.
    pub(crate) fn has_axis(&self) -> bool {
        match self {
            Self::Round { a, b, .. } => a != b,
            Self::Polytopes(_) => true,
            Self::HalfSpace { .. } => false,
        }
    }

    /// Low and high corner of the placed shape \[m\]; infinite for a half-space.
    pub(crate) fn bounds(&self, placement: &Placement) -> [V3; 2] {
        let mut low = V3::repeat(f32::INFINITY);
        let mut high = -low;
        let mut extend = |p: V3, radius: f32| {
            let p = placement.to_world(p);
            low = low.inf(&p.add_scalar(-radius));
            high = high.sup(&p.add_scalar(radius));
        };
        match self {
            Self::Round { a, b, radius } => [a, b].into_iter().for_each(|p| extend(*p, *radius)),
            Self::Polytopes(parts) => parts.iter().flat_map(|p| &p.vertices).for_each(|p| extend(*p, 0.0)),
            Self::HalfSpace { .. } => return [-V3::repeat(f32::INFINITY), V3::repeat(f32::INFINITY)],
        }
        [low, high]
    }

    /// Signed distance of a local point \[m\] and the outward normal there.
    pub(crate) fn distance(&self, p: &V3) -> (f32, V3) {
        match self {
            Self::Round { a, b, radius } => {
                let from_axis = p - (a + (b - a) * nearest_on_segment(p, a, b));
                let length = from_axis.norm();
                let normal = if length > 0.0 { from_axis / length } else { V3::z() };
                (length - radius, normal)
            }
            Self::Polytopes(parts) => {
                let nearer = |a: (f32, V3), b: (f32, V3)| if b.0 < a.0 { b } else { a };
                parts.iter().map(|part| part.distance(p)).reduce(nearer).unwrap_or((f32::INFINITY, V3::z()))
            }
            Self::HalfSpace { normal } => (normal.dot(p), *normal),
        }
    }

    /// Farthest point from the origin \[m\].
    pub(crate) fn reach(&self) -> f32 {
        match self {
            Self::Round { a, b, radius } => a.norm().max(b.norm()) + radius,
            Self::Polytopes(parts) => parts.iter().flat_map(|p| &p.vertices).map(|p| p.norm()).fold(0.0, f32::max),
            Self::HalfSpace { .. } => 0.0,
        }
    }
}

impl Polytope {
    fn hull(points: &[Point3<f64>]) -> Option<Self> {
        let points: Vec<Vector> = points.iter().map(|p| Vector::new(p.x as f32, p.y as f32, p.z as f32)).collect();
        let hull = ConvexPolyhedron::from_convex_hull(&points)?;
        let plain = |v: &Vector| V3::new(v.x, v.y, v.z);
        let vertices: Vec<V3> = hull.points().iter().map(plain).collect();
        let support = |normal: &V3| vertices.iter().map(|v| normal.dot(v)).fold(f32::NEG_INFINITY, f32::max);
        let planes = hull.faces().iter().map(|f| plain(&f.normal)).map(|n| (n, support(&n))).collect();
        let center = vertices.iter().sum::<V3>() / vertices.len() as f32;
        Some(Self { planes, vertices, center })
    }

    /// Signed distance and outward normal of the nearest face; mitred outside edges, exact on and inside the surface.
    pub(crate) fn distance(&self, p: &V3) -> (f32, V3) {
        let mut best = (f32::NEG_INFINITY, V3::z());
        for (normal, offset) in &self.planes {
            let d = normal.dot(p) - offset;
            if d > best.0 {
                best = (d, *normal);
            }
        }
        best
    }

    /// Smallest signed distance inside the segment `p q`, where it lies strictly between the ends: parameter, distance and
    /// the normal that is orthogonal to the segment. The distance is a maximum of linear functions along the segment.
    pub(crate) fn distance_to_segment(&self, p: &V3, q: &V3) -> Option<(f32, f32, V3)> {
        let line = |t: f32| {
            let (_, normal) = self.distance(&(p + (q - p) * t));
            let offset = self.planes.iter().find(|f| f.0 == normal).map_or(0.0, |f| f.1);
            (normal.dot(p) - offset, normal.dot(&(q - p)), normal)
        };
        let (mut falling, mut rising) = (line(0.0), line(1.0));
        if falling.1 >= 0.0 || rising.1 <= 0.0 {
            return None;
        }
        let mut t = 0.0;
        for _ in 0..16 {
            t = (falling.0 - rising.0) / (rising.1 - falling.1);
            let middle = line(t);
            let is_vertex = middle.0 + middle.1 * t <= falling.0 + falling.1 * t + 1e-9;
            if is_vertex || middle.1 == 0.0 {
                break;
            }
            if middle.1 < 0.0 { falling = middle } else { rising = middle }
        }
        let normal = falling.2 * rising.1 - rising.2 * falling.1;
        (t > 0.0 && t < 1.0).then(|| (t, falling.0 + falling.1 * t, normal.normalize()))
    }
}

/// Nearest parameter on the segment `a b` to `p`, in [0, 1].
pub(crate) fn nearest_on_segment(p: &V3, a: &V3, b: &V3) -> f32 {
    let ab = b - a;
    let length_squared = ab.norm_squared();
    if length_squared <= 0.0 { 0.0 } else { ((p - a).dot(&ab) / length_squared).clamp(0.0, 1.0) }
}

/// Parameters of the nearest points of the segments `p q` and `a b` \[Ericson05, 5.1.9\].
pub(crate) fn nearest_segments(p: &V3, q: &V3, a: &V3, b: &V3) -> (f32, f32) {
    let (d1, d2, r) = (q - p, b - a, p - a);
    let (aa, ee, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    if ee <= 0.0 {
        return (nearest_on_segment(a, p, q), 0.0);
    }
    let (c, bb) = (d1.dot(&r), d1.dot(&d2));
    let denominator = aa * ee - bb * bb;
    let s = if denominator > 1e-12 * aa * ee { ((bb * f - c * ee) / denominator).clamp(0.0, 1.0) } else { 0.5 };
    let t = (bb * s + f) / ee;
    let clamped = t.clamp(0.0, 1.0);
    let s = if clamped == t { s } else { nearest_on_segment(&(a + d2 * clamped), p, q) };
    (s, clamped)
}
