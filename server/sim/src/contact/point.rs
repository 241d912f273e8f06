//! The contact point on the skin, and the same point on the reference skin.
//!
//! For a tool with an axis: where the axis meets the deformed skin, pulled back. For a ball, or where the axis misses:
//! the centroid of smooth contact weights, 1 at gap <= 0 and falling to 0 at 1 mm. Never a vertex: it jitters.

use super::V3;
use super::detect::{BAND, Detector, Search};
use super::surface::SkinSurface;
use crate::embedding::SkinPositions;
use crate::smoothstep::smoothstep;

/// A contact point, deformed and on the reference skin \[m\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactPoint {
    pub(crate) deformed: V3,
    pub(crate) reference: V3,
}

/// Contact point of a body; `None` without skin nearby. `detector` holds the result of its search for this body.
pub(crate) fn contact_point(search: &Search<'_>, detector: &Detector) -> Option<ContactPoint> {
    let on_axis = if search.solid.has_axis() { on_axis(search, detector) } else { None };
    on_axis.or_else(|| smooth_centroid(search.surface, search.skin, detector))
}

/// The intersection of the axis with the near triangles that lies closest to the tip.
fn on_axis(search: &Search<'_>, detector: &Detector) -> Option<ContactPoint> {
    let Search { surface, skin, solid, placement, .. } = *search;
    let direction = -(placement.rotation * V3::z());
    let tip = solid.tip();
    let mut best: Option<(f32, ContactPoint)> = None;
    for &cluster in detector.near_clusters() {
        let margin = BAND + surface.longest_edge(cluster as usize);
        for &t in surface.triangles_of_cluster(cluster as usize) {
            if surface.triangles[t as usize].iter().all(|&v| detector.distance(v) > margin) {
                continue;
            }
            let corners = surface.corners(skin, t as usize);
            let Some((distance, weights)) = line_hits(&placement.origin, &direction, &corners) else { continue };
            let error = (distance - tip).abs();
            if error < tip.max(BAND) && best.is_none_or(|(e, _)| error < e) {
                let rest = surface.triangles[t as usize].map(|v| surface.rest[v as usize]);
                let mix = |c: &[V3; 3]| c[0] * weights[0] + c[1] * weights[1] + c[2] * weights[2];
                best = Some((error, ContactPoint { deformed: mix(&corners), reference: mix(&rest) }));
            }
        }
    }
    best.map(|b| b.1)
}

/// Parameter and barycentric weights where the line meets the triangle \[MT97\].
fn line_hits(origin: &V3, direction: &V3, [a, b, c]: &[V3; 3]) -> Option<(f32, [f32; 3])> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(&ac);
    let determinant = ab.dot(&p);
    if determinant.abs() < 1e-14 {
        return None;
    }
    let s = origin - a;
    let q = s.cross(&ab);
    let (v, w) = (s.dot(&p) / determinant, direction.dot(&q) / determinant);
    (v >= 0.0 && w >= 0.0 && v + w <= 1.0).then(|| (ac.dot(&q) / determinant, [1.0 - v - w, v, w]))
}

fn smooth_centroid(surface: &SkinSurface, skin: &SkinPositions, detector: &Detector) -> Option<ContactPoint> {
    let (mut total, mut deformed, mut reference) = (0.0, V3::zeros(), V3::zeros());
    for (vertex, gap) in detector.near_vertices().filter(|&(_, gap)| gap < BAND) {
        let weight = smoothstep(1.0 - (gap / BAND).clamp(0.0, 1.0)) * surface.vertex_areas[vertex];
        total += weight;
        deformed += V3::from(skin.vertex(vertex)) * weight;
        reference += surface.rest[vertex] * weight;
    }
    (total > 0.0).then(|| ContactPoint { deformed: deformed / total, reference: reference / total })
}
