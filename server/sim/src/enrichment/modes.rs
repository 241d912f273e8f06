//! Fields of all examples, compressed: `field_i = sum_m a_im mode_m`, so that the cost of blending does not grow with
//! the examples.
//!
//! Modes are the principal components of the fields (not centred: no example, no detail), the strongest first.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use wide::{i16x16, i32x16};

use crate::lanes::{F, LANES};

/// Storage of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 32-bit floats.
    F32,
    /// 16-bit fixed-point with a scale per mode; half the memory.
    I16,
}

#[derive(Debug, Clone)]
enum Values {
    F32(Vec<F>),
    I16(Vec<i16x16>),
}

/// Modes `[rank][groups]` and the examples' coordinates in them.
#[derive(Debug, Clone)]
pub(crate) struct Modes {
    values: Values,
    n_groups: usize,
    /// Size of one unit of each mode's table.
    units: Vec<f32>,
    /// `a_im`, `[n_examples][rank]`
    coordinates: Vec<f32>,
    n_examples: usize,
}

impl Modes {
    /// Modes of the fields `[n_examples][length]` with inner products `gram`; with at least as many modes as examples,
    /// the fields themselves.
    pub(crate) fn new(fields: &[Vec<f64>], gram: &DMatrix<f64>, n_modes: usize, precision: Precision) -> Self {
        let n = fields.len();
        if n_modes >= n {
            return Self::store(fields, &DMatrix::identity(n, n), precision);
        }
        let eigen = SymmetricEigen::new(gram.clone());
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        order.truncate(n_modes);
        let axes = DMatrix::from_fn(n, order.len(), |i, m| eigen.eigenvectors[(i, order[m])]);
        let mode = |m: usize| combine(fields, &axes.column(m).into_owned());
        let modes: Vec<Vec<f64>> = (0..order.len()).map(mode).collect();
        Self::store(&modes, &axes, precision)
    }

    fn store(modes: &[Vec<f64>], axes: &DMatrix<f64>, precision: Precision) -> Self {
        let length = modes.first().map_or(0, Vec::len);
        let n_groups = length.div_ceil(LANES);
        let largest = |mode: &Vec<f64>| mode.iter().map(|v| v.abs()).fold(f64::MIN_POSITIVE, f64::max);
        let unit = |mode| match precision {
            Precision::F32 => 1.0,
            Precision::I16 => largest(mode) / f64::from(i16::MAX),
        };
        let units: Vec<f64> = modes.iter().map(unit).collect();
        let entries = modes.iter().zip(&units).flat_map(|(mode, unit)| {
            let entry = move |g: usize, l: usize| mode.get(g * LANES + l).map_or(0.0, |v| v / unit);
            (0..n_groups).map(move |g| std::array::from_fn::<f64, LANES, _>(|l| entry(g, l)))
        });
        let values = match precision {
            Precision::F32 => Values::F32(entries.map(|e| F::new(e.map(|v| v as f32))).collect()),
            Precision::I16 => Values::I16(entries.map(|e| i16x16::new(e.map(|v| v.round() as i16))).collect()),
        };
        let coordinates = axes.transpose().iter().map(|a| *a as f32).collect();
        Self {
            values,
            n_groups,
            units: units.iter().map(|u| *u as f32).collect(),
            coordinates,
            n_examples: axes.nrows(),
        }
    }

    pub(crate) fn rank(&self) -> usize {
        self.units.len()
    }

    /// Bytes of the modes.
    pub(crate) fn bytes(&self) -> usize {
        match &self.values {
            Values::F32(v) => size_of_val(v.as_slice()),
            Values::I16(v) => size_of_val(v.as_slice()),
        }
    }

    /// `out = sum_i w_i field_i`; `scratch` holds at least `rank` numbers.
    pub(crate) fn blend(&self, weights: &[f32], scratch: &mut [f32], out: &mut [F]) {
        let rank = self.rank();
        let coefficients = &mut scratch[..rank];
        coefficients.fill(0.0);
        for (row, w) in self.coordinates.chunks_exact(rank).zip(&weights[..self.n_examples]) {
            if *w != 0.0 {
                coefficients.iter_mut().zip(row).for_each(|(c, a)| *c += w * a);
            }
        }
        coefficients.iter_mut().zip(&self.units).for_each(|(c, unit)| *c *= unit);
        let out = &mut out[..self.n_groups];
        match &self.values {
            Values::F32(values) => sum(values, coefficients, out, |v| *v),
            Values::I16(values) => sum(values, coefficients, out, |v| F::from_i32x16(i32x16::from_i16x16(*v))),
        }
    }
}

