//! Discrete exponential map: geodesic polar coordinates around a vertex of a skin \[MR12\].
//!
//! Distance `U` and direction `theta` of shortest paths propagate outward in the order of distance. A vertex `i` behind
//! an
//! edge `jk` is reached by unfolding the triangle into the plane of a virtual source with distances `U_j` and `U_k`: exact where
//! the surface can be unfolded, over sharp edges too.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Vector2};

use crate::index::VertexIdx;
use crate::skin::Skin;

/// A new path is taken if it is shorter than this share of the present one.
const SHORTER: f64 = 1.0 - 1e-9;

/// Neighbourhoods of a skin, from which maps around its vertices are made.
#[derive(Debug, Clone)]
pub struct ExponentialMaps<'a> {
    skin: &'a Skin,
    /// The other two corners of the triangles around each vertex, counter-clockwise; `starts` holds the first of each
    /// vertex.
    fans: Vec<[u32; 2]>,
    starts: Vec<u32>,
}

/// A vertex and its coordinates `U (cos theta, sin theta)` \[m\].
pub type Mapped = (VertexIdx, Vector2<f64>);

impl<'a> ExponentialMaps<'a> {
    /// Neighbourhoods of `skin`.
    pub fn new(skin: &'a Skin) -> Self {
        let mut fans = vec![Vec::new(); skin.n_vertices()];
        for corners in skin.triangles() {
            let [a, b, c] = corners.map(|v| v.index() as u32);
            fans[a as usize].push([b, c]);
            fans[b as usize].push([c, a]);
            fans[c as usize].push([a, b]);
        }
        let mut starts = vec![0];
        starts.extend(fans.iter().scan(0, |sum, fan| {
            *sum += fan.len() as u32;
            Some(*sum)
        }));
        Self { skin, fans: fans.concat(), starts }
    }

    /// Vertices within `radius_m` of `source`, nearest first, reachable over vertices that `admits` accepts. The axis
    /// of
    /// the coordinates is some edge at the source; angles grow counter-clockwise seen from outside.
    pub fn around(&self, source: VertexIdx, radius_m: f64, admits: impl Fn(VertexIdx) -> bool) -> Vec<Mapped> {
        let mut front = Front::new(self, source, admits);
        let mut reached = vec![(source, Vector2::zeros())];
        while let Some(v) = front.advance(radius_m) {
            let (sin, cos) = front.angle[v].sin_cos();
            reached.push((VertexIdx::from_index(v), Vector2::new(cos, sin) * front.distance[v]));
        }
        reached
    }

    fn fan(&self, v: usize) -> &[[u32; 2]] {
        &self.fans[self.starts[v] as usize..self.starts[v + 1] as usize]
    }

    fn position(&self, v: usize) -> Point3<f64> {
        self.skin.positions()[v]
    }
}

/// Geodesic polar coordinates.
#[derive(Clone, Copy)]
struct Polar {
    /// `U` \[m\]
    distance: f64,
    /// `theta` \[rad\]
    angle: f64,
}

/// Vertices reached so far.
struct Front<'a, A> {
    maps: &'a ExponentialMaps<'a>,
    source: usize,
    admits: A,
    distance: Vec<f64>,
    angle: Vec<f64>,
    is_final: Vec<bool>,
    /// Keyed by the bits of distances, which order like non-negative floats.
    heap: BinaryHeap<Reverse<(u64, u32)>>,
}

impl<'a, A: Fn(VertexIdx) -> bool> Front<'a, A> {
    /// The first ring lies in the tangent plane, its angles scaled to a full turn.
    fn new(maps: &'a ExponentialMaps<'a>, source: VertexIdx, admits: A) -> Self {
        let n = maps.skin.n_vertices();
        let source = source.index();
        let mut this = Self {
            maps,
            source,
            admits,
            distance: vec![f64::INFINITY; n],
            angle: vec![0.0; n],
            is_final: vec![false; n],
            heap: BinaryHeap::new(),
        };
        (this.distance[source], this.is_final[source]) = (0.0, true);
        let fan = maps.fan(source);
        let centre = maps.position(source);
        let turn =
            |&[a, b]: &[u32; 2]| (maps.position(a as usize) - centre).angle(&(maps.position(b as usize) - centre));
        let scale = TAU / fan.iter().map(turn).sum::<f64>();
        let (mut next, mut theta) = (fan.first(), 0.0);
        for _ in 0..fan.len() {
            let Some(triangle) = next else { break };
            let v = triangle[0] as usize;
            this.offer(v, Polar { distance: (maps.position(v) - centre).norm(), angle: theta });
            theta += scale * turn(triangle);
            next = fan.iter().find(|f| f[0] == triangle[1]);
        }
        this
    }

