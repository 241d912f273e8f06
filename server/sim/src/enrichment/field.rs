//! Interpolation of detail from weighted examples \[SSH12, 5.3\].
//!
//! A vertex at `q` in the chart of the contact point gets
//!
//! `d(p) = sum_i w_i D_i - B(|q|) u_c(p)`, `D_i = d_i + B u_c,i`
//!
//! with the remainder `D_i` of an example's detail after rescaling of the coarse indentation. Interpolators differ in
//! the point at which they look up `D_i`:
//!
//! * vector: at the vertex itself, `D_i(p)`;
//! * stamp: at the same chart coordinates, `W S_i(q)`, on a grid of texels in the frame at the contact point, blended
//!   first and sampled once, with the window `W` that is 1 inside and 0 beyond the chart;
//! * blend: the stamp, and at the vertex the residual of the stamp on its own example, `D_i(p) - W S_i(q_i(p))`;
//! * warp: at a point between the two, see [`super::warp`].

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};
use plica_geometry::ReferenceSkin;
use wide::f32x4;

use super::fade::window;
use super::groups::Groups;
use super::lattice::{Lattice, Pair, put};
use super::modes::{Modes, Precision, gram};
use super::rescale::Rescale;
use super::situation::{Situation, vector};
use super::warp::Warp;
use crate::lanes::{F, LANES, Node};

/// Support of the blended examples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolator {
    /// Vertices, Eq. 12.
    Vector,
    /// A chart around the contact point, Eq. 13.
    Stamp,
    /// The chart near the contact point, vertices beyond.
    Blend,
    /// From the chart near the contact point to the vertex beyond, continuously.
    Warp,
}

/// Interpolation of detail and storage of stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldOptions {
    /// See [`Interpolator`].
    pub interpolator: Interpolator,
    /// Texels per side.
    pub texels: usize,
    /// Shares of the chart's radius between which the window falls from 1 to 0.
    pub window: [f64; 2],
    /// Number of modes; at least the number of examples keeps them exactly.
    pub modes: usize,
    /// Storage of modes.
    pub precision: Precision,
    /// Whether examples hold the remainder after rescaling of the coarse indentation.
    pub control_variate: bool,
}

/// Examples that a method is trained on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TrainingSet<'a> {
    pub(crate) situations: &'a [Situation<'a>],
    /// `[n][n_skin]` \[m\]
    pub(crate) details: &'a [Vec<[f32; 3]>],
}

/// Detail of the examples, ready to be blended.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    options: FieldOptions,
    radius: f32,
    lattice: Lattice,
    texel_groups: Groups,
    /// `W (B - B_far)` at texels.
    rescaling: Vec<f32>,
    far: f32,
    products: DMatrix<f64>,
    stamps: Option<Modes>,
    vectors: Option<Modes>,
    warp: Option<Warp>,
}

/// Scratch of one evaluation.
#[derive(Debug, Clone)]
pub(crate) struct FieldScratch {
    coefficients: Vec<f32>,
    planar: Vec<F>,
    texels: Vec<Pair>,
}

impl Field {
    /// Tables of the examples' detail; an empty training set leaves rescaling alone.
    pub(crate) fn new(
        options: FieldOptions,
        radius: f64,
        rescale: &Rescale,
        skin: &ReferenceSkin,
        training_set: TrainingSet<'_>,
    ) -> Self {
        let TrainingSet { situations, details } = training_set;
        let mut this = Self::without_examples(options, radius, rescale);
        if situations.is_empty() {
            return this;
        }
        let left: Vec<_> = situations.iter().zip(details).map(|(s, d)| this.remainder(s, d)).collect();
        let at_vertices = |fields: &[Vec<Vector3<f64>>]| -> Vec<Vec<f64>> {
            fields.iter().map(|d| planar(Groups::new(d.len()), d)).collect()
        };
        let compress = |fields: &[Vec<f64>]| {
            let products = gram(fields);
            (Modes::new(fields, &products, options.modes, options.precision), products)
        };
        if options.interpolator == Interpolator::Vector {
            let (vectors, products) = compress(&at_vertices(&left));
            (this.vectors, this.products) = (Some(vectors), products);
            return this;
        }
        let stamps: Vec<_> = situations.iter().zip(&left).map(|(s, d)| this.stamp(skin, s, d)).collect();
        let at_texels: Vec<_> = stamps.iter().map(|stamp| planar(this.texel_groups, stamp)).collect();
        if options.interpolator == Interpolator::Warp {
            this.products = gram(&at_texels);
            this.warp = Some(Warp::new(skin.skin(), situations, &left, radius));
            return this;
        }
        let (compressed, products) = compress(&at_texels);
        (this.stamps, this.products) = (Some(compressed), products);
        if options.interpolator == Interpolator::Blend {
            let stamp_residual =
                situations.iter().zip(&stamps).zip(&left).map(|((s, stamp), d)| this.stamp_residual(s, stamp, d));
            this.vectors = Some(compress(&at_vertices(&stamp_residual.collect::<Vec<_>>())).0);
        }
        this
    }

