//! An enrichment method with its scratch memory, run state by state.

use std::time::Instant;

use nalgebra::Vector3;
use plica_sim::enrichment::{Contact, Enricher, EnricherScratch, Touch};
use plica_sim::{Model, State};

/// Result of a method on one state.
pub(super) struct Outcome {
    /// `[n_skin]` \[m\]
    pub(super) detail: Vec<[f32; 3]>,
    pub(super) confidence: f64,
    /// Of one evaluation on one thread \[us\].
    pub(super) time_us: f64,
}

/// An enricher with the memory of one thread.
pub(super) struct Prepared<'a> {
    model: &'a Model,
    enricher: Enricher,
    scratch: EnricherScratch,
    state: State,
    offsets: Vec<[f32; 4]>,
    detail: Vec<[f32; 4]>,
    plain: Vec<[f32; 3]>,
}

impl<'a> Prepared<'a> {
    pub(super) fn new(model: &'a Model, enricher: Enricher) -> Self {
        Self {
            scratch: enricher.scratch(),
            state: State::new(model),
            offsets: vec![[0.0; 4]; model.n_skin()],
            detail: vec![[0.0; 4]; model.n_skin()],
            plain: vec![[0.0; 3]; model.n_skin()],
            model,
            enricher,
        }
    }

    /// Bytes of the examples' tables.
    pub(super) fn table_bytes(&self) -> usize {
        let [_, of_examples] = self.enricher.bytes();
        of_examples
    }

    /// Detail \[m\] and confidence at nodal displacements `[n_nodes]` \[m\], all of them times `factor`.
    pub(super) fn evaluate(&mut self, u: &[[f32; 3]], factor: f64, touch: &Touch) -> (&[[f32; 3]], f64) {
        self.place(u, factor);
        let confidence = self.step(touch);
        self.plain.iter_mut().zip(&self.detail).for_each(|(plain, [x, y, z, _])| *plain = [*x, *y, *z]);
        (&self.plain, confidence)
    }

    /// [`Self::evaluate`] twice, with the time of the second evaluation.
    pub(super) fn evaluate_timed(&mut self, u: &[[f32; 3]], touch: &Touch) -> Outcome {
        self.evaluate(u, 1.0, touch);
        let begin = Instant::now();
        let confidence = self.step(touch);
        let time_us = 1e6 * begin.elapsed().as_secs_f64();
        Outcome { detail: self.plain.clone(), confidence, time_us }
    }

    fn place(&mut self, u: &[[f32; 3]], factor: f64) {
        let nodes: Vec<_> = u.iter().map(|u| Vector3::from(u.map(f64::from)) * factor).collect();
        self.state.set_node_displacements(self.model, &nodes);
        self.state.write_padded_offsets(self.model, &mut self.offsets);
    }

    fn step(&mut self, touch: &Touch) -> f64 {
        let Self { enricher, model, state, offsets, scratch, detail, .. } = self;
        enricher.evaluate(&Contact::new(model, state, offsets, touch), scratch, detail).into()
    }
}
