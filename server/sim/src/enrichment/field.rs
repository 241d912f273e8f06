//! Interpolation: the detail that weights make of the examples \[SSH12, 5.3\].
//!
//! A vertex at `q` in the chart of the contact point gets
//!
//! `d(p) = W(|q|) sum_i w_i S_i(q) + (1 - W) sum_i w_i D_i(p) - B(|q|) u_c(p)`
//!
//! with stamps `S_i`, the examples' `D_i = d_i + B u_c,i` at the vertices, and the window `W`, 1 inside and 0 beyond the chart. The
//! stamp method is the first term alone, the vector method the second; a blend is both; a warp samples each stamp at
//! `q - (1 - W) q(c_i)`, which is the stamp near the contact and the example's own place far from it. Stamps are blended first and
//! sampled once. They are kept in the frame at the contact point and turned with it.

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};
use plica_geometry::ReferenceSkin;
use wide::f32x4;

use super::fade::smoothstep;
use super::groups::Groups;
use super::lattice::Lattice;
use super::modes::{Modes, Precision, gram};
use super::rescale::{Rescale, distance};
use super::situation::Situation;
use super::warp::Warp;
use crate::lanes::{F, LANES, Node};

/// What blended examples are laid on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolator {
    /// Vertices, Eq. 12.
    Vector,
    /// A chart around the contact point, Eq. 13.
    Stamp,
    /// The chart near the contact point, vertices beyond.
    Blend,
    /// The chart near the contact point, each example's own place beyond.
    Warp,
}

/// How stamps are stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldOptions {
    /// See [`Interpolator`].
    pub interpolator: Interpolator,
    /// Texels per side.
    pub texels: usize,
    /// Shares of the chart's radius between which the window falls from 1 to 0.
    pub window: [f64; 2],
    /// Modes that are kept; at least as many as examples keeps the examples.
    pub modes: usize,
    /// How they are stored.
    pub precision: Precision,
    /// Whether examples only tell what rescaling the coarse dent leaves.
    pub control_variate: bool,
}

/// Examples' detail, ready to be blended.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    options: FieldOptions,
    radius: f32,
    lattice: Lattice,
    texel_groups: Groups,
    /// `W (B - B_far)` at texels.
    shade: Vec<f32>,
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
    texels: Vec<f32x4>,
}

impl Field {
    /// `details` are the examples', `[n][n_skin]` \[m\], no examples: what rescaling alone does.
    pub(crate) fn new(
        options: FieldOptions,
        radius: f64,
        rescale: &Rescale,
        skin: &ReferenceSkin,
        (situations, details): (&[Situation<'_>], &[Vec<[f32; 3]>]),
    ) -> Self {
        let lattice = Lattice::new(radius, options.texels);
        let window = |r: f64| f64::from(window(options.window, (r / radius) as f32));
        let shade = |texel| {
            let r = lattice.position(texel).norm();
            (window(r) * (rescale.at(r) - rescale.far())) as f32
        };
        let mut this = Self {
            options,
            radius: radius as f32,
            lattice,
            texel_groups: Groups::new(lattice.n_texels()),
            shade: (0..lattice.n_texels()).map(shade).collect(),
            far: rescale.far() as f32,
            products: DMatrix::zeros(0, 0),
            stamps: None,
            vectors: None,
            warp: None,
        };
        let left = |(s, d): (&Situation<'_>, &Vec<[f32; 3]>)| -> Vec<Vector3<f64>> {
            let of_vertex = |(v, d): (usize, &[f32; 3])| {
                let r = distance(s, v);
                let b = rescale.far() + window(r) * (rescale.at(r) - rescale.far());
                Vector3::from(d.map(f64::from)) + s.offset(v).cast::<f64>() * b
            };
            d.iter().enumerate().map(of_vertex).collect()
        };
        let left: Vec<Vec<Vector3<f64>>> = situations.iter().zip(details).map(left).collect();
        if left.is_empty() {
            return this;
        }
        let (modes, precision) = (options.modes, options.precision);
        if options.interpolator != Interpolator::Vector {
            let stamps: Vec<Vec<Vector3<f64>>> =
                situations.iter().zip(&left).map(|(s, d)| this.stamp(skin, s, d)).collect();
            if options.interpolator == Interpolator::Warp {
                let fields: Vec<_> = stamps.iter().map(|s| planar(this.texel_groups, s)).collect();
                this.products = gram(&fields);
                this.warp = Some(Warp::new(skin, situations, stamps));
            } else {
                let weighted = |stamp: &Vec<Vector3<f64>>| {
                    let share = |t: usize| window(lattice.position(t).norm());
                    let scaled: Vec<_> = stamp.iter().enumerate().map(|(t, d)| d * share(t)).collect();
                    planar(this.texel_groups, &scaled)
                };
                let fields: Vec<_> = stamps.iter().map(weighted).collect();
                this.products = gram(&fields);
                this.stamps = Some(Modes::new(&fields, &this.products, modes, precision));
            }
        }
        if matches!(options.interpolator, Interpolator::Vector | Interpolator::Blend) {
            let groups = Groups::new(skin.skin().n_vertices());
            let fields: Vec<_> = left.iter().map(|d| planar(groups, d)).collect();
            this.products = gram(&fields);
            this.vectors = Some(Modes::new(&fields, &this.products, modes, precision));
        }
        this
    }

    /// Detail at texels in the frame at the contact point; zero where the skin does not reach.
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
            stamp[covered.texel] = frame * mixed;
        }
        stamp
    }

