//! Layout: surface coordinates around a moving contact point.
//!
//! The atlas tabulates charts: discrete exponential maps around selected skin vertices, the anchors. Around a contact
//! point `c`, the charts of the three nearest anchors are turned into the frame at `c`, shifted to the origin `c`, and
//! blended:
//!
//! `q(p) = sum_k w_k R_k (q_k(p) - q_k(c))`
//!
//! On a developable surface all terms are equal; elsewhere the blend moves smoothly with `c`. The paper's layout is the
//! alternative: vertices projected onto the tangent plane \[SSH12, 5.3\].

use nalgebra::{Rotation2, Vector2, Vector3};
use plica_geometry::{ContactFrame, ExponentialMaps, ReferenceSkin, VertexIdx};
use wide::{i16x16, i32x16};

use super::groups::{Groups, Planar};
use super::surface::{FramedPoint, Surface};
use crate::lanes::{F, LANES};

/// Number of blended anchors.
const BLENDED: usize = 3;
/// Largest number of anchors tabulated for a vertex.
const MAX_NEAR_ANCHORS: usize = 8;
/// Entry of a vertex that a chart does not reach.
const UNREACHED: i16 = i16::MIN;
/// Coordinate of a vertex that no chart reaches \[m\].
pub(crate) const FAR: f32 = 1e6;

/// Options of the layout around a contact point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChartOptions {
    /// Reach of coordinates around the contact point \[m\].
    pub radius_m: f64,
    /// Distance of anchors \[m\].
    pub anchor_spacing_m: f64,
    /// Vertices whose normals differ by more than this from that of the contact point are left out \[rad\].
    pub max_normal_angle: f64,
    /// Kind of coordinates.
    pub coordinates: Coordinates,
}

/// Kind of coordinates of a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinates {
    /// Geodesic, by the exponential map.
    Exponential,
    /// Projected orthogonally onto the tangent plane \[SSH12\].
    Orthogonal,
}

/// Atlas of a skin.
#[derive(Debug, Clone)]
pub(crate) struct Charts {
    options: ChartOptions,
    groups: Groups,
    /// Length of one unit of the table \[m\].
    unit: f32,
    /// `[anchor][group][axis]`
    rows: Vec<[i16x16; 2]>,
    /// Anchors around each vertex, nearest first.
    near_anchors: Vec<Vec<NearAnchor>>,
}

/// An anchor near a vertex, and the vertex in its chart.
#[derive(Debug, Clone, Copy)]
struct NearAnchor {
    anchor: u32,
    /// Coordinates of the vertex in the anchor's chart \[m\].
    at: Vector2<f64>,
    /// Rotation from the anchor's chart to the frame at the vertex.
    turn: Rotation2<f64>,
}

/// An anchor, and `w_k R_k` in units of the table.
type Term = (u32, [[f32; 2]; 2]);

/// The layout around one contact point.
#[derive(Debug, Clone)]
pub(crate) struct ChartAt {
    terms: [Term; BLENDED],
    /// `sum_k w_k R_k q_k(c)`
    offset: [f32; 2],
    /// For the projection: contact point and tangents.
    origin: [f32; 3],
    tangents: [[f32; 3]; 2],
    normal: [f32; 3],
}

impl Charts {
    pub(crate) fn new(surface: &Surface, options: ChartOptions) -> Self {
        let reach = options.radius_m + 2.0 * options.anchor_spacing_m;
        let mut this = Self {
            unit: (reach / f64::from(i16::MAX)) as f32,
            rows: Vec::new(),
            near_anchors: vec![Vec::new(); surface.n_vertices()],
            groups: surface.groups(),
            options,
        };
        if options.coordinates == Coordinates::Exponential {
            this.tabulate(surface, reach);
        }
        this
    }

    fn tabulate(&mut self, surface: &Surface, reach: f64) {
        let skin = surface.reference();
        let maps = ExponentialMaps::new(skin.skin());
        let normals = skin.vertex_normals();
        let frames = vertex_frames(skin, surface.axes());
        let neighbours = neighbours(skin);
        let least = self.options.max_normal_angle.cos();
        let n = skin.skin().n_vertices();
        for (anchor, source) in anchors(skin, self.options.anchor_spacing_m).into_iter().enumerate() {
            let own = normals[source.index()];
            let mapped = maps.around(source, reach, |v| normals[v.index()].dot(&own) >= least);
            let mut at: Vec<Option<Vector2<f64>>> = vec![None; n];
            mapped.iter().for_each(|(v, q)| at[v.index()] = Some(*q));
            for (v, q) in mapped.iter().take_while(|(_, q)| q.norm() < 3.0 * self.options.anchor_spacing_m) {
                if let Some(turn) = turn(skin, &frames[v.index()], &neighbours[v.index()], v.index(), &at) {
                    self.near_anchors[v.index()].push(NearAnchor { anchor: anchor as u32, at: *q, turn });
                }
            }
            self.push_row(&at);
        }
        for known in &mut self.near_anchors {
            known.sort_by(|a, b| a.at.norm_squared().total_cmp(&b.at.norm_squared()));
            known.truncate(MAX_NEAR_ANCHORS);
        }
    }

