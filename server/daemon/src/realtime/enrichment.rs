//! Enrichment of the skin while examples are active.

use plica_sim::enrichment::LiveEnrichment;
use plica_sim::{Model, Stage, State};

use super::stage_timer::TurnProbe;

/// Active enrichment, if any.
#[derive(Debug, Default)]
pub(super) struct Detail {
    live: Option<Box<LiveEnrichment>>,
    generation: u32,
    /// Whether the last skin was written without detail, since the detail was not finite.
    left_out: bool,
}

impl Detail {
    /// Counts activations; 0 is the plain coarse skin.
    pub(super) fn generation(&self) -> u32 {
        self.generation
    }

    /// Activates an enrichment and returns the former one, so that it is freed elsewhere.
    pub(super) fn activate(
        &mut self,
        mut live: Box<LiveEnrichment>,
        model: &Model,
        state: &State,
    ) -> Option<Box<LiveEnrichment>> {
        self.generation = self.generation.wrapping_add(1);
        self.left_out = false;
        match &self.live {
            Some(active) => live.adopt(active),
            None => live.follow(model, state),
        }
        self.live.replace(live)
    }

    /// Restarts with the contacts of a state.
    pub(super) fn begin_anew(&mut self, model: &Model, state: &State) {
        if let Some(live) = &mut self.live {
            live.forget();
            live.follow(model, state);
        }
    }

    /// After a tick.
    pub(super) fn follow(&mut self, model: &Model, state: &State, probe: &mut impl TurnProbe) {
        if let Some(live) = &mut self.live {
            probe.enter(Stage::Enrichment);
            live.follow(model, state);
            probe.leave();
        }
    }

    /// Whether the detail of the last skin was not finite: the skin is the coarse one.
    pub(super) fn is_left_out(&self) -> bool {
        self.left_out
    }

    /// Writes the skin as it is published, `[n_skin]` \[m\]: the coarse one where the detail is not finite.
    pub(super) fn write_skin(
        &mut self,
        model: &Model,
        state: &State,
        out: &mut [[f32; 3]],
        probe: &mut impl TurnProbe,
    ) {
        let Some(live) = &mut self.live else { return state.write_skin(model, out) };
        probe.enter(Stage::Enrichment);
        live.write_skin(model, state, out);
        self.left_out = !is_finite(out);
        if self.left_out {
            state.write_skin(model, out);
        }
        probe.leave();
    }

    /// Confidence at a tool when a skin was last written; 0 without contact or examples.
    pub(super) fn confidence(&self, tool: usize) -> f32 {
        self.live.as_ref().filter(|_| !self.left_out).map_or(0.0, |live| live.confidence(tool))
    }

    /// Least confidence over the tools in contact when a skin was last written; 0 for the coarse skin, `None` without
    /// examples.
    pub(super) fn least_confidence(&self) -> Option<f32> {
        self.live.as_ref().map(|live| if self.left_out { 0.0 } else { live.least_confidence() })
    }
}

/// Whether no exponent is that of an infinity or NaN; without a branch per number, so that the compiler makes vectors of it.
fn is_finite(positions: &[[f32; 3]]) -> bool {
    let exponent = f32::INFINITY.to_bits();
    let is_special = |x: &f32| x.to_bits() & exponent == exponent;
    !positions.as_flattened().iter().fold(false, |any, x| any | is_special(x))
}
