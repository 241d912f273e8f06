//! The grid of texels that a stamp is stored on: square, around the contact point, finer in the middle.
//!
//! A coordinate `x` between `-R` and `R` lies at `s = (1 + b) t / (1 + b |t|)`, `t = x / R`: texels are `1 + b` times closer in the
//! middle than on average, and as much wider at the rim.

use nalgebra::Vector2;
use plica_geometry::Skin;
use wide::{f32x4, f32x8};

use crate::lanes::{F, LANES};

/// `b`
const STRETCH: f64 = 2.0;
/// A triangle that a chart stretches by more than this lies across its cut.
const LARGEST_STRETCH: f64 = 3.0;

/// Texels `[n][n]`, the second coordinate running fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lattice {
    radius: f64,
    n: usize,
}

/// A texel and the next one of its row, the layout for [`Lattice::sample`].
pub(crate) type Pair = [f32x4; 2];

/// Stores a texel in both pairs that hold it.
#[inline(always)]
pub(crate) fn put(pairs: &mut [Pair], texel: usize, value: f32x4) {
    pairs[texel][0] = value;
    if texel > 0 {
        pairs[texel - 1][1] = value;
    }
}

/// One texel covered by a triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Covered {
    pub(crate) texel: usize,
    pub(crate) corners: [usize; 3],
    pub(crate) weights: [f64; 3],
}

/// Position of a point in the grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GridPoint {
    /// Lower texel of the cell around the point; negative outside the grid.
    pub(crate) texel: i32,
    /// Shares of the upper texels along both coordinates.
    pub(crate) x: f32,
    pub(crate) y: f32,
}

/// Sixteen [`GridPoint`]s.
pub(crate) struct GridPoints {
    texel: [i32; LANES],
    x: [f32; LANES],
    y: [f32; LANES],
}

impl GridPoints {
    #[inline(always)]
    pub(crate) fn lane(&self, lane: usize) -> GridPoint {
        GridPoint { texel: self.texel[lane], x: self.x[lane], y: self.y[lane] }
    }
}

impl Lattice {
    pub(crate) fn new(radius: f64, n: usize) -> Self {
        Self { radius, n }
    }

    pub(crate) fn n_texels(&self) -> usize {
        self.n * self.n
    }

    /// Coordinates of a texel \[m\].
    pub(crate) fn position(&self, texel: usize) -> Vector2<f64> {
        let coordinate = |i: usize| {
            let s = 2.0 * i as f64 / (self.n - 1) as f64 - 1.0;
            self.radius * s / (1.0 + STRETCH - STRETCH * s.abs())
        };
        Vector2::new(coordinate(texel / self.n), coordinate(texel % self.n))
    }

    /// Fractional texel index of a coordinate.
    fn index(&self, x: f64) -> f64 {
        let t = x / self.radius;
        let s = (1.0 + STRETCH) * t / (1.0 + STRETCH * t.abs());
        0.5 * (s + 1.0) * (self.n - 1) as f64
    }

    /// Positions of sixteen points in the grid.
    #[inline(always)]
    pub(crate) fn locate(&self, q: &[F; 2]) -> GridPoints {
        let (last, radius) = ((self.n - 1) as f32, F::splat(self.radius as f32));
        let stretch = F::splat(STRETCH as f32);
        let place = |x: F| {
            let t = x / radius;
            let s = (F::ONE + stretch) * t / stretch.mul_add(t.abs(), F::ONE);
            (s + F::ONE) * F::splat(0.5 * last)
        };
        let (x, y) = (place(q[0]), place(q[1]));
        let inside = q[0].abs().fast_max(q[1].abs()).simd_le(radius);
        let cell = |x: F| x.fast_max(F::ZERO).fast_min(F::splat(last - 1.0)).floor();
        let (i, j) = (cell(x), cell(y));
        let texel = inside.bitselect(i.mul_add(F::splat(self.n as f32), j), F::splat(-1.0));
        GridPoints { texel: texel.fast_trunc_int().to_array(), x: (x - i).to_array(), y: (y - j).to_array() }
    }

    /// Position of one point in the grid.
    pub(crate) fn locate_one(&self, q: [f32; 2]) -> GridPoint {
        self.locate(&q.map(F::splat)).lane(0)
    }

    /// Bilinear between the four texels of a cell; zero outside.
    #[inline(always)]
    pub(crate) fn sample(&self, pairs: &[Pair], GridPoint { texel, x, y }: GridPoint) -> f32x4 {
        if texel < 0 {
            return f32x4::ZERO;
        }
        let [lower, upper]: [f32x8; 2] = [texel as usize, texel as usize + self.n].map(|t| bytemuck::cast(pairs[t]));
        let [first, second]: [f32x4; 2] = bytemuck::cast((upper - lower).mul_add(f32x8::splat(x), lower));
        (second - first).mul_add(f32x4::splat(y), first)
    }