    fn push_row(&mut self, at: &[Option<Vector2<f64>>]) {
        let entry = |v: usize, axis: usize| match at.get(v).copied().flatten() {
            Some(q) => (q[axis] / f64::from(self.unit)).round() as i16,
            None => UNREACHED,
        };
        for group in 0..self.groups.n() {
            let axis = |axis| i16x16::new(std::array::from_fn(|lane| entry(group * LANES + lane, axis)));
            self.rows.push([axis(0), axis(1)]);
        }
    }

    /// Layout around a point of the reference skin; `None` where no chart reaches.
    pub(crate) fn at(&self, contact: &FramedPoint) -> Option<ChartAt> {
        let FramedPoint { corners, point, frame } = contact;
        let row = |v: &Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        let mut chart = ChartAt {
            terms: [(0, [[0.0; 2]; 2]); BLENDED],
            offset: [0.0; 2],
            origin: row(&point.position.coords),
            tangents: [row(&frame.tau), row(&frame.theta)],
            normal: row(&frame.normal),
        };
        if self.options.coordinates == Coordinates::Orthogonal {
            return Some(chart);
        }
        let mut found = Nearest::default();
        for corner in *corners {
            for known in &self.near_anchors[corner.index()] {
                if !found.holds(known.anchor)
                    && let Some(known) = self.near_anchor(known.anchor, *corners, point.weights)
                {
                    found.offer(known);
                }
            }
        }
        let end = found.end()?;
        let weight = |k: &NearAnchor| (1.0 - k.at.norm() / end).max(1e-6).powi(2);
        let total: f64 = found.blended().map(weight).sum();
        for (term, known) in chart.terms.iter_mut().zip(found.blended()) {
            let matrix = known.turn.matrix() * (weight(known) / total);
            let shift = matrix * known.at;
            let scaled = |r: usize, c: usize| matrix[(r, c)] as f32 * self.unit;
            *term = (known.anchor, [[scaled(0, 0), scaled(0, 1)], [scaled(1, 0), scaled(1, 1)]]);
            chart.offset[0] += shift.x as f32;
            chart.offset[1] += shift.y as f32;
        }
        // Missing anchors repeat the first, with weight zero.
        let n_known = found.blended().count();
        (n_known..BLENDED).for_each(|k| chart.terms[k].0 = chart.terms[0].0);
        Some(chart)
    }

    /// An anchor near a point of a triangle, interpolated from the corners; `None` unless it is near all of them.
    fn near_anchor(&self, anchor: u32, corners: [VertexIdx; 3], weights: [f64; 3]) -> Option<NearAnchor> {
        let (mut at, mut cos, mut sin) = (Vector2::zeros(), 0.0, 0.0);
        for (corner, weight) in corners.iter().zip(weights) {
            let known = self.near_anchors[corner.index()].iter().find(|k| k.anchor == anchor)?;
            at += known.at * weight;
            cos += known.turn.matrix()[(0, 0)] * weight;
            sin += known.turn.matrix()[(1, 0)] * weight;
        }
        Some(NearAnchor { anchor, at, turn: Rotation2::new(sin.atan2(cos)) })
    }

    /// Coordinates of all vertices \[m\]; [`FAR`] where no chart reaches.
    pub(crate) fn lay_out(&self, chart: &ChartAt, surface: &Surface, out: &mut [[F; 2]]) {
        match self.options.coordinates {
            Coordinates::Exponential => self.blend(chart, out),
            Coordinates::Orthogonal => self.project(chart, surface.rest(), surface.normals(), out),
        }
    }

