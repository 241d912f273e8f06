//! Errors of a field of detail.

use serde::{Deserialize, Serialize};

use super::statistics::Quantiles;

/// A vector per skin vertex, `[n_skin][3]` \[m\].
pub(super) type Field = [[f32; 3]];

/// Set of vertices with areas, over which errors are taken.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    /// Vertex and area \[m2\].
    vertices: Vec<(usize, f64)>,
    area: f64,
}

/// Error of one state over one patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measure {
    /// `E`: RMS error over the coarse skin's own.
    pub(super) ratio: f64,
    /// Largest error of a vertex over the coarse skin's largest.
    pub(super) worst_ratio: f64,
    /// RMS error against `tied` \[m\].
    pub(super) tied_m: f64,
    /// RMS error against `independent` \[m\].
    pub(super) independent_m: Option<f64>,
}

/// Errors of many states.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// Number of states.
    pub states: usize,
    /// Median of `E` over the states.
    pub median: f64,
    /// Its 95th percentile.
    pub p95: f64,
    /// Its largest.
    pub worst: f64,
    /// Median RMS error against `tied` \[mm\].
    pub median_mm: f64,
    /// The same against `independent` \[mm\]; absent if a state has none.
    pub independent_median_mm: Option<f64>,
    /// RMS errors against `tied` \[mm\].
    pub tied_mm: Quantiles,
    /// RMS errors against `independent` \[mm\]; absent if a state has none.
    pub independent_mm: Option<Quantiles>,
    /// Largest error of a vertex over the coarse skin's largest.
    pub worst_vertex: Quantiles,
}

impl Patch {
    /// Patch of the vertices for which `is_in` holds.
    pub(super) fn new(areas: &[f64], is_in: impl Fn(usize) -> bool) -> Self {
        let vertices: Vec<_> = areas.iter().copied().enumerate().filter(|(v, _)| is_in(*v)).collect();
        Self { area: vertices.iter().map(|(_, area)| area).sum(), vertices }
    }

    /// Area-weighted RMS of `a - b`, or of `a` alone \[m\].
    pub(super) fn rms(&self, a: &Field, b: Option<&Field>) -> f64 {
        let squared: f64 = self.vertices.iter().map(|(v, area)| area * difference_squared(a, b, *v)).sum();
        (squared / self.area).sqrt()
    }

    /// Largest length of `a - b`, or of `a` alone \[m\].
    pub(super) fn largest(&self, a: &Field, b: Option<&Field>) -> f64 {
        self.vertices.iter().map(|(v, _)| difference_squared(a, b, *v)).fold(0.0, f64::max).sqrt()
    }

    /// Error of `detail` against the detail of both references; `None` where the tied detail is zero.
    pub(super) fn measure(&self, detail: &Field, tied: &Field, independent: Option<&Field>) -> Option<Measure> {
        let own = self.rms(tied, None);
        let tied_m = self.rms(detail, Some(tied));
        (own > 0.0).then(|| Measure {
            ratio: tied_m / own,
            worst_ratio: self.largest(detail, Some(tied)) / self.largest(tied, None),
            tied_m,
            independent_m: independent.map(|i| self.rms(detail, Some(i))),
        })
    }
}

impl Group {
    /// `None` without a state.
    pub(super) fn of(measures: &[Measure]) -> Option<Self> {
        let over = |f: &dyn Fn(&Measure) -> f64| Quantiles::of(measures.iter().map(f));
        let ratio = over(&|m| m.ratio)?;
        let tied_mm = over(&|m| 1e3 * m.tied_m)?;
        let independent: Option<Vec<f64>> = measures.iter().map(|m| m.independent_m).collect();
        let independent_mm = independent.and_then(|all| Quantiles::of(all.into_iter().map(|m| 1e3 * m)));
        Some(Self {
            states: measures.len(),
            median: ratio.median,
            p95: ratio.p95,
            worst: ratio.worst,
            median_mm: tied_mm.median,
            independent_median_mm: independent_mm.map(|q| q.median),
            tied_mm,
            independent_mm,
            worst_vertex: over(&|m| m.worst_ratio)?,
        })
    }
}

fn difference_squared(a: &Field, b: Option<&Field>, v: usize) -> f64 {
    let b = b.map_or([0.0; 3], |b| b[v]);
    (0..3).map(|k| (f64::from(a[v][k]) - f64::from(b[k])).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    /// Three vertices, the first with half of the area.
    const AREAS: [f64; 3] = [2.0, 1.0, 1.0];
    const TIED: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 4.0]];

    #[test]
    fn errors_of_known_fields() {
        let all = Patch::new(&AREAS, |_| true);
        // (2 * 1 + 4 + 16) / 4 = 5.5
        assert!((all.rms(&TIED, None) - 5.5_f64.sqrt()).abs() < 1e-12);
        let quarter_left = TIED.map(|d| d.map(|c| 0.75 * c));
        let m = all.measure(&quarter_left, &TIED, Some(&quarter_left)).unwrap();
        assert!((m.ratio - 0.25).abs() < 1e-12 && (m.worst_ratio - 0.25).abs() < 1e-12);
        assert_eq!(m.independent_m, Some(0.0));
        // Nothing but the first vertex is wrong, by 3 m: sqrt(2 * 9 / 4) over sqrt(5.5), and 3 over 4.
        let mut one_wrong = TIED;
        one_wrong[0][1] = 3.0;
        let m = all.measure(&one_wrong, &TIED, None).unwrap();
        assert!((m.ratio - (4.5_f64 / 5.5).sqrt()).abs() < 1e-12 && (m.worst_ratio - 0.75).abs() < 1e-12);
        let rest = Patch::new(&AREAS, |v| v > 0);
        assert_eq!(rest.measure(&one_wrong, &TIED, None).unwrap().ratio, 0.0, "the patch leaves it out");
    }

    #[test]
    fn without_detail_the_ratio_is_exactly_one() {
        let all = Patch::new(&AREAS, |_| true);
        let m = all.measure(&[[0.0; 3]; 3], &TIED, None).unwrap();
        assert_eq!((m.ratio, m.worst_ratio), (1.0, 1.0));
        assert_eq!(all.measure(&TIED, &[[0.0; 3]; 3], None), None, "a skin that misses nothing has no ratio");
    }

    #[test]
    fn one_state_without_the_second_reference_leaves_it_out_of_the_group() {
        let m = Measure { ratio: 0.5, worst_ratio: 0.6, tied_m: 1e-4, independent_m: Some(2e-4) };
        let both = Group::of(&[m, m]).unwrap();
        assert_eq!((both.states, both.median, both.median_mm), (2, 0.5, 0.1));
        assert_eq!(both.independent_median_mm, Some(0.2));
        let one = Group::of(&[m, Measure { independent_m: None, ..m }]).unwrap();
        assert_eq!(one.independent_mm, None);
        assert_eq!(Group::of(&[]), None);
    }
}
