//! Tool and plane shapes as signed distances, exact and cheap: the general convex shape is an intersection of half-spaces.

use plica_geometry::{ConvexPolytope, FacePlane};

use super::plane_octree::{Nearest, Plane, PlaneOctree, nearest_of};
use super::vertex_graph::VertexGraph;
use super::{M3, V3};
use crate::description::ToolShape;

/// Up to this number of planes or vertices a loop over all of them is cheapest.
const FEW: usize = 32;

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
    planes: Vec<Plane>,
    vertices: Vec<V3>,
    pub(crate) center: V3,
    /// Vertices of the parts before this one.
    first_vertex: usize,
    /// Farthest vertex from the origin \[m\].
    reach: f32,
    /// Nearest plane and farthest vertex from the center \[m\].
    radii: [f32; 2],
    /// Farthest vertex along -z \[m\], at least 0.
    tip: f32,
    /// Where there are many.
    plane_octree: Option<PlaneOctree>,
    vertex_graph: Option<VertexGraph>,
}

/// Knowledge about a segment from before its search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment {
    pub(crate) ends: [V3; 2],
    /// Nearest planes of the ends; [`UNKNOWN_PLANE`] otherwise.
    pub(crate) planes: [u32; 2],
    /// Distances from here on are of no interest \[m\].
    pub(crate) reach: f32,
}

/// Signed distance from a plane along a segment, `start + slope t`.
#[derive(Debug, Clone, Copy)]
struct Line {
    start: f32,
    slope: f32,
    plane: u32,
}

impl Line {
    fn at(self, t: f32) -> f32 {
        self.start + self.slope * t
    }
}

/// No plane is known.
pub(crate) const UNKNOWN_PLANE: u32 = u32::MAX;

/// A vertex of a polytope and its number among those of all parts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NumberedVertex {
    pub(crate) position: V3,
    pub(crate) number: usize,
}

/// Pose of a shape, `world <- shape`.
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
    /// `None` for a cuboid without a volume.
    pub(crate) fn new(shape: &ToolShape) -> Option<Self> {
        match shape {
            ToolShape::Ball { radius_m } => {
                Some(Self::Round { a: V3::zeros(), b: V3::zeros(), radius: *radius_m as f32 })
            }
            ToolShape::Capsule { radius_m, length_m } => {
                Some(Self::Round { a: V3::zeros(), b: V3::z() * *length_m as f32, radius: *radius_m as f32 })
            }
            ToolShape::Cuboid { .. } | ToolShape::ConvexHull { .. } | ToolShape::Compound { .. } => {
                let parts = shape.polytopes().ok()?;
                let mut first_vertex = 0;
                let table = |part: &ConvexPolytope| {
                    let table = Polytope::new(part, first_vertex);
                    first_vertex += table.vertices.len();
                    table
                };
                Some(Self::Polytopes(parts.iter().map(table).collect()))
            }
        }
    }

    /// Whether the contact point lies on the tool's axis (z) rather than at the centroid of the skin in contact.
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
            Self::Polytopes(parts) => {
                for part in parts {
                    match &part.vertex_graph {
                        None => part.vertices.iter().for_each(|p| extend(*p, 0.0)),
                        Some(graph) => part.extremes(graph, placement).into_iter().for_each(|p| extend(p, 0.0)),
                    }
                }
            }
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
            Self::Polytopes(parts) => parts.iter().map(|part| part.reach).fold(0.0, f32::max),
            Self::HalfSpace { .. } => 0.0,
        }
    }

    /// Distance from the origin to the surface along -z \[m\].
    pub(crate) fn tip(&self) -> f32 {
        match self {
            Self::Round { radius, .. } => *radius,
            Self::Polytopes(parts) => parts.iter().map(|part| part.tip).fold(0.0, f32::max),
            Self::HalfSpace { .. } => 0.0,
        }
    }
}

