//! Skin points near a body: vertices, edges and triangles, each with gap and normal.
//!
//! The signed distance of a convex tool is convex along the skin, so its smallest value over a triangle lies at a vertex,
//! inside an edge, or inside the triangle under a point of the tool (an end of a rod, a corner of a hull). These three kinds
//! of features are found separately; a 1 mm probe is so never lost between vertices.

use plica_geometry::CLUSTER_SIZE;

use super::V3;
use super::solid::{NumberedVertex, Placement, Segment, Solid, UNKNOWN_PLANE, nearest_on_segment, nearest_segments};
use super::surface::SkinSurface;
use crate::embedding::SkinPositions;

/// Features closer than this share of an edge to its end are left to the end, unless they are in contact already: a contact that
/// lets go where it began would come back at once, and the tool would never rest.
const INTERIOR: f32 = 0.05;

/// Gap from which a vertex has no weight in the contact point \[m\].
pub(crate) const BAND: f32 = 1e-3;

/// Assumed bound on the stretch of edges, before deformed lengths are computed.
const STRETCH: f32 = 1.5;

/// Normals that point out of the skin by more than this cosine belong to the far side of the tool.
const FAR_SIDE: f32 = 0.3;

/// A skin point near a body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    /// Identifies the vertex, the edge, or the pair of tool point and triangle, from tick to tick.
    pub(crate) feature: u64,
    /// Skin vertices that carry the point, with weights; unused ones have weight 0.
    pub(crate) vertices: [u32; 3],
    pub(crate) weights: [f32; 3],
    /// The point \[m\].
    pub(crate) point: V3,
    /// Unit normal from the body to the skin.
    pub(crate) normal: V3,
    /// Signed distance \[m\].
    pub(crate) gap: f32,
    /// A contact here is continued but does not begin: a neighbouring feature is as good.
    pub(crate) is_fringe: bool,
}

/// Search region: a placed body and its surroundings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Search<'a> {
    pub(crate) surface: &'a SkinSurface,
    pub(crate) skin: &'a SkinPositions,
    pub(crate) solid: &'a Solid,
    pub(crate) placement: &'a Placement,
    /// Features with a gap below this are found \[m\].
    pub(crate) reach: f32,
}

/// A point of a tool that a triangle may lie under: an end of a rod, a corner of a hull.
struct ToolPoint {
    position: V3,
    radius: f32,
    /// The point may be this deep below the skin; deeper, it belongs to another side of it \[m\].
    depth: f32,
    number: usize,
}

/// Detection with its scratch.
#[derive(Debug, Clone)]
pub(crate) struct Detector {
    near_clusters: Vec<u32>,
    /// Signed distance of each vertex of the near clusters; infinite elsewhere.
    distances: Vec<f32>,
    /// Nearest plane of the same vertices, for a single polytope with many.
    planes: Vec<u32>,
    candidates: Vec<Candidate>,
    /// Candidates beyond the capacity.
    pub(crate) overflow: u32,
}

/// Candidates kept per body before selection.
const CAPACITY: usize = 4096;

impl Detector {
    pub(crate) fn new(n_skin: usize) -> Self {
        Self {
            near_clusters: Vec::with_capacity(n_skin.div_ceil(CLUSTER_SIZE)),
            distances: vec![f32::INFINITY; n_skin],
            planes: vec![UNKNOWN_PLANE; n_skin],
            candidates: Vec::with_capacity(CAPACITY),
            overflow: 0,
        }
    }

    /// Clusters of the last call to [`Self::find`].
    pub(crate) fn near_clusters(&self) -> &[u32] {
        &self.near_clusters
    }

    /// Signed distance of a vertex in the last call to [`Self::find`]; infinite if it was not near.
    pub(crate) fn distance(&self, vertex: u32) -> f32 {
        self.distances[vertex as usize]
    }

    /// Vertices of the near clusters with their signed distances, of the last call to [`Self::find`].
    pub(crate) fn near_vertices(&self) -> impl Iterator<Item = (usize, f32)> {
        let vertices = self.near_clusters.iter().flat_map(|&c| {
            let first = c as usize * CLUSTER_SIZE;
            first..(first + CLUSTER_SIZE).min(self.distances.len())
        });
        vertices.map(|v| (v, self.distances[v]))
    }

