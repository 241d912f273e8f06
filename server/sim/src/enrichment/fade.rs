//! From how new a state is to how much its detail is trusted.

/// Smooth fall from 1 to 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fade {
    begin: f32,
    end: f32,
}

impl Fade {
    /// Full confidence up to twice what the newest example would have been to the others, none half-way from there to a state
    /// that no example tells anything about.
    pub(crate) fn after(novelties: &[f64]) -> Self {
        let newest = novelties.iter().copied().fold(0.0, f64::max);
        let begin = (2.0 * newest).min(0.5);
        Self { begin: begin as f32, end: (0.5 * (begin + 1.0)) as f32 }
    }

    /// Between 0 and 1.
    pub(crate) fn confidence(&self, novelty: f32) -> f32 {
        1.0 - smoothstep((novelty - self.begin) / (self.end - self.begin))
    }
}

/// From 0 at `x = 0` to 1 at `x = 1`, level at both ends.
pub(crate) fn smoothstep(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