    /// Texels covered by triangles at chart coordinates `at`; `None` for vertices that the chart does not reach.
    pub(crate) fn cover(&self, skin: &Skin, at: &[Option<Vector2<f64>>]) -> Vec<Covered> {
        let mut covered = Vec::new();
        for triangle in skin.triangles() {
            let corners = triangle.map(|v| v.index());
            let [Some(a), Some(b), Some(c)] = corners.map(|v| at[v]) else { continue };
            if !is_torn(skin, corners, [a, b, c]) {
                self.cover_triangle(corners, [a, b, c], &mut covered);
            }
        }
        covered
    }

    fn cover_triangle(&self, corners: [usize; 3], at: [Vector2<f64>; 3], covered: &mut Vec<Covered>) {
        let [a, b, c] = at.map(|q| Vector2::new(self.index(q.x), self.index(q.y)));
        let doubled = (b - a).perp(&(c - a));
        if doubled.abs() < 1e-12 {
            return;
        }
        let range = |k: usize| {
            let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            low.ceil().max(0.0) as i64..=high.floor().min((self.n - 1) as f64) as i64
        };
        for i in range(0) {
            for j in range(1) {
                let p = Vector2::new(i as f64, j as f64);
                let (v, w) = ((p - a).perp(&(c - a)) / doubled, (b - a).perp(&(p - a)) / doubled);
                let weights = [1.0 - v - w, v, w];
                if weights.iter().all(|w| *w >= -1e-9) {
                    covered.push(Covered { texel: i as usize * self.n + j as usize, corners, weights });
                }
            }
        }
    }
}

/// Whether a chart stretches a triangle so much that it must lie across the chart's cut.
pub(crate) fn is_torn(skin: &Skin, corners: [usize; 3], at: [Vector2<f64>; 3]) -> bool {
    [(0, 1), (1, 2), (2, 0)].iter().any(|&(i, j)| {
        let here = (skin.positions()[corners[i]] - skin.positions()[corners[j]]).norm();
        (at[i] - at[j]).norm() > LARGEST_STRETCH * here
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use plica_geometry::shapes::{Wedge, wedge_skin};

    use super::*;

    #[test]
    fn texels_lie_where_they_are_found() {
        let lattice = Lattice::new(0.08, 32);
        for texel in [0, 5, 33, 500, 32 * 31 - 2] {
            let q = lattice.position(texel);
            let GridPoint { texel: found, x, y } = lattice.locate_one([q.x as f32, q.y as f32]);
            let (row, column) = (found as f32 / 32.0, found as f32 % 32.0);
            assert!((row.floor() + x - (texel / 32) as f32).abs() < 1e-3, "{texel}: {found} {x}");
            assert!((column + y - (texel % 32) as f32).abs() < 1e-3, "{texel}: {found} {y}");
        }
        assert!(lattice.locate_one([0.081, 0.0]).texel < 0 && lattice.locate_one([0.0, -1e6]).texel < 0);
        let [middle, rim] = [16, 31].map(|i| lattice.position(32 * i).x - lattice.position(32 * (i - 1)).x);
        assert!(rim > 4.0 * middle, "{middle} {rim}");
    }

    #[test]
    fn samples_are_texels_and_between_them_means() {
        let lattice = Lattice::new(1.0, 8);
        let mut pairs = vec![[f32x4::ZERO; 2]; 64];
        let value = |texel: usize| (texel / 8) as f32 * 10.0 + (texel % 8) as f32;
        (0..64).for_each(|texel| put(&mut pairs, texel, f32x4::splat(value(texel))));
        let sample = |texel, x, y| lattice.sample(&pairs, GridPoint { texel, x, y }).to_array();
        assert_eq!(sample(19, 0.0, 0.0), [value(19); 4]);
        assert_eq!(sample(19, 0.5, 0.25), [value(19) + 5.25; 4]);
        assert_eq!(sample(-1, 0.5, 0.25), [0.0; 4]);
    }

    #[test]
    fn a_skin_that_is_laid_out_covers_the_texels_under_it() {
        let skin = wedge_skin(&Wedge::default(), 4e-3);
        let is_top = |v: usize| (skin.positions()[v].z - Wedge::default().height_m(skin.positions()[v].x)).abs() < 1e-9;
        let at = |v: usize| is_top(v).then(|| Vector2::new(skin.positions()[v].x - 0.06, skin.positions()[v].y - 0.03));
        let at: Vec<_> = (0..skin.n_vertices()).map(at).collect();
        let lattice = Lattice::new(0.05, 24);
        let covered = lattice.cover(&skin, &at);
        for texel in 0..lattice.n_texels() {
            let q = lattice.position(texel);
            let found = covered.iter().find(|c| c.texel == texel);
            assert_eq!(found.is_some(), q.y.abs() <= 0.03, "{q}");
            if let Some(found) = found {
                let x: f64 = found.corners.iter().zip(found.weights).map(|(v, w)| at[*v].unwrap().x * w).sum();
                assert!((x - q.x).abs() < 5e-4, "{x} and not {}", q.x);
            }
        }
    }
}