    fn without_examples(options: FieldOptions, radius: f64, rescale: &Rescale) -> Self {
        let lattice = Lattice::new(radius, options.texels);
        let rescaling = |texel| {
            let r = lattice.position(texel).norm();
            let inside = f64::from(window(options.window, (r / radius) as f32));
            (inside * (rescale.at(r) - rescale.far())) as f32
        };
        Self {
            options,
            radius: radius as f32,
            lattice,
            texel_groups: Groups::new(lattice.n_texels()),
            rescaling: (0..lattice.n_texels()).map(rescaling).collect(),
            far: rescale.far() as f32,
            products: DMatrix::zeros(0, 0),
            stamps: None,
            vectors: None,
            warp: None,
        }
    }

    /// `D_i = d_i + B u_c,i`, with the same `B` as at run time.
    fn remainder(&self, situation: &Situation<'_>, detail: &[[f32; 3]]) -> Vec<Vector3<f64>> {
        let rescaling = self.paired(&self.rescaling.iter().map(|s| f32x4::splat(*s)).collect::<Vec<_>>());
        let of_vertex = |(v, d): (usize, &[f32; 3])| {
            let place = self.lattice.locate_one(situation.coordinates(v));
            let b = f64::from(self.far + self.lattice.sample(&rescaling, place).to_array()[0]);
            Vector3::from(d.map(f64::from)) + situation.offset(v).cast::<f64>() * b
        };
        detail.iter().enumerate().map(of_vertex).collect()
    }

    /// `D_i(p) - W S_i(q_i(p))`, `stamp` being `W S_i`.
    fn stamp_residual(
        &self,
        situation: &Situation<'_>,
        stamp: &[Vector3<f64>],
        left: &[Vector3<f64>],
    ) -> Vec<Vector3<f64>> {
        let world = situation.frame.transpose().cast::<f64>();
        let texel = |d: &Vector3<f64>| {
            let d = world * d;
            f32x4::new([d.x as f32, d.y as f32, d.z as f32, 0.0])
        };
        let texels = self.paired(&stamp.iter().map(texel).collect::<Vec<_>>());
        let of_vertex = |(v, d): (usize, &Vector3<f64>)| {
            let sampled = self.lattice.sample(&texels, self.lattice.locate_one(situation.coordinates(v)));
            d - vector(&sampled.to_array()).cast::<f64>()
        };
        left.iter().enumerate().map(of_vertex).collect()
    }

    /// `W S_i` in the frame at the contact point; zero where the skin does not reach.
    fn stamp(&self, skin: &ReferenceSkin, situation: &Situation<'_>, detail: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let reach = 1.5 * f64::from(self.radius);
        let at = |v: usize| {
            let q = Vector2::from(situation.coordinates(v).map(f64::from));
            (q.norm() < reach).then_some(q)
        };
        let at: Vec<_> = (0..detail.len()).map(at).collect();
        let frame: Matrix3<f64> = situation.frame.cast();
        let mut stamp = vec![Vector3::zeros(); self.lattice.n_texels()];
        for covered in self.lattice.cover(skin.skin(), &at) {
            let mixed: Vector3<f64> = covered.corners.iter().zip(covered.weights).map(|(v, w)| detail[*v] * w).sum();
            let r = self.lattice.position(covered.texel).norm();
            let inside = f64::from(window(self.options.window, r as f32 / self.radius));
            stamp[covered.texel] = frame * mixed * inside;
        }
        stamp
    }

    fn paired(&self, texels: &[f32x4]) -> Vec<Pair> {
        let mut pairs = vec![[f32x4::ZERO; 2]; self.lattice.n_texels()];
        texels.iter().enumerate().for_each(|(texel, value)| put(&mut pairs, texel, *value));
        pairs
    }

    /// Inner products of the examples' fields, `[n][n]`: correlators are fitted to predict these fields.
    pub(crate) fn products(&self) -> &DMatrix<f64> {
        &self.products
    }

    pub(crate) fn scratch(&self, n_skin: usize) -> FieldScratch {
        let n_groups = self.texel_groups.n().max(Groups::new(n_skin).n());
        let rank = |m: &Option<Modes>| m.as_ref().map_or(0, Modes::rank);
        FieldScratch {
            coefficients: vec![0.0; rank(&self.stamps).max(rank(&self.vectors))],
            planar: vec![F::ZERO; 3 * n_groups],
            texels: self.paired(&[]),
        }
    }