impl Polytope {
    /// Table of `polytope` in `f32`: planes of the rounded vertices, with none of them above.
    fn new(polytope: &ConvexPolytope, first_vertex: usize) -> Self {
        let vertices: Vec<V3> = polytope.vertices().iter().map(|v| v.coords.cast()).collect();
        let normal = |face: &FacePlane| {
            let [a, b, c] = polytope.triangles()[face.triangle].map(|v| vertices[v]);
            triangle_normal(&a, &b, &c).unwrap_or(face.normal.cast())
        };
        let support = |normal: &V3| vertices.iter().map(|v| normal.dot(v)).fold(f32::NEG_INFINITY, f32::max);
        let plane = |normal: V3| Plane { normal, offset: support(&normal) };
        let planes: Vec<_> = polytope.planes().iter().map(normal).map(plane).collect();
        let center = vertices.iter().sum::<V3>() / vertices.len() as f32;
        let inner = planes.iter().map(|plane| -plane.distance(&center)).fold(f32::INFINITY, f32::min);
        let outer = vertices.iter().map(|v| (v - center).norm()).fold(0.0, f32::max);
        let low = vertices.iter().fold(V3::repeat(f32::INFINITY), |low, v| low.inf(v));
        let high = vertices.iter().fold(V3::repeat(f32::NEG_INFINITY), |high, v| high.sup(v));
        Self {
            reach: vertices.iter().map(|p| p.norm()).fold(0.0, f32::max),
            tip: vertices.iter().map(|v| -v.z).fold(0.0, f32::max),
            plane_octree: (planes.len() > FEW).then(|| PlaneOctree::new(&planes, &low, &high)),
            vertex_graph: (vertices.len() > FEW).then(|| VertexGraph::new(&vertices, polytope.triangles())),
            planes,
            vertices,
            radii: [inner, outer],
            center,
            first_vertex,
        }
    }

    /// Nearest plane of a point and its signed distance, where a cheap bound leaves it below `margin`; the bound otherwise. Without
    /// many planes the exact distance is the cheapest.
    ///
    /// Planes shifted out by `s` lie within the shape scaled by `1 + s / r` about a center that is `r` below the nearest plane.
    pub(crate) fn nearest_within(&self, p: &V3, margin: f32) -> (f32, u32) {
        let [inner, outer] = self.radii;
        let bound = inner * ((p - self.center).norm() / outer - 1.0);
        if self.plane_octree.is_some() && bound > margin {
            return (bound, UNKNOWN_PLANE);
        }
        let nearest = self.nearest_plane(p);
        (nearest.distance, if self.plane_octree.is_some() { nearest.plane } else { UNKNOWN_PLANE })
    }

    /// Signed distance and outward normal of the nearest face; mitred outside edges, exact on and inside the surface.
    pub(crate) fn distance(&self, p: &V3) -> (f32, V3) {
        let nearest = self.nearest_plane(p);
        (nearest.distance, self.planes[nearest.plane as usize].normal)
    }

    /// Largest signed distance to a plane, and which; the first of equal ones.
    fn nearest_plane(&self, p: &V3) -> Nearest {
        match &self.plane_octree {
            Some(octree) => octree.nearest(&self.planes, p),
            None => nearest_of(&self.planes, 0..self.planes.len() as u32, p),
        }
    }

    /// Vertices that lie farthest along and against each axis of the world.
    fn extremes(&self, graph: &VertexGraph, placement: &Placement) -> [V3; 6] {
        std::array::from_fn(|k| {
            let axis = V3::ith(k / 2, if k % 2 == 0 { 1.0 } else { -1.0 });
            let d = placement.rotation.tr_mul(&axis);
            self.vertices[graph.farthest(&self.vertices, &d) as usize]
        })
    }

    /// Calls `visit` with the vertices, in the frame of the world, that may press on the triangle `corners`. Of few vertices these
    /// are all; of many, the one that lies deepest below the triangle: the distance is convex, so over the triangle it is smallest there
    /// or on the edges.
    pub(crate) fn vertices_facing(
        &self,
        placement: &Placement,
        corners: &[V3; 3],
        mut visit: impl FnMut(NumberedVertex),
    ) {
        let mut tell = |number: u32| {
            let position = placement.to_world(self.vertices[number as usize]);
            visit(NumberedVertex { position, number: self.first_vertex + number as usize });
        };
        let Some(graph) = &self.vertex_graph else { return (0..self.vertices.len() as u32).for_each(tell) };
        let local = corners.map(|corner| placement.to_local(corner));
        let Some(normal) = triangle_normal(&local[0], &local[1], &local[2]) else { return };
        tell(graph.farthest(&self.vertices, &-normal));
    }