    fn blend(&self, chart: &ChartAt, out: &mut [[F; 2]]) {
        let n_groups = self.groups.n();
        let row = |(anchor, _): &Term| &self.rows[*anchor as usize * n_groups..][..n_groups];
        // Missing anchors have weight zero.
        let [a, b, c] = &chart.terms;
        let matrices = [a, b, c].map(|(_, m)| m.map(|r| r.map(F::splat)));
        let offset = chart.offset.map(|o| F::splat(-o));
        for (q, ((a, b), c)) in out.iter_mut().zip(row(a).iter().zip(row(b)).zip(row(c))) {
            let (mut x, mut y, mut nearest) = (offset[0], offset[1], F::splat(f32::INFINITY));
            for (m, row) in matrices.iter().zip([a, b, c]) {
                let [u, v] = row.map(|r| F::from_i32x16(i32x16::from_i16x16(r)));
                x = m[0][0].mul_add(u, m[0][1].mul_add(v, x));
                y = m[1][0].mul_add(u, m[1][1].mul_add(v, y));
                nearest = nearest.fast_min(u);
            }
            let is_far = nearest.simd_eq(F::splat(f32::from(UNREACHED)));
            *q = [is_far.bitselect(F::splat(FAR), x), y];
        }
    }

    fn project(&self, chart: &ChartAt, rest: &Planar, normals: &Planar, out: &mut [[F; 2]]) {
        let least = F::splat(self.options.max_normal_angle.cos() as f32);
        for (g, q) in out.iter_mut().enumerate() {
            let from = |a: &[f32; 3], v: [F; 3]| {
                v[0].mul_add(F::splat(a[0]), v[1].mul_add(F::splat(a[1]), v[2] * F::splat(a[2])))
            };
            let offset: [F; 3] = std::array::from_fn(|k| rest.axis(k)[g] - F::splat(chart.origin[k]));
            let normal = std::array::from_fn(|k| normals.axis(k)[g]);
            let turns_away = from(&chart.normal, normal).simd_lt(least);
            q[0] = turns_away.bitselect(F::splat(FAR), from(&chart.tangents[0], offset));
            q[1] = from(&chart.tangents[1], offset);
        }
    }

    /// Bytes of the tables.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.rows.as_slice())
    }
}

/// Anchors in order of distance; the last one bounds the support of the weights.
#[derive(Default)]
struct Nearest {
    kept: [Option<NearAnchor>; BLENDED + 1],
}

impl Nearest {
    fn holds(&self, anchor: u32) -> bool {
        self.kept.iter().flatten().any(|k| k.anchor == anchor)
    }

    fn offer(&mut self, known: NearAnchor) {
        let mut next = Some(known);
        for slot in &mut self.kept {
            let is_nearer = |n: &NearAnchor| slot.is_none_or(|k: NearAnchor| n.at.norm() < k.at.norm());
            if next.as_ref().is_some_and(is_nearer) {
                std::mem::swap(slot, &mut next);
            }
        }
    }

    /// Blended anchors.
    fn blended(&self) -> impl Iterator<Item = &NearAnchor> + Clone {
        self.kept[..BLENDED].iter().flatten()
    }

    /// Distance at which weights are zero, so that anchors come and go without a jump.
    fn end(&self) -> Option<f64> {
        let farthest = self.blended().last()?.at.norm();
        Some(self.kept[BLENDED].map_or(2.0 * farthest, |k| k.at.norm()).max(1e-9))
    }
}

/// Farthest-point sampling of vertices until none is farther than `spacing_m` from an anchor. Ties go to the last
/// vertex; the sampling of training (`training/src/farthest.rs`) has a count, squared distances, and ties that go to
/// the first, so that neither can replace the other without a change of results.
pub(crate) fn anchors(skin: &ReferenceSkin, spacing_m: f64) -> Vec<VertexIdx> {
    let positions = skin.skin().positions();
    let mut distance = vec![f64::INFINITY; positions.len()];
    let mut chosen = Vec::new();
    let mut next = 0;
    while distance[next] > spacing_m {
        chosen.push(VertexIdx::from_index(next));
        for (d, p) in distance.iter_mut().zip(positions) {
            *d = d.min((p - positions[next]).norm());
        }
        next = (0..positions.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b])).unwrap_or(0);
    }
    chosen
}

fn vertex_frames(skin: &ReferenceSkin, axes: &[Vector3<f64>; 2]) -> Vec<ContactFrame> {
    skin.vertex_normals().iter().map(|n| plica_geometry::frame_around(n, axes)).collect()
}

fn neighbours(skin: &ReferenceSkin) -> Vec<Vec<usize>> {
    let mut neighbours = vec![Vec::new(); skin.skin().n_vertices()];
    for [a, b] in skin.skin().edges() {
        neighbours[a.index()].push(b.index());
        neighbours[b.index()].push(a.index());
    }
    neighbours
}

