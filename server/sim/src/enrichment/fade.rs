//! Fade of detail with the novelty of a state.

use crate::smoothstep::smoothstep;

/// Trust of a correlator in its weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Trust {
    /// Share of the detail that is added to the skin, 0 to 1.
    pub(crate) share: f32,
    /// Published confidence: 0 for the plain coarse skin, 1 for a state among the examples.
    pub(crate) confidence: f32,
}

impl Trust {
    /// Full trust.
    pub(crate) const FULL: Self = Self { share: 1.0, confidence: 1.0 };
    /// No detail.
    pub(crate) const NONE: Self = Self { share: 0.0, confidence: 0.0 };
}

/// Smooth fall from 1 to 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fade {
    begin: f32,
    end: f32,
}

impl Fade {
    /// Full share up to twice the largest leave-one-out novelty; zero half-way between that and 1.
    pub(crate) fn after(novelties: &[f64]) -> Self {
        let newest = novelties.iter().copied().fold(0.0, f64::max);
        let begin = (2.0 * newest).min(0.5);
        Self { begin: begin as f32, end: (0.5 * (begin + 1.0)) as f32 }
    }

    /// The share fades between `begin` and `end`; the confidence falls with novelty from 0 on.
    pub(crate) fn trust(&self, novelty: f32) -> Trust {
        let share = 1.0 - smoothstep((novelty - self.begin) / (self.end - self.begin));
        Trust { share, confidence: share * (1.0 - novelty).clamp(0.0, 1.0) }
    }
}

/// `W`: 1 up to the first share of the radius, 0 from the second on.
#[inline(always)]
pub(crate) fn window([inner, outer]: [f64; 2], share: f32) -> f32 {
    1.0 - smoothstep((share - inner as f32) / (outer - inner) as f32)
}
