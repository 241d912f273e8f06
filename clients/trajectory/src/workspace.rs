//! Workspace: a box in the world frame.

/// A box in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Workspace {
    /// Lower corner in metres.
    pub min_m: [f64; 3],
    /// Upper corner in metres.
    pub max_m: [f64; 3],
}

impl Workspace {
    /// Bounding box of points; `None` without points.
    pub(crate) fn around<'a>(points: impl IntoIterator<Item = &'a [f64; 3]>) -> Option<Self> {
        let bounds = points.into_iter().map(|p| Self { min_m: *p, max_m: *p });
        bounds.reduce(|a, b| Self {
            min_m: std::array::from_fn(|i| a.min_m[i].min(b.min_m[i])),
            max_m: std::array::from_fn(|i| a.max_m[i].max(b.max_m[i])),
        })
    }

    pub(crate) fn centre(&self) -> [f64; 3] {
        std::array::from_fn(|i| 0.5 * (self.min_m[i] + self.max_m[i]))
    }
}
