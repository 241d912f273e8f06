//! Features of a contact: the coarse skin's offset on a 5 x 5 stencil around the contact point, in its frame.
//!
//! A stencil point holds the mean over hat functions of one pitch, weighted by area, of sample vertices spread evenly over the
//! skin: `f_j = sum_v h(q_v - q_j) A_v u_v / sum_v h A_v`, times the root of a Gaussian that falls off with distance.

use nalgebra::Vector3;
use plica_geometry::{ReferenceSkin, VertexIdx};

use super::layout::anchors;
use super::situation::Situation;

/// Points per axis.
const N: usize = 5;
/// Features of a contact.
pub(crate) const N_FEATURES: usize = 3 * N * N;
/// Sample vertices per pitch.
const SAMPLES: f64 = 3.0;
/// Area around a stencil point below which it is weighted down, as a share of the squared pitch.
const LEAST_AREA: f32 = 0.25;

/// A sample vertex.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Rest position \[m\].
    position: Vector3<f32>,
    vertex: u32,
    /// Area around the vertex \[m2\].
    area: f32,
}

/// The stencil on one skin.
#[derive(Debug, Clone)]
pub(crate) struct Stencil {
    pitch: f32,
    samples: Vec<Sample>,
    /// Root of the Gaussian at each point.
    shares: [f32; N * N],
}

impl Stencil {
    /// `pitch` and the width of the Gaussian \[m\].
    pub(crate) fn new(skin: &ReferenceSkin, pitch: f64, width: f64) -> Self {
        let vertices = anchors(skin, pitch / SAMPLES);
        let positions = skin.skin().positions();
        let mut areas = vec![0.0; vertices.len()];
        for (p, area) in positions.iter().zip(skin.vertex_areas()) {
            let distance = |i: &usize| (positions[vertices[*i].index()] - p).norm_squared();
            let nearest = (0..vertices.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
            areas[nearest.unwrap_or(0)] += area;
        }
        let middle = (N / 2) as f64;
        let share = |j: usize| {
            let squared = ((j / N) as f64 - middle).powi(2) + ((j % N) as f64 - middle).powi(2);
            (-squared * (pitch / width).powi(2) / 4.0).exp() as f32
        };
        let sample = |(v, area): (&VertexIdx, f64)| Sample {
            position: positions[v.index()].coords.cast(),
            vertex: v.index() as u32,
            area: area as f32,
        };
        let samples = vertices.iter().zip(areas).map(sample).collect();
        Self { pitch: pitch as f32, samples, shares: std::array::from_fn(share) }
    }

    /// Features \[m\].
    pub(crate) fn measure(&self, situation: &Situation<'_>) -> [f32; N_FEATURES] {
        let mut sums = [Vector3::<f32>::zeros(); N * N];
        let mut areas = [0.0_f32; N * N];
        let middle = (N / 2) as f32;
        // Distance along the skin is at least the straight one: vertices beyond the stencil's corner are skipped.
        let reach = (2.0_f32.sqrt() * self.pitch * (middle + 1.0)).powi(2);
        let is_near = |sample: &&Sample| (sample.position - situation.contact_point).norm_squared() < reach;
        for &Sample { vertex, area, .. } in self.samples.iter().filter(is_near) {
            let [x, y] = situation.coordinates(vertex as usize).map(|q| q / self.pitch + middle);
            if x <= -1.0 || y <= -1.0 || x >= N as f32 || y >= N as f32 {
                continue;
            }
            let offset = situation.offset(vertex as usize);
            let (i, j) = (x.floor(), y.floor());
            for (di, dj) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)] {
                let (row, column) = (i + di, j + dj);
                if (0.0..N as f32).contains(&row) && (0.0..N as f32).contains(&column) {
                    let at = row as usize * N + column as usize;
                    let share = area * (1.0 - (x - row).abs()) * (1.0 - (y - column).abs());
                    areas[at] += share;
                    sums[at] += offset * share;
                }
            }
        }
        let least = LEAST_AREA * self.pitch * self.pitch;
        let mut features = [0.0; N_FEATURES];
        for (at, out) in features.chunks_exact_mut(3).enumerate() {
            let mean = situation.frame * sums[at] * (self.shares[at] / areas[at].max(least));
            out.copy_from_slice(mean.as_slice());
        }
        features
    }
}
