//! Each example's stamp sampled at a place of its own: `q - (1 - W(|q|)) q(c_i)`.
//!
//! Costs a sample per example and vertex: for comparison, not for 1 kHz.

use nalgebra::Vector3;
use plica_geometry::ReferenceSkin;
use wide::f32x4;

use super::field::window;
use super::lattice::Lattice;
use super::situation::Situation;
use crate::lanes::Node;

/// A weight below this share of the largest one is left out.
const LEAST_SHARE: f32 = 1e-3;

/// Stamps as they are.
#[derive(Debug, Clone)]
pub(crate) struct Warp {
    /// `[n][texel]`, in the frame at each example's contact point \[m\].
    stamps: Vec<Vec<f32x4>>,
    /// The skin vertex nearest to each example's contact point.
    places: Vec<usize>,
}

impl Warp {
    pub(crate) fn new(skin: &ReferenceSkin, situations: &[Situation<'_>], stamps: Vec<Vec<Vector3<f64>>>) -> Self {
        let texel = |d: Vector3<f64>| f32x4::new([d.x as f32, d.y as f32, d.z as f32, 0.0]);
        let place = |s: &Situation<'_>| {
            let distance = |v: &usize| (skin.skin().positions()[*v].coords - s.contact_point.cast::<f64>()).norm();
            (0..skin.skin().n_vertices()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
        };
        Self {
            stamps: stamps.into_iter().map(|s| s.into_iter().map(texel).collect()).collect(),
            places: situations.iter().map(place).collect(),
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.stamps.iter().map(|s| size_of_val(s.as_slice())).sum()
    }

    pub(crate) fn add(
        &self,
        situation: &Situation<'_>,
        weights: &[f32],
        share: f32x4,
        (lattice, radius, shares): (&Lattice, f32, [f64; 2]),
        out: &mut [Node],
    ) {
        let largest = weights.iter().fold(0.0_f32, |m, w| m.max(w.abs()));
        let m = situation.frame;
        let columns: [f32x4; 3] = std::array::from_fn(|k| f32x4::new([m[(k, 0)], m[(k, 1)], m[(k, 2)], 0.0]));
        for ((stamp, place), weight) in self.stamps.iter().zip(&self.places).zip(weights) {
            if weight.abs() <= LEAST_SHARE * largest {
                continue;
            }
            let centre = situation.coordinates(*place);
            for (vertex, out) in out.iter_mut().enumerate() {
                let [x, y] = situation.coordinates(vertex);
                let away = 1.0 - window(shares, x.hypot(y) / radius);
                let place = lattice.locate_one([x - away * centre[0], y - away * centre[1]]);
                let sampled = lattice.sample(stamp, place).to_array();
                let world = columns[0] * f32x4::splat(sampled[0])
                    + columns[1] * f32x4::splat(sampled[1])
                    + columns[2] * f32x4::splat(sampled[2]);
                *out = (world * f32x4::splat(*weight)).mul_add(share, f32x4::from(*out)).to_array();
            }
        }
    }
}