/// `out_g = sum_m c_m mode_m,g`, four modes at a time, so that the sum is loaded and stored less often.
#[inline(always)]
fn sum<T>(values: &[T], coefficients: &[f32], out: &mut [F], load: impl Fn(&T) -> F) {
    let n = out.len();
    out.fill(F::ZERO);
    let mut modes = values.chunks_exact(n).zip(coefficients).filter(|(_, c)| **c != 0.0);
    while let Some((a, ca)) = modes.next() {
        let rest = [modes.next(), modes.next(), modes.next()];
        if let [Some((b, cb)), Some((c, cc)), Some((d, cd))] = rest {
            let [ca, cb, cc, cd] = [ca, cb, cc, cd].map(|c| F::splat(*c));
            for (g, o) in out.iter_mut().enumerate() {
                let two = load(&a[g]).mul_add(ca, load(&b[g]).mul_add(cb, *o));
                *o = load(&c[g]).mul_add(cc, load(&d[g]).mul_add(cd, two));
            }
        } else {
            for (mode, c) in [Some((a, ca))].into_iter().chain(rest).flatten() {
                let c = F::splat(*c);
                out.iter_mut().zip(mode).for_each(|(o, v)| *o = load(v).mul_add(c, *o));
            }
        }
    }
}

/// Products of all pairs of fields, `[n][n]`.
pub(crate) fn gram(fields: &[Vec<f64>]) -> DMatrix<f64> {
    let dot = |i: usize, j: usize| fields[i].iter().zip(&fields[j]).map(|(a, b)| a * b).sum();
    let lower = DMatrix::from_fn(fields.len(), fields.len(), |i, j| if j <= i { dot(i, j) } else { 0.0 });
    lower.lower_triangle() + lower.lower_triangle().transpose() - DMatrix::from_diagonal(&lower.diagonal())
}

fn combine(fields: &[Vec<f64>], weights: &DVector<f64>) -> Vec<f64> {
    let mut sum = vec![0.0; fields[0].len()];
    for (field, w) in fields.iter().zip(weights.iter()) {
        sum.iter_mut().zip(field).for_each(|(s, v)| *s += w * v);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thirty fields that are sums of four patterns, the later ones weaker.
    fn fields() -> Vec<Vec<f64>> {
        let pattern = |m: usize, j: usize| ((m + 1) as f64 * 0.37 * j as f64).sin() / (1 << m) as f64;
        let share = |i: usize, m: usize| (1.3 * (i * (m + 2)) as f64).cos();
        let value = |i: usize, j: usize| (0..4).map(|m| share(i, m) * pattern(m, j)).sum();
        (0..30).map(|i| (0..100).map(|j| value(i, j)).collect()).collect()
    }

    /// Largest error over all fields, as a share of the largest value.
    fn error(n_modes: usize, precision: Precision) -> f64 {
        let fields = fields();
        let modes = Modes::new(&fields, &gram(&fields), n_modes, precision);
        let (mut scratch, mut out) = (vec![0.0; modes.rank()], vec![F::ZERO; 7]);
        let mut worst: f64 = 0.0;
        for (i, field) in fields.iter().enumerate() {
            let mut weights = vec![0.0; 30];
            weights[i] = 1.0;
            modes.blend(&weights, &mut scratch, &mut out);
            let blended = bytemuck::cast_slice::<F, f32>(&out);
            worst = field.iter().zip(blended).map(|(a, b)| (a - f64::from(*b)).abs()).fold(worst, f64::max);
        }
        worst / fields.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()))
    }

    #[test]
    fn as_many_modes_as_patterns_lose_nothing() {
        assert!(error(30, Precision::F32) < 1e-6);
        assert!(error(4, Precision::F32) < 1e-5);
        assert!(error(4, Precision::I16) < 1e-4);
        let [three, two] = [error(3, Precision::F32), error(2, Precision::F32)];
        assert!(three > 1e-3 && two > three && two < 0.5, "{three} {two}");
    }

    #[test]
    fn all_numbers_of_modes_blend_alike() {
        // Modes are summed four at a time; what is left over must not be lost.
        for n_modes in [5, 6, 7, 9] {
            assert!(error(n_modes, Precision::F32) < 1e-5, "{n_modes}");
        }
    }
}