    /// All features of the skin within the search's reach.
    pub(crate) fn find(&mut self, search: &Search<'_>) -> &[Candidate] {
        self.forget_vertices();
        self.candidates.clear();
        self.overflow = 0;
        self.find_near_clusters(search);
        if !self.near_clusters.is_empty() {
            self.measure_vertices(search);
            self.vertices(search);
            if !matches!(search.solid, Solid::HalfSpace { .. }) {
                self.edges(search);
                self.triangles(search);
            }
        }
        &self.candidates
    }

    /// Whether the body's box, grown by the reach, meets any cluster.
    pub(crate) fn is_near(&mut self, search: &Search<'_>) -> bool {
        self.forget_vertices();
        self.find_near_clusters(search);
        !self.near_clusters.is_empty()
    }

    fn find_near_clusters(&mut self, search: &Search<'_>) {
        let Search { surface, skin, solid, placement, reach } = *search;
        let [low, high] = solid.bounds(placement);
        let is_near = |bounds: &[[f32; 3]; 2], margin: f32| match solid {
            Solid::HalfSpace { normal } => {
                let n = placement.rotation * normal;
                let nearest = V3::from_fn(|k, _| bounds[usize::from(n[k] < 0.0)][k]);
                n.dot(&(nearest - placement.origin)) < margin
            }
            _ => (0..3).all(|k| bounds[0][k] - margin <= high[k] && bounds[1][k] + margin >= low[k]),
        };
        self.near_clusters.clear();
        for (cluster, bounds) in skin.boxes().iter().enumerate() {
            if is_near(bounds, reach + STRETCH * surface.longest_edge(cluster)) {
                self.near_clusters.push(cluster as u32);
            }
        }
    }

    fn measure_vertices(&mut self, search: &Search<'_>) {
        let Search { surface, skin, solid, placement, reach } = *search;
        for &cluster in &self.near_clusters {
            let first = cluster as usize * CLUSTER_SIZE;
            let last = (first + CLUSTER_SIZE).min(surface.rest.len());
            let [x, y, z] = skin.cluster(cluster as usize);
            let distances = &mut self.distances[first..last];
            // Vertices this far away have no part in rows or contact points.
            let margin = reach.max(BAND) + STRETCH * surface.longest_edge(cluster as usize);
            match solid {
                Solid::Round { a, b, radius } => {
                    let (a, b) = (placement.to_world(*a), placement.to_world(*b));
                    let axis = b - a;
                    let inverse = if a == b { 0.0 } else { 1.0 / axis.norm_squared() };
                    for (((d, x), y), z) in distances.iter_mut().zip(x).zip(y).zip(z) {
                        let (px, py, pz) = (x - a.x, y - a.y, z - a.z);
                        let t = ((px * axis.x + py * axis.y + pz * axis.z) * inverse).clamp(0.0, 1.0);
                        let (qx, qy, qz) = (px - t * axis.x, py - t * axis.y, pz - t * axis.z);
                        *d = (qx * qx + qy * qy + qz * qz).sqrt() - radius;
                    }
                }
                Solid::Polytopes(parts) => {
                    let planes = &mut self.planes[first..last];
                    for (lane, (d, plane)) in distances.iter_mut().zip(planes).enumerate() {
                        let local = placement.to_local(V3::new(x[lane], y[lane], z[lane]));
                        let nearest = parts.iter().map(|p| p.nearest_within(&local, margin));
                        let nearest =
                            nearest.fold((f32::INFINITY, UNKNOWN_PLANE), |a, b| if b.0 < a.0 { b } else { a });
                        *d = nearest.0;
                        *plane = if parts.len() == 1 { nearest.1 } else { UNKNOWN_PLANE };
                    }
                }
                Solid::HalfSpace { normal } => {
                    let n = placement.rotation * normal;
                    let offset = n.dot(&placement.origin);
                    for (lane, d) in distances.iter_mut().enumerate() {
                        *d = n.x * x[lane] + n.y * y[lane] + n.z * z[lane] - offset;
                    }
                }
            }
        }
    }