    fn offer(&mut self, v: usize, Polar { distance, angle }: Polar) {
        if distance < self.distance[v] * SHORTER && (self.admits)(VertexIdx::from_index(v)) {
            (self.distance[v], self.angle[v]) = (distance, angle);
            self.heap.push(Reverse((distance.to_bits(), v as u32)));
        }
    }

    /// Finalises the nearest open vertex and offers paths over it to its neighbours.
    fn advance(&mut self, radius_m: f64) -> Option<usize> {
        let j = loop {
            let Reverse((bits, v)) = self.heap.pop()?;
            if !self.is_final[v as usize] && f64::from_bits(bits) == self.distance[v as usize] {
                break v as usize;
            }
        };
        if self.distance[j] > radius_m {
            return None;
        }
        self.is_final[j] = true;
        for &[a, b] in self.maps.fan(j) {
            for (i, k) in [(a as usize, b as usize), (b as usize, a as usize)] {
                if !self.is_final[i] {
                    self.offer(i, self.path(j, k, i));
                }
            }
        }
        Some(j)
    }

    /// Path to `i`: straight from the virtual source if it crosses the edge `jk`, else along an edge.
    fn path(&self, j: usize, k: usize, i: usize) -> Polar {
        let [x_j, x_k, x_i] = [j, k, i].map(|v| self.maps.position(v));
        let along_j = Polar { distance: self.distance[j] + (x_i - x_j).norm(), angle: self.angle[j] };
        if k == self.source || !self.distance[k].is_finite() {
            return along_j;
        }
        let along_k = Polar { distance: self.distance[k] + (x_i - x_k).norm(), angle: self.angle[k] };
        let along_edge = if along_k.distance < along_j.distance { along_k } else { along_j };
        self.unfolded(j, k, [x_j, x_k, x_i]).unwrap_or(along_edge)
    }

    /// Straight path across `jk`, in the triangle's plane: `j` at the origin, `k` on the x axis, `i` above it and the
    /// virtual source below.
    fn unfolded(&self, j: usize, k: usize, [x_j, x_k, x_i]: [Point3<f64>; 3]) -> Option<Polar> {
        let (edge, side) = (x_k - x_j, x_i - x_j);
        let length = edge.norm();
        let tip = Vector2::new(side.dot(&edge) / length, side.cross(&edge).norm() / length);
        let (u_j, u_k) = (self.distance[j], self.distance[k]);
        let x = (u_j * u_j - u_k * u_k + length * length) / (2.0 * length);
        let depth = (u_j * u_j - x * x).max(0.0).sqrt();
        let source = Vector2::new(x, -depth);
        let crossing = x + (tip.x - x) * depth / (tip.y + depth);
        if depth == 0.0 || !(0.0..=length).contains(&crossing) {
            return None;
        }
        let from_source = |p: Vector2<f64>| p - source;
        let (to_j, to_k, to_i) =
            (from_source(Vector2::zeros()), from_source(Vector2::new(length, 0.0)), from_source(tip));
        let share = to_j.angle(&to_i) / to_j.angle(&to_k);
        let angle = self.angle[j] + share * wrapped(self.angle[k] - self.angle[j]);
        Some(Polar { distance: to_i.norm(), angle })
    }
}

