//! Skin vertices sixteen at a time.

use crate::lanes::{F, LANES};

/// Vertices in groups of [`LANES`]; the last group is filled up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Groups {
    n_items: usize,
}

impl Groups {
    pub(crate) fn new(n_items: usize) -> Self {
        Self { n_items }
    }

    /// Groups.
    pub(crate) fn n(self) -> usize {
        self.n_items.div_ceil(LANES)
    }
}

/// A vector per item, axis by axis: `[3][groups]`.
#[derive(Debug, Clone)]
pub(crate) struct Planar {
    values: Vec<F>,
    n_groups: usize,
}

impl Planar {
    pub(crate) fn zeros(groups: Groups) -> Self {
        Self { values: vec![F::ZERO; 3 * groups.n()], n_groups: groups.n() }
    }

    /// Fills up with the last item.
    pub(crate) fn new(groups: Groups, of_item: impl Fn(usize) -> [f64; 3]) -> Self {
        let mut this = Self::zeros(groups);
        for k in 0..3 {
            for g in 0..groups.n() {
                let lane = |l: usize| of_item((g * LANES + l).min(groups.n_items - 1))[k] as f32;
                this.values[k * groups.n() + g] = F::new(std::array::from_fn(lane));
            }
        }
        this
    }

    pub(crate) fn axis(&self, k: usize) -> &[F] {
        &self.values[k * self.n_groups..][..self.n_groups]
    }
}
