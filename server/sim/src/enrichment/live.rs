//! Enrichment over time: each tool carries its own window of detail.
//!
//! While a tool touches, its window follows the contact point. After release the window is held, and its detail goes with the
//! deformation, until the skin under it has recovered. If a tool touches elsewhere before that, the old window hands over to the
//! new one within [`HAND_OVER_S`]. Overlapping windows share the skin by a partition of unity.

use std::sync::Arc;

use super::clearance::{keep_clear, position};
use super::enricher::{Enricher, EnricherScratch};
use super::situation::{Touch, vector};
use crate::lanes::Node;
use crate::model::Model;
use crate::state::State;
use crate::step::placement;

/// Time in which one window of a tool takes over from another \[s\].
const HAND_OVER_S: f32 = 0.05;
/// A contact point that moves farther than this in a tick is another contact, in coarse cells.
const JUMP_CELLS: f64 = 0.25;
/// A held window ends when the skin under it has gone back to this share of its offset at release.
const RECOVERED: f32 = 0.02;
/// Least share of a window where its chart does not reach, so that somebody owns every vertex.
const LEAST_CLOSENESS: f32 = 1e-3;

/// One tool's detail.
#[derive(Debug, Clone, Copy)]
struct Window {
    touch: Touch,
    /// Between 0 and 1: how far it has taken over.
    gain: f32,
    /// Once released: the vertex under it and its offset then \[m\].
    released: Option<(usize, f32)>,
}

/// A tool's window, and the one it takes over from.
#[derive(Debug, Clone, Copy, Default)]
struct ToolWindows {
    current: Option<Window>,
    leaving: Option<Window>,
    confidence: f32,
}

/// What enrichment remembers between ticks, with its tables and scratch. Nothing allocates once it is made.
#[derive(Debug, Clone)]
pub struct LiveEnrichment {
    enricher: Arc<Enricher>,
    scratch: EnricherScratch,
    tools: Vec<ToolWindows>,
    rest: Vec<[f32; 3]>,
    offsets: Vec<Node>,
    detail: Vec<Node>,
    /// Shares of the windows at each vertex: sum and largest.
    shares: Vec<[f32; 2]>,
    total: Vec<Node>,
}