/// Angle wrapped into `-pi` to `pi`.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * ((angle + PI) / TAU).floor()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;
    use crate::shapes::{Wedge, wedge_skin};

    fn nearest(skin: &Skin, p: Point3<f64>) -> VertexIdx {
        let distance = |v: &usize| (skin.positions()[*v] - p).norm();
        VertexIdx::from_index((0..skin.n_vertices()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap())
    }

    /// Coordinates turned so that `reference` lies where it should.
    fn turned(mapped: &[Mapped], reference: VertexIdx, direction: Vector2<f64>) -> Vec<Mapped> {
        let at = mapped.iter().find(|m| m.0 == reference).unwrap().1;
        let turn = direction.y.atan2(direction.x) - at.y.atan2(at.x);
        mapped.iter().map(|(v, q)| (*v, nalgebra::Rotation2::new(turn) * q)).collect()
    }

    #[test]
    fn a_flat_face_and_the_sides_behind_its_rim_unfold_exactly() {
        let shape = Wedge::default();
        let skin = wedge_skin(&shape, 3e-3);
        let slope = 0.25_f64.atan();
        // Along the top as it rises, and down the sides at y = 0 and y = 60 mm.
        let net = |p: &Point3<f64>| {
            let below = shape.height_m(p.x) - p.z;
            let across = if p.y < 1e-9 {
                -below
            } else if p.y > 0.06 - 1e-9 {
                0.06 + below
            } else {
                p.y
            };
            let is_on_net = below < 1e-9 || p.y < 1e-9 || p.y > 0.06 - 1e-9;
            is_on_net.then(|| Vector2::new(p.x / slope.cos(), across))
        };
        let source = nearest(&skin, Point3::new(0.05, 0.02, shape.height_m(0.05)));
        let centre = skin.positions()[source.index()];
        let reference = nearest(&skin, Point3::new(0.06, 0.02, shape.height_m(0.06)));
        let mapped = ExponentialMaps::new(&skin).around(source, 0.028, |_| true);
        let direction = net(&skin.positions()[reference.index()]).unwrap() - net(&centre).unwrap();
        let (mut n_top, mut n_side) = (0, 0);
        for (v, q) in turned(&mapped, reference, direction) {
            let p = skin.positions()[v.index()];
            let expected = net(&p).unwrap() - net(&centre).unwrap();
            let is_top = shape.height_m(p.x) - p.z < 1e-9;
            // Sides are not developed with the top: they are vertical, the rim is slanted.
            let tolerance = if is_top { 1e-9 } else { 1.5e-3 };
            assert!((q - expected).norm() < tolerance, "{p}: {q} and not {expected}");
            if is_top { n_top += 1 } else { n_side += 1 }
        }
        assert!(n_top > 150 && n_side > 5, "{n_top} {n_side}");
    }

    #[test]
    fn only_what_is_admitted_and_near_is_reached() {
        let skin = wedge_skin(&Wedge::default(), 4e-3);
        let source = nearest(&skin, Point3::new(0.05, 0.03, 0.0275));
        let normals = skin.vertex_normals();
        let maps = ExponentialMaps::new(&skin);
        let top = maps.around(source, 0.05, |v| normals[v.index()].z > 0.9);
        assert!(top.iter().all(|(v, _)| normals[v.index()].z > 0.9));
        let all = maps.around(source, 0.05, |_| true);
        assert!(all.len() > top.len() && all.iter().all(|(_, q)| q.norm() <= 0.05));
        assert!(all.windows(2).all(|w| w[0].1.norm() <= w[1].1.norm() + 1e-12), "nearest first");
        assert_eq!(all[0], (source, Vector2::zeros()));
    }

    #[test]
    fn distances_on_a_ball_are_arcs() {
        let skin = ball(0.05, 24);
        let mapped = ExponentialMaps::new(&skin).around(VertexIdx::from_index(0), 0.1, |_| true);
        let pole = skin.positions()[0].coords;
        for (v, q) in &mapped {
            let arc = 0.05 * pole.angle(&skin.positions()[v.index()].coords);
            assert!((q.norm() - arc).abs() < 0.02 * arc + 1e-12, "{} and not {arc}", q.norm());
        }
        assert!(mapped.len() > skin.n_vertices() / 2);
    }

    /// A subdivided octahedron.
    fn ball(radius_m: f64, n: usize) -> Skin {
        let mut positions = Vec::new();
        let mut index = std::collections::BTreeMap::new();
        let mut triangles = Vec::new();
        for octant in 0..8 {
            let sign = [0, 1, 2].map(|k| if octant >> k & 1 == 0 { 1_i64 } else { -1 });
            let mut at = |a: usize, b: usize| {
                let key = [sign[0] * a as i64, sign[1] * b as i64, sign[2] * (n - a - b) as i64];
                *index.entry(key).or_insert_with(|| {
                    let p = nalgebra::Vector3::from(key.map(|k| k as f64)).normalize() * radius_m;
                    positions.push(Point3::from(p));
                    VertexIdx::from_index(positions.len() - 1)
                })
            };
            let flips = sign.iter().product::<i64>() < 0;
            for a in 0..n {
                for b in 0..n - a {
                    let mut add = |[p, q, r]: [VertexIdx; 3]| triangles.push(if flips { [p, r, q] } else { [p, q, r] });
                    let (p, q, r) = (at(a, b), at(a + 1, b), at(a, b + 1));
                    add([p, q, r]);
                    if a + b + 1 < n {
                        let s = at(a + 1, b + 1);
                        add([q, s, r]);
                    }
                }
            }
        }
        Skin::new(positions, triangles).unwrap()
    }
}