    fn forget_vertices(&mut self) {
        for &cluster in &self.near_clusters {
            let first = cluster as usize * CLUSTER_SIZE;
            let last = (first + CLUSTER_SIZE).min(self.distances.len());
            self.distances[first..last].fill(f32::INFINITY);
            self.planes[first..last].fill(UNKNOWN_PLANE);
        }
    }

    fn vertices(&mut self, search: &Search<'_>) {
        let Search { surface, skin, solid, placement, reach } = *search;
        for index in 0..self.near_clusters.len() {
            let first = self.near_clusters[index] as usize * CLUSTER_SIZE;
            let last = (first + CLUSTER_SIZE).min(surface.rest.len());
            for v in first..last {
                let gap = self.distances[v];
                if gap >= reach {
                    continue;
                }
                let point = V3::from(skin.vertex(v));
                let normal = vertex_normal(solid, placement, &point);
                let outward: V3 =
                    surface.triangles_around(v).iter().map(|&t| surface.triangle_normal(skin, t as usize)).sum();
                if normal.dot(&outward) <= FAR_SIDE * outward.norm() {
                    let (vertices, weights) = ([v as u32; 3], [1.0, 0.0, 0.0]);
                    let feature = feature(0, v, 0);
                    self.push(Candidate { feature, vertices, weights, point, normal, gap, is_fringe: false });
                }
            }
        }
    }

    fn edges(&mut self, search: &Search<'_>) {
        let Search { surface, skin, reach, .. } = *search;
        for index in 0..self.near_clusters.len() {
            for &e in surface.edges_of_cluster(self.near_clusters[index] as usize) {
                let [v0, v1] = surface.edges[e as usize].map(|v| v as usize);
                let sum = self.distances[v0] + self.distances[v1];
                // The distance is 1-Lipschitz: along an edge of length l it is at least (d0 + d1 - l) / 2.
                if sum - STRETCH * surface.edge_lengths[e as usize] >= 2.0 * reach {
                    continue;
                }
                let (p, q) = (V3::from(skin.vertex(v0)), V3::from(skin.vertex(v1)));
                if sum - (q - p).norm() >= 2.0 * reach {
                    continue;
                }
                let Some((t, gap, normal)) = edge_minimum(search, [p, q], [v0, v1].map(|v| self.planes[v])) else {
                    continue;
                };
                if gap >= reach || !(0.0..=1.0).contains(&t) {
                    continue;
                }
                let sides = surface.edge_triangles[e as usize].map(|t| surface.triangle_normal(skin, t as usize));
                let outward = sides[0] + sides[1];
                if normal.dot(&outward) <= FAR_SIDE * outward.norm() {
                    let vertices = [v0 as u32, v1 as u32, v0 as u32];
                    let point = p + (q - p) * t;
                    let weights = [1.0 - t, t, 0.0];
                    let is_fringe = !(INTERIOR..=1.0 - INTERIOR).contains(&t);
                    let feature = feature(1, e as usize, 0);
                    self.push(Candidate { feature, vertices, weights, point, normal, gap, is_fringe });
                }
            }
        }
    }

