//! Enrichment of the skin while examples are active.

use plica_sim::enrichment::LiveEnrichment;
use plica_sim::{Model, Stage, State};

use super::stage_timer::TurnProbe;

/// Active enrichment, if any.
#[derive(Debug, Default)]
pub(super) struct Detail {
    live: Option<Box<LiveEnrichment>>,
    generation: u32,
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

    /// Writes the skin as it is published, `[n_skin]` \[m\].
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
        probe.leave();
    }

    /// Confidence at a tool when a skin was last written; 0 without contact or examples.
    pub(super) fn confidence(&self, tool: usize) -> f32 {
        self.live.as_ref().map_or(0.0, |live| live.confidence(tool))
    }

    /// Least confidence over the tools in contact when a skin was last written; `None` without examples.
    pub(super) fn least_confidence(&self) -> Option<f32> {
        self.live.as_ref().map(|live| live.least_confidence())
    }
}