    /// Smallest signed distance inside the segment `p q`, where it lies strictly between the ends: parameter, distance and
    /// the normal that is orthogonal to the segment. The distance is a maximum of linear functions along the segment.
    pub(crate) fn distance_to_segment(&self, segment: &Segment) -> Option<(f32, f32, V3)> {
        let [p, q] = &segment.ends;
        let along = |plane: u32| {
            let Plane { normal, offset } = self.planes[plane as usize];
            Line { start: normal.dot(p) - offset, slope: normal.dot(&(q - p)), plane }
        };
        let [falling, rising] = [0, 1].map(|end| match segment.planes[end] {
            UNKNOWN_PLANE => self.nearest_plane(&segment.ends[end]).plane,
            known => known,
        });
        let (mut falling, mut rising) = (along(falling), along(rising));
        if falling.slope >= 0.0 || rising.slope <= 0.0 {
            return None;
        }
        let mut t = 0.0;
        for _ in 0..16 {
            t = (falling.start - rising.start) / (rising.slope - falling.slope);
            // Below the crossing of two of its lines the distance does not come.
            if self.plane_octree.is_some() && falling.at(t) >= segment.reach {
                return None;
            }
            let middle = along(self.nearest_plane(&(p + (q - p) * t)).plane);
            if middle.at(t) <= falling.at(t) + 1e-9 || middle.slope == 0.0 {
                break;
            }
            if middle.slope < 0.0 { falling = middle } else { rising = middle }
        }
        let [below, above] = [falling, rising].map(|line| self.planes[line.plane as usize].normal);
        let normal = below * rising.slope - above * falling.slope;
        (t > 0.0 && t < 1.0).then(|| (t, falling.at(t), normal.normalize()))
    }
}