/// Rotation from a chart to the frame at a vertex, the least-squares fit to the edges there.
fn turn(
    skin: &ReferenceSkin,
    frame: &ContactFrame,
    neighbours: &[usize],
    vertex: usize,
    map: &[Option<Vector2<f64>>],
) -> Option<Rotation2<f64>> {
    let positions = skin.skin().positions();
    let centre = map[vertex]?;
    let (mut cos, mut sin) = (0.0, 0.0);
    for &neighbour in neighbours {
        let edge = positions[neighbour] - positions[vertex];
        let here = Vector2::new(edge.dot(&frame.tau), edge.dot(&frame.theta)).try_normalize(0.0);
        let there = (map[neighbour]? - centre).try_normalize(0.0);
        let (Some(here), Some(there)) = (here, there) else { continue };
        cos += there.dot(&here);
        sin += there.perp(&here);
    }
    Some(Rotation2::new(sin.atan2(cos)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use nalgebra::Point3;
    use plica_geometry::shapes::{Wedge, wedge_skin};

    use super::super::situation::coordinates;
    use super::*;

    fn wedge() -> Surface {
        Surface::new(&wedge_skin(&Wedge::default(), 3e-3), [Vector3::x(), Vector3::y()])
    }

    fn options(coordinates: Coordinates) -> ChartOptions {
        ChartOptions { radius_m: 0.05, anchor_spacing_m: 0.005, max_normal_angle: 2.2, coordinates }
    }

    fn laid_out(surface: &Surface, charts: &Charts, contact: [f64; 2]) -> Vec<[f32; 2]> {
        let contact = Point3::new(contact[0], contact[1], Wedge::default().height_m(contact[0]));
        let mut layout = vec![[F::ZERO; 2]; surface.groups().n()];
        charts.lay_out(&charts.at(&surface.framed_point(&contact)).unwrap(), surface, &mut layout);
        (0..surface.n_vertices()).map(|v| coordinates(&layout, v)).collect()
    }

    #[test]
    fn on_the_flat_top_coordinates_are_offsets_from_the_contact_point() {
        let surface = wedge();
        let slope = (1.0_f64 + 0.0625).sqrt();
        for kind in [Coordinates::Exponential, Coordinates::Orthogonal] {
            let charts = Charts::new(&surface, options(kind));
            for contact in [[0.05, 0.03], [0.0511, 0.0293], [0.0437, 0.0352]] {
                let mut n = 0;
                for (p, q) in surface.reference().skin().positions().iter().zip(laid_out(&surface, &charts, contact)) {
                    let is_top = (p.z - Wedge::default().height_m(p.x)).abs() < 1e-9;
                    let expected = [(p.x - contact[0]) * slope, p.y - contact[1]];
                    if is_top && expected[0].hypot(expected[1]) < 0.045 {
                        let error = (f64::from(q[0]) - expected[0]).hypot(f64::from(q[1]) - expected[1]);
                        assert!(error < 2e-5, "{kind:?} {contact:?}: {p} at {q:?}, not {expected:?}");
                        n += 1;
                    }
                }
                assert!(n > 200, "{n}");
            }
        }
    }

    #[test]
    fn behind_a_rim_the_map_goes_on_and_the_projection_ends() {
        let surface = wedge();
        let reached = |kind| {
            let charts = Charts::new(&surface, options(kind));
            let positions = surface.reference().skin().positions();
            let layout = laid_out(&surface, &charts, [0.05, 0.01]);
            let on_side = |p: &Point3<f64>| p.y < 1e-9 && p.z > 0.005 && p.z < Wedge::default().height_m(p.x) - 1e-3;
            let side = positions.iter().zip(layout).filter(|(p, q)| on_side(p) && q[0].hypot(q[1]) < 0.05);
            side.map(|(p, q)| (0.01 + Wedge::default().height_m(p.x) - p.z - f64::from(-q[1])).abs())
                .collect::<Vec<_>>()
        };
        let geodesic = reached(Coordinates::Exponential);
        // The rim is slanted and the side is not: unfolding turns the side by up to the slope.
        assert!(geodesic.len() > 20 && geodesic.iter().all(|error| *error < 8e-3), "{geodesic:?}");
        let projected = reached(Coordinates::Orthogonal);
        assert!(projected.iter().all(|error| *error > 1e-3), "projected onto the rim");
    }

    #[test]
    fn what_no_map_reaches_is_far() {
        let surface = wedge();
        let charts = Charts::new(&surface, options(Coordinates::Exponential));
        let layout = laid_out(&surface, &charts, [0.05, 0.03]);
        let bottom = surface.reference().skin().positions().iter().zip(layout).filter(|(p, _)| p.z < 1e-9);
        assert!(bottom.clone().filter(|(p, _)| p.y > 0.01 && p.y < 0.05).all(|(_, q)| q[0] == FAR));
    }
}