    fn triangles(&mut self, search: &Search<'_>) {
        let Search { surface, skin, solid, placement, reach } = *search;
        for index in 0..self.near_clusters.len() {
            let cluster = self.near_clusters[index] as usize;
            let margin = reach + STRETCH * surface.longest_edge(cluster);
            for &t in surface.triangles_of_cluster(cluster) {
                let vertices = surface.triangles[t as usize];
                let nearest = vertices.iter().map(|&v| self.distances[v as usize]).fold(f32::INFINITY, f32::min);
                if nearest >= margin {
                    continue;
                }
                let corners = surface.corners(skin, t as usize);
                match solid {
                    Solid::Round { a, b, radius } => {
                        let ends = [placement.to_world(*a), placement.to_world(*b)];
                        let n_ends = if a == b { 1 } else { 2 };
                        for (k, end) in ends.iter().take(n_ends).enumerate() {
                            let point = ToolPoint { position: *end, radius: *radius, depth: *radius, number: k };
                            self.under_tool_point(search, t, &corners, &point);
                        }
                    }
                    Solid::Polytopes(parts) => {
                        for part in parts {
                            let center = placement.to_world(part.center);
                            let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).normalize();
                            part.vertices_facing(placement, &corners, |vertex| {
                                let NumberedVertex { position, number } = vertex;
                                let depth = (center - position).dot(&normal);
                                if depth > 0.0 {
                                    let point = ToolPoint { position, radius: 0.0, depth, number };
                                    self.under_tool_point(search, t, &corners, &point);
                                }
                            });
                        }
                    }
                    Solid::HalfSpace { .. } => {}
                }
            }
        }
    }

    /// The point of a triangle under a tool point, if it lies inside the triangle and not too deep.
    fn under_tool_point(&mut self, search: &Search<'_>, triangle: u32, corners: &[V3; 3], tool: &ToolPoint) {
        let (reach, radius) = (search.reach, tool.radius);
        let [a, b, c] = corners;
        let normal = (b - a).cross(&(c - a));
        let area_squared = normal.norm_squared();
        let height = (tool.position - a).dot(&normal);
        let inverse = 1.0 / area_squared.max(1e-30);
        let w1 = (tool.position - a).cross(&(c - a)).dot(&normal) * inverse;
        let w2 = (b - a).cross(&(tool.position - a)).dot(&normal) * inverse;
        let weights = [1.0 - w1 - w2, w1, w2];
        // The edge test misses a sharp corner right above the edge: its nearest face may be a side of the tool.
        let interior = if radius > 0.0 { INTERIOR } else { 0.0 };
        let least = weights.iter().copied().fold(1.0, f32::min);
        if least < 0.0 {
            return;
        }
        let distance = height * inverse.sqrt();
        let gap = distance - radius;
        if gap < reach && distance > -tool.depth {
            let point = a * weights[0] + b * weights[1] + c * weights[2];
            let feature = feature(2, triangle as usize, tool.number);
            let vertices = search.surface.triangles[triangle as usize];
            let is_fringe = least < interior;
            self.push(Candidate {
                feature,
                vertices,
                weights,
                point,
                normal: -normal * inverse.sqrt(),
                gap,
                is_fringe,
            });
        }
    }

    fn push(&mut self, candidate: Candidate) {
        if self.candidates.len() < CAPACITY {
            self.candidates.push(candidate);
        } else {
            self.overflow += 1;
        }
    }
}

fn feature(kind: u64, index: usize, tool_point: usize) -> u64 {
    kind << 62 | (tool_point as u64) << 32 | index as u64
}

fn vertex_normal(solid: &Solid, placement: &Placement, point: &V3) -> V3 {
    match solid {
        Solid::Round { a, b, .. } => {
            let (a, b) = (placement.to_world(*a), placement.to_world(*b));
            let nearest = a + (b - a) * nearest_on_segment(point, &a, &b);
            unit_or_up(point - nearest)
        }
        Solid::Polytopes(parts) => {
            let local = placement.to_local(*point);
            let nearest = parts.iter().map(|p| p.distance(&local)).min_by(|a, b| a.0.total_cmp(&b.0));
            placement.rotation * nearest.map_or(V3::z(), |n| n.1)
        }
        Solid::HalfSpace { normal } => placement.rotation * normal,
    }
}

/// Parameter, gap and normal where the distance along `p q` is smallest.
fn edge_minimum(search: &Search<'_>, [p, q]: [V3; 2], planes: [u32; 2]) -> Option<(f32, f32, V3)> {
    let Search { solid, placement, reach, .. } = *search;
    match solid {
        Solid::Round { a, b, radius } => {
            let (a, b) = (placement.to_world(*a), placement.to_world(*b));
            let (t, s) = nearest_segments(&p, &q, &a, &b);
            let apart = p + (q - p) * t - (a + (b - a) * s);
            Some((t, apart.norm() - radius, unit_or_up(apart)))
        }
        Solid::Polytopes(parts) => {
            let segment = Segment { ends: [p, q].map(|end| placement.to_local(end)), planes, reach };
            let minima = parts.iter().filter_map(|part| part.distance_to_segment(&segment));
            let (t, gap, normal) = minima.min_by(|a, b| a.1.total_cmp(&b.1))?;
            Some((t, gap, placement.rotation * normal))
        }
        Solid::HalfSpace { .. } => None,
    }
}

fn unit_or_up(v: V3) -> V3 {
    v.try_normalize(1e-12).unwrap_or_else(V3::z)
}