/// Unit normal; `None` for a triangle without an area.
fn triangle_normal(a: &V3, b: &V3, c: &V3) -> Option<V3> {
    let across = (b - a).cross(&(c - a));
    let inverse = 1.0 / across.norm();
    inverse.is_finite().then(|| across * inverse)
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use nalgebra::Point3;

    use super::*;

    /// Points on a sphere by the golden angle: no two of their facets are coplanar.
    fn sphere(n: usize, radius: f64) -> Vec<Point3<f64>> {
        let point = |i: usize| {
            let z = 1.0 - (2 * i + 1) as f64 / n as f64;
            let (sin, cos) = (2.399_963_229_728_653 * i as f64).sin_cos();
            let rim = (1.0 - z * z).sqrt();
            Point3::new(radius * rim * cos, radius * rim * sin, radius * z)
        };
        (0..n).map(point).collect()
    }

    #[test]
    fn a_table_has_the_distances_of_its_polytope() {
        let cuboid = ConvexPolytope::cuboid([0.008, 0.012, 0.02]).unwrap();
        let ball = ConvexPolytope::hull(sphere(1000, 0.01)).unwrap();
        for (name, polytope) in [("cuboid", cuboid), ("ball", ball)] {
            let table = Polytope::new(&polytope, 0);
            assert_eq!(table.planes.len(), polytope.planes().len(), "{name}");
            let worst = [0.0, 0.003, 0.01, 0.012, 0.03].iter().flat_map(|r| sphere(200, *r)).map(|p| {
                let (distance, _) = table.distance(&p.coords.cast());
                (f64::from(distance) - polytope.distance(&p).distance_m).abs()
            });
            let worst = worst.fold(0.0, f64::max);
            println!("{name}: {} planes, table within {worst:.1e} m", table.planes.len());
            assert!(worst < 1e-8, "{name}: {worst}");
        }
    }

    #[test]
    fn many_planes_and_vertices_give_what_asking_all_of_them_gives() {
        let hull = ConvexPolytope::hull(sphere(2562, 0.01)).unwrap();
        let many = Polytope::new(&hull, 0);
        assert!(many.plane_octree.is_some() && many.vertex_graph.is_some());
        let all = Polytope { plane_octree: None, vertex_graph: None, ..many.clone() };
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.7, 1.1).into_inner();
        let placement = Placement { rotation: turn, origin: V3::new(0.1, -0.2, 0.05) };
        let points = [0.0, 0.002, 0.0099, 0.01, 0.0101, 0.02, 0.3].iter().flat_map(|r| sphere(300, *r));
        let points: Vec<V3> = points.map(|p| p.coords.cast()).collect();
        for p in &points {
            assert_eq!(many.nearest_plane(p), all.nearest_plane(p), "{p}");
        }
        for pair in points.windows(2) {
            let unknown = [UNKNOWN_PLANE; 2];
            let segment = Segment { ends: [pair[0], pair[1]], planes: unknown, reach: f32::INFINITY };
            let expected = all.distance_to_segment(&segment);
            assert_eq!(many.distance_to_segment(&segment), expected);
            // What is known from the ends changes nothing, and only distances beyond the reach are left out.
            let planes = segment.ends.map(|end| many.nearest_within(&end, f32::INFINITY).1);
            let near = many.distance_to_segment(&Segment { planes, reach: 1e-3, ..segment });
            match expected.filter(|(_, distance, _)| *distance < 1e-3) {
                Some((_, distance, _)) => assert!((near.unwrap().1 - distance).abs() < 1e-7),
                None => assert!(near.is_none_or(|(_, distance, _)| distance >= 1e-3 - 1e-7)),
            }
        }
        for p in &points {
            let (bound, exact) = (many.nearest_within(p, 2e-3).0, all.distance(p).0);
            assert!(bound == exact || bound > 2e-3 && bound <= exact + 1e-7, "{bound} of {exact}");
        }
        let bounds = |part: &Polytope| Solid::Polytopes(vec![part.clone()]).bounds(&placement);
        // A state that is not finite is for the gates to judge, not for the search to stumble over.
        let lost =
            Segment { ends: [V3::repeat(f32::NAN), V3::zeros()], planes: [UNKNOWN_PLANE; 2], reach: f32::INFINITY };
        for part in [&many, &all] {
            let _ = part.distance_to_segment(&lost);
            assert!(!part.distance(&lost.ends[0]).0.is_finite());
        }
        for (found, expected) in bounds(&many).iter().zip(bounds(&all)) {
            assert!((found - expected).norm() < 1e-7);
        }
        // The deepest vertex below a triangle is found.
        for corners in points.chunks_exact(3) {
            let corners = [corners[0], corners[1], corners[2]].map(|p| placement.to_world(p));
            let Some(normal) = triangle_normal(&corners[0], &corners[1], &corners[2]) else { continue };
            let lowest = |part: &Polytope| {
                let mut lowest = f32::INFINITY;
                part.vertices_facing(&placement, &corners, |v| lowest = lowest.min(normal.dot(&v.position)));
                lowest
            };
            assert!((lowest(&many) - lowest(&all)).abs() < 1e-7);
        }
    }

    #[test]
    fn a_facet_is_not_merged_with_an_inclined_neighbour() {
        // 6-sided pyramid, its sides 1 degree steep.
        let rim = (0..6).map(|k| {
            let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_3).sin_cos();
            Point3::new(0.01 * cos, 0.01 * sin, 0.0)
        });
        let tips = [Point3::new(0.0, 0.0, 0.01 * 1.0_f64.to_radians().tan()), Point3::new(0.0, 0.0, -0.01)];
        let solid = Solid::Polytopes(vec![Polytope::new(&ConvexPolytope::hull(rim.chain(tips).collect()).unwrap(), 0)]);
        let above_rim = V3::new(-0.008, 0.0, 1e-3);
        let (distance, _) = solid.distance(&above_rim);
        let height = 1e-3 - 0.01 * 1.0_f32.to_radians().tan() * (1.0 - 0.008 / 0.01);
        assert!((distance - height).abs() < 2e-6, "{distance}, {height}");
    }
}