    /// Detail of all skin vertices times `share`, `[n_skin]` \[m\].
    pub(crate) fn evaluate(
        &self,
        situation: &Situation<'_>,
        weights: &[f32],
        share: f32,
        scratch: &mut FieldScratch,
        out: &mut [Node],
    ) {
        self.sample(situation, weights, share, scratch, |group, detail| {
            let out = &mut out[group * LANES..];
            let n = out.len().min(LANES);
            out[..n].copy_from_slice(&detail[..n]);
        });
        let (FieldScratch { coefficients, planar, .. }, share) = (scratch, f32x4::splat(share));
        if let Some(warp) = &self.warp {
            warp.add(situation, weights, share, self.options.window, out);
        }
        if let Some(vectors) = &self.vectors {
            vectors.blend(weights, coefficients, planar);
            self.add_vectors(situation, planar, share, out);
        }
    }

    /// Whether [`Field::sample`] yields the whole detail.
    pub(crate) fn is_sampled(&self) -> bool {
        self.warp.is_none() && self.vectors.is_none()
    }

    /// Calls `each` with stamps and rescaling, sixteen vertices at a time \[m\].
    #[inline(always)]
    pub(crate) fn sample(
        &self,
        situation: &Situation<'_>,
        weights: &[f32],
        share: f32,
        scratch: &mut FieldScratch,
        mut each: impl FnMut(usize, &[Node; LANES]),
    ) {
        self.blend_stamps(situation, weights, scratch);
        let texels = &scratch.texels;
        let (far, share) = (f32x4::splat(self.far), f32x4::splat(share));
        for (group, q) in situation.layout.iter().enumerate() {
            let located = self.lattice.locate(q);
            let offsets = situation.offsets.group(group);
            let detail = std::array::from_fn(|lane| {
                let sampled = self.lattice.sample(texels, located.lane(lane));
                let rescaled = far + f32x4::splat(sampled.to_array()[3]);
                (share * (sampled - rescaled * f32x4::from(offsets[lane]))).to_array()
            });
            each(group, &detail);
        }
    }

    /// Blends the stamps and turns them to world axes; the fourth component is `W (B - B_far)`.
    fn blend_stamps(&self, situation: &Situation<'_>, weights: &[f32], scratch: &mut FieldScratch) {
        let FieldScratch { coefficients, planar, texels } = scratch;
        let n = self.texel_groups.n();
        let Some(stamps) = &self.stamps else {
            let rescaling = self.rescaling.iter().enumerate();
            rescaling.for_each(|(texel, rescaling)| put(texels, texel, f32x4::new([0.0, 0.0, 0.0, *rescaling])));
            return;
        };
        stamps.blend(weights, coefficients, planar);
        let m = situation.frame.map(F::splat);
        for (g, rescaling) in self.rescaling.chunks(LANES).enumerate() {
            let local = [planar[g], planar[n + g], planar[2 * n + g]];
            let world: [[f32; LANES]; 3] = std::array::from_fn(|k| {
                let sum = local[0] * m[(0, k)];
                local[2].mul_add(m[(2, k)], local[1].mul_add(m[(1, k)], sum)).to_array()
            });
            for (lane, rescaling) in rescaling.iter().enumerate() {
                put(texels, g * LANES + lane, f32x4::new([world[0][lane], world[1][lane], world[2][lane], *rescaling]));
            }
        }
    }

    fn add_vectors(&self, situation: &Situation<'_>, planar: &[F], share: f32x4, out: &mut [Node]) {
        let n = situation.layout.len();
        for (g, out) in out.chunks_mut(LANES).enumerate() {
            let axes: [[f32; LANES]; 3] = std::array::from_fn(|k| planar[k * n + g].to_array());
            for (lane, out) in out.iter_mut().enumerate() {
                let vector = f32x4::new([axes[0][lane], axes[1][lane], axes[2][lane], 0.0]);
                *out = vector.mul_add(share, f32x4::from(*out)).to_array();
            }
        }
    }

    /// Bytes that an evaluation reads of the examples.
    pub(crate) fn bytes(&self) -> usize {
        [&self.stamps, &self.vectors].into_iter().flatten().map(Modes::bytes).sum::<usize>()
            + self.warp.as_ref().map_or(0, Warp::bytes)
    }
}

/// Components axis by axis, each padded to whole groups.
fn planar(groups: Groups, field: &[Vector3<f64>]) -> Vec<f64> {
    let value = |k: usize, i: usize| field.get(i).map_or(0.0, |v| v[k]);
    (0..3).flat_map(|k| (0..groups.n() * LANES).map(move |i| (k, i))).map(|(k, i)| value(k, i)).collect()
}
