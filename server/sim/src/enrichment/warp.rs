//! Warp: each example is looked up between the same vertex and the same chart coordinates.
//!
//! With the charts of the present contact point, `q`, and of the example's, `q_i`, the vertex `p` gets
//! `D_i(q_i^-1(q_i(p) + W (q(p) - q_i(p))))`: near the contact a stamp that needs no texels, far from it the vector
//! method, without the ghost of an indentation between. Needs a search per example and vertex: for comparison, too slow
//! for 1 kHz.

use nalgebra::{Matrix3, Vector2, Vector3};
use plica_geometry::Skin;
use wide::f32x4;

use super::fade::window;
use super::lattice::is_torn;
use super::situation::Situation;
use crate::lanes::Node;

/// A weight below this share of the largest one is left out.
const LEAST_SHARE: f32 = 1e-3;
/// Cells per side of the search grid.
const CELLS: usize = 64;
/// Tolerance of a triangle's inside, in barycentric weights.
const SLACK: f32 = 1e-4;

/// All examples with their charts.
#[derive(Debug, Clone)]
pub(crate) struct Warp {
    triangles: Vec<[u32; 3]>,
    radius: f32,
    examples: Vec<Example>,
}

#[derive(Debug, Clone)]
struct Example {
    /// `D_i`, `[n_skin]` \[m\], world axes.
    detail: Vec<Vector3<f32>>,
    frame: Matrix3<f32>,
    /// `q_i`, `[n_skin]` \[m\].
    at: Vec<Vector2<f32>>,
    /// Triangles that overlap each cell of the chart.
    cells: Vec<Vec<u32>>,
}

impl Warp {
    pub(crate) fn new(skin: &Skin, situations: &[Situation<'_>], details: &[Vec<Vector3<f64>>], radius: f64) -> Self {
        let triangles = skin.triangles().iter().map(|t| t.map(|v| v.index() as u32)).collect();
        let mut this = Self { triangles, radius: radius as f32, examples: Vec::new() };
        for (situation, detail) in situations.iter().zip(details) {
            let at: Vec<_> = (0..detail.len()).map(|v| Vector2::from(situation.coordinates(v))).collect();
            let cells = this.sort(skin, &at);
            let detail = detail.iter().map(|d| d.cast()).collect();
            this.examples.push(Example { detail, frame: situation.frame, at, cells });
        }
        this
    }

    /// Triangles by the cells that they overlap.
    fn sort(&self, skin: &Skin, at: &[Vector2<f32>]) -> Vec<Vec<u32>> {
        let mut cells = vec![Vec::new(); CELLS * CELLS];
        for (t, corners) in self.triangles.iter().enumerate() {
            let corners = corners.map(|v| v as usize);
            let placed = corners.map(|v| at[v]);
            let is_near = placed.iter().all(|q| q.amax() < 1.5 * self.radius);
            if !is_near || is_torn(skin, corners, placed.map(|q| q.cast())) {
                continue;
            }
            let range = |k: usize| {
                let ends = placed.map(|q| q[k]);
                self.cell(ends.into_iter().fold(f32::INFINITY, f32::min))
                    ..=self.cell(ends.into_iter().fold(-1e9, f32::max))
            };
            range(0).for_each(|i| range(1).for_each(|j| cells[i * CELLS + j].push(t as u32)));
        }
        cells
    }

    fn cell(&self, x: f32) -> usize {
        let share = (x / self.radius + 1.0) * 0.5;
        ((share * CELLS as f32).max(0.0) as usize).min(CELLS - 1)
    }

    pub(crate) fn bytes(&self) -> usize {
        self.examples.iter().map(|e| size_of_val(e.detail.as_slice()) + size_of_val(e.at.as_slice())).sum()
    }

    pub(crate) fn add(
        &self,
        situation: &Situation<'_>,
        weights: &[f32],
        share: f32x4,
        shares: [f64; 2],
        out: &mut [Node],
    ) {
        let largest = weights.iter().fold(0.0_f32, |m, w| m.max(w.abs()));
        for (example, weight) in self.examples.iter().zip(weights) {
            if weight.abs() <= LEAST_SHARE * largest {
                continue;
            }
            let turn = situation.frame.transpose() * example.frame;
            for (vertex, out) in out.iter_mut().enumerate() {
                let q = Vector2::from(situation.coordinates(vertex));
                let inside = window(shares, q.norm() / self.radius);
                let looked_up = self.look_up(example, vertex, &q, inside);
                let turned = turn * looked_up * inside + looked_up * (1.0 - inside);
                let added = f32x4::new([turned.x, turned.y, turned.z, 0.0]) * f32x4::splat(*weight);
                *out = added.mul_add(share, f32x4::from(*out)).to_array();
            }
        }
    }

    fn look_up(&self, example: &Example, vertex: usize, q: &Vector2<f32>, inside: f32) -> Vector3<f32> {
        let own = example.at[vertex];
        let here = example.detail[vertex];
        if inside == 0.0 || own.amax() >= self.radius {
            return here;
        }
        let target = own + (q - own) * inside;
        let candidates = &example.cells[self.cell(target.x) * CELLS + self.cell(target.y)];
        let found = candidates.iter().find_map(|&t| {
            let corners = self.triangles[t as usize].map(|v| v as usize);
            let weights = barycentric(&target, corners.map(|v| example.at[v]))?;
            Some(corners.iter().zip(weights).map(|(v, w)| example.detail[*v] * w).sum())
        });
        found.unwrap_or(here)
    }
}

/// Weights of the corners, if the point lies in the triangle.
fn barycentric(p: &Vector2<f32>, [a, b, c]: [Vector2<f32>; 3]) -> Option<[f32; 3]> {
    let doubled = (b - a).perp(&(c - a));
    let (v, w) = ((p - a).perp(&(c - a)) / doubled, (b - a).perp(&(p - a)) / doubled);
    let weights = [1.0 - v - w, v, w];
    weights.iter().all(|x| *x >= -SLACK).then_some(weights)
}