impl LiveEnrichment {
    /// Nothing touched yet.
    pub fn new(model: &Model, enricher: Arc<Enricher>) -> Self {
        let n_skin = model.n_skin();
        let rest = model.description().skin.positions().iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]);
        Self {
            scratch: enricher.scratch(),
            tools: vec![ToolWindows::default(); model.n_tools()],
            rest: rest.collect(),
            offsets: vec![[0.0; 4]; n_skin],
            detail: vec![[0.0; 4]; n_skin],
            shares: vec![[0.0; 2]; n_skin],
            total: vec![[0.0; 4]; n_skin],
            enricher,
        }
    }

    /// The tables.
    pub fn enricher(&self) -> &Arc<Enricher> {
        &self.enricher
    }

    /// Forgets all contacts: the state was reset or restored.
    pub fn forget(&mut self) {
        self.tools.fill(ToolWindows::default());
    }

    /// Confidence in the detail of each tool, `[n_tools]`, when a frame was last written; 0 without contact.
    pub fn confidence(&self, tool: usize) -> f32 {
        self.tools[tool].confidence
    }

    /// Least confidence over the tools with a window when a frame was last written; 0 is the plain coarse skin.
    pub fn least_confidence(&self) -> f32 {
        let with_window = self.tools.iter().filter(|t| t.current.is_some()).map(|t| t.confidence);
        with_window.reduce(f32::min).unwrap_or(0.0)
    }

    /// Follows the contacts of a tick. To be called after every tick; takes next to no time.
    pub fn follow(&mut self, model: &Model, state: &State) {
        let step = model.timestep_s() as f32 / HAND_OVER_S;
        let jump = JUMP_CELLS * f64::from(model.cell_size);
        for (tool, reading) in state.tools().iter().enumerate() {
            let windows = &mut self.tools[tool];
            if let Some(current) = &mut windows.current {
                current.gain = (current.gain + step).min(1.0);
            }
            windows.leaving = windows.leaving.map(|w| Window { gain: w.gain - step, ..w }).filter(|w| w.gain > 0.0);
            if reading.in_contact {
                let tool_origin = reading.proxy.translation.vector.into();
                windows.touch(Touch { contact_point: reading.reference_contact_point_m, tool_origin }, jump);
            } else {
                windows.hold(&self.enricher, |vertex| offset(state, &self.rest, vertex));
            }
        }
    }

    /// Writes the enriched skin, `[n_skin]` \[m\], world axes.
    pub fn write_skin(&mut self, model: &Model, state: &State, out: &mut [[f32; 3]]) {
        state.write_padded_offsets(model, &mut self.offsets);
        match self.windows().count() {
            0 => self.total.fill([0.0; 4]),
            1 => self.lay_one(model, state),
            _ => self.lay_all(model, state),
        }
        for (((out, rest), offset), detail) in out.iter_mut().zip(&self.rest).zip(&self.offsets).zip(&self.total) {
            *out = std::array::from_fn(|k| rest[k] + offset[k] + detail[k]);
        }
        for (reading, solid) in state.tools().iter().zip(&model.solids).filter(|(r, _)| r.present) {
            let coarse = |v: usize| position(&self.rest[v], &self.offsets[v]);
            keep_clear(solid, &placement(&reading.proxy), coarse, out);
        }
    }

    /// Tool, whether it is the tool's present window, and the window.
    fn windows(&self) -> impl Iterator<Item = (usize, bool, Window)> + '_ {
        let of_tool = |(tool, w): (usize, &ToolWindows)| {
            [w.current.map(|c| (tool, true, c)), w.leaving.map(|l| (tool, false, l))]
        };
        self.tools.iter().enumerate().flat_map(of_tool).flatten()
    }

    fn lay_one(&mut self, model: &Model, state: &State) {
        let Some((tool, is_current, window)) = self.windows().next() else { return };
        let (offsets, scratch) = (&self.offsets, &mut self.scratch);
        let confidence = self.enricher.evaluate(model, state, offsets, &window.touch, scratch, &mut self.total);
        if window.gain < 1.0 {
            self.total.iter_mut().for_each(|d| *d = d.map(|c| c * window.gain));
        }
        if is_current {
            self.tools[tool].confidence = confidence;
        }
    }

    /// `d = sum_a g_a h_a d_a / max(sum_a g_a h_a, max_a h_a)` with gains `g` and closeness `h`.
    fn lay_all(&mut self, model: &Model, state: &State) {
        self.total.fill([0.0; 4]);
        self.shares.fill([0.0; 2]);
        for index in 0..2 * self.tools.len() {
            let windows = self.tools[index / 2];
            let is_current = index % 2 == 0;
            let Some(window) = (if is_current { windows.current } else { windows.leaving }) else { continue };
            let (offsets, scratch) = (&self.offsets, &mut self.scratch);
            let confidence = self.enricher.evaluate(model, state, offsets, &window.touch, scratch, &mut self.detail);
            if is_current {
                self.tools[index / 2].confidence = confidence;
            }
            let sums = self.total.iter_mut().zip(&mut self.shares).zip(&self.detail);
            for (vertex, ((total, [sum, largest]), detail)) in sums.enumerate() {
                let closeness = self.enricher.closeness(&self.scratch, vertex).max(LEAST_CLOSENESS);
                let share = window.gain * closeness;
                (0..3).for_each(|k| total[k] += share * detail[k]);
                *sum += share;
                *largest = largest.max(closeness);
            }
        }
        for (total, [sum, largest]) in self.total.iter_mut().zip(&self.shares) {
            *total = total.map(|c| c / sum.max(*largest));
        }
    }
}

impl ToolWindows {
    fn touch(&mut self, touch: Touch, jump: f64) {
        let is_elsewhere = |w: &Window| (w.touch.contact_point - touch.contact_point).norm() > jump;
        match &mut self.current {
            Some(current) if !is_elsewhere(current) => (current.touch, current.released) = (touch, None),
            Some(current) => {
                self.leaving = Some(*current);
                *current = Window { touch, gain: 1.0 - current.gain, released: None };
            }
            None => self.current = Some(Window { touch, gain: 1.0, released: None }),
        }
    }

    fn hold(&mut self, enricher: &Enricher, offset: impl Fn(usize) -> f32) {
        let Some(current) = &mut self.current else { return };
        let (vertex, at_release) = *current.released.get_or_insert_with(|| {
            let vertex = enricher.nearest_vertex(&current.touch);
            (vertex, offset(vertex))
        });
        if offset(vertex) <= RECOVERED * at_release {
            *self = Self { leaving: self.current, ..Self::default() };
        }
    }
}

/// How far a vertex is from where it rests \[m\].
fn offset(state: &State, rest: &[[f32; 3]], vertex: usize) -> f32 {
    let [deformed, rest] = [state.skin.vertex(vertex), rest[vertex]];
    vector(&[deformed[0] - rest[0], deformed[1] - rest[1], deformed[2] - rest[2], 0.0]).norm()
}