    /// Products of the examples' fields, `[n][n]`: what correlators learn to predict.
    pub(crate) fn products(&self) -> &DMatrix<f64> {
        &self.products
    }

    pub(crate) fn scratch(&self, n_skin: usize) -> FieldScratch {
        let n_groups = self.texel_groups.n().max(Groups::new(n_skin).n());
        let rank = |m: &Option<Modes>| m.as_ref().map_or(0, Modes::rank);
        FieldScratch {
            coefficients: vec![0.0; rank(&self.stamps).max(rank(&self.vectors))],
            planar: vec![F::ZERO; 3 * n_groups],
            texels: vec![f32x4::ZERO; self.lattice.n_texels()],
        }
    }

    /// Detail of all skin vertices, `[n_skin]` \[m\], all of it times `share`.
    pub(crate) fn evaluate(
        &self,
        situation: &Situation<'_>,
        weights: &[f32],
        share: f32,
        scratch: &mut FieldScratch,
        out: &mut [Node],
    ) {
        let FieldScratch { coefficients, planar, texels } = scratch;
        self.blend_stamps(situation, weights, (coefficients, planar), texels);
        let far = f32x4::splat(self.far);
        let share = f32x4::splat(share);
        for (q, (offsets, out)) in
            situation.layout.iter().zip(situation.offsets.chunks(LANES).zip(out.chunks_mut(LANES)))
        {
            let (texel, x, y) = self.lattice.locate(q);
            for (lane, (u, out)) in offsets.iter().zip(out).enumerate() {
                let sampled = self.lattice.sample(texels, (texel[lane], x[lane], y[lane]));
                let rescaled = far + f32x4::splat(sampled.to_array()[3]);
                *out = (share * (sampled - rescaled * f32x4::from(*u))).to_array();
            }
        }
        if let Some(warp) = &self.warp {
            warp.add(situation, weights, share, (&self.lattice, self.radius, self.options.window), out);
        }
        if let Some(vectors) = &self.vectors {
            vectors.blend(weights, coefficients, planar);
            self.add_vectors(situation, planar, share, out);
        }
    }

    /// Blended, turned to the world, with the shade of the rescaling as fourth component.
    fn blend_stamps(
        &self,
        situation: &Situation<'_>,
        weights: &[f32],
        (coefficients, planar): (&mut [f32], &mut [F]),
        texels: &mut [f32x4],
    ) {
        let n = self.texel_groups.n();
        let Some(stamps) = &self.stamps else {
            texels.iter_mut().zip(&self.shade).for_each(|(t, shade)| *t = f32x4::new([0.0, 0.0, 0.0, *shade]));
            return;
        };
        stamps.blend(weights, coefficients, planar);
        let m = situation.frame.map(F::splat);
        for (g, (texels, shade)) in texels.chunks_mut(LANES).zip(self.shade.chunks(LANES)).enumerate() {
            let local = [planar[g], planar[n + g], planar[2 * n + g]];
            let world: [[f32; LANES]; 3] = std::array::from_fn(|k| {
                let sum = local[0] * m[(0, k)];
                local[2].mul_add(m[(2, k)], local[1].mul_add(m[(1, k)], sum)).to_array()
            });
            for (lane, (texel, shade)) in texels.iter_mut().zip(shade).enumerate() {
                *texel = f32x4::new([world[0][lane], world[1][lane], world[2][lane], *shade]);
            }
        }
    }

    fn add_vectors(&self, situation: &Situation<'_>, planar: &[F], share: f32x4, out: &mut [Node]) {
        let n = situation.layout.len();
        let is_blend = self.stamps.is_some();
        for (g, out) in out.chunks_mut(LANES).enumerate() {
            let axes: [[f32; LANES]; 3] = std::array::from_fn(|k| planar[k * n + g].to_array());
            for (lane, out) in out.iter_mut().enumerate() {
                let [x, y] = situation.coordinates(g * LANES + lane);
                let inside = if is_blend { window(self.options.window, x.hypot(y) / self.radius) } else { 0.0 };
                let vector = f32x4::new([axes[0][lane], axes[1][lane], axes[2][lane], 0.0]);
                *out = (vector * f32x4::splat(1.0 - inside)).mul_add(share, f32x4::from(*out)).to_array();
            }
        }
    }

    /// Bytes that an evaluation reads of the examples.
    pub(crate) fn bytes(&self) -> usize {
        [&self.stamps, &self.vectors].into_iter().flatten().map(Modes::bytes).sum::<usize>()
            + self.warp.as_ref().map_or(0, Warp::bytes)
    }
}

/// `W`: 1 up to the first share of the radius, 0 from the second on.
#[inline(always)]
pub(crate) fn window([inner, outer]: [f64; 2], share: f32) -> f32 {
    1.0 - smoothstep((share - inner as f32) / (outer - inner) as f32)
}

/// Axis after axis, each filled up to whole groups.
fn planar(groups: Groups, field: &[Vector3<f64>]) -> Vec<f64> {
    let value = |k: usize, i: usize| field.get(i).map_or(0.0, |v| v[k]);
    (0..3).flat_map(|k| (0..groups.n() * LANES).map(move |i| (k, i))).map(|(k, i)| value(k, i)).collect()
}
