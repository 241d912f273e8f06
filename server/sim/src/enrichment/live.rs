//! Enrichment over time: each tool carries its own window of detail.
//!
//! During contact, a tool's window follows the contact point. After release the window is held, and its detail scales
//! with the deformation, until the skin under it has recovered. On a new contact elsewhere before that, the old window
//! hands over to the new one within [`HAND_OVER_S`]. Overlapping windows share the skin by a partition of unity. Confidence
//! moves as steadily as the detail that it speaks for.

use std::sync::Arc;

use wide::f32x4;

use super::clearance::keep_clear;
use super::enricher::{Enricher, EnricherScratch};
use super::fade::Trust;
use super::situation::{Contact, Touch, vector};
use crate::lanes::{LANES, Node};
use crate::model::Model;
use crate::state::State;
use crate::step::placement;

/// Time of a hand-over between windows of a tool, and least time of a full change of a window's share \[s\].
const HAND_OVER_S: f32 = 0.05;
/// Motion in one tick beyond which a contact point is a new contact, in coarse cells.
const JUMP_CELLS: f64 = 0.25;
/// A held window ends once the skin under it is below this share of its offset at release ...
const RECOVERED: f32 = 0.02;
/// ... or slower than this, as it may rest deformed \[m/s\] ...
const STILL_M_PER_S: f32 = 1e-4;
/// ... for this long, as it swings \[s\].
const RECOVERED_S: f32 = 0.1;
/// Least closeness of a window, so that the partition of unity covers vertices outside all charts.
const LEAST_CLOSENESS: f32 = 1e-3;

/// Window of detail of one contact.
#[derive(Debug, Clone, Copy)]
struct Window {
    touch: Touch,
    /// Progress of the hand-over, 0 to 1.
    gain: f32,
    /// Trust at the last evaluation, and its tick.
    laid: Option<(Trust, u64)>,
    released: Option<Released>,
}

/// Recovery of the skin under a held window.
#[derive(Debug, Clone, Copy)]
struct Released {
    vertex: usize,
    /// Offset of the vertex at release, and in the previous tick \[m\].
    at_release: f32,
    before: f32,
    /// Time since recovery \[s\].
    recovered_s: f32,
}

/// A tool's window, and its predecessor during a hand-over.
#[derive(Debug, Clone, Copy, Default)]
struct ToolWindows {
    current: Option<Window>,
    leaving: Option<Window>,
    confidence: Steady,
}

/// A confidence that moves as fast as windows take over, and no faster.
#[derive(Debug, Clone, Copy, Default)]
struct Steady {
    value: f32,
    /// Tick to which it has moved.
    tick: u64,
    /// Value and tick that it has moved from: what is known of a tick may change within it.
    from: (f32, u64),
}

impl Steady {
    /// Moves towards `aim` by at most `step` for every tick since it last moved. While frames are made, ticks with an unknown aim do
    /// not count; where nobody has had a frame for a while, the first one is as confident as if there had been one in every tick.
    fn approach(&mut self, aim: Option<f32>, tick: u64, step: f32, is_watched: bool) {
        let Some(aim) = aim else {
            if is_watched {
                self.tick = tick.saturating_sub(1);
            }
            return;
        };
        if tick != self.tick {
            (self.from, self.tick) = ((self.value, self.tick), tick);
        }
        let (before, begin) = self.from;
        let most = step * tick.saturating_sub(begin) as f32;
        self.value = aim.clamp(before - most, before + most);
    }
}

/// Enrichment of a running simulation: windows, tables and scratch. Allocates on construction only.
#[derive(Debug, Clone)]
pub struct LiveEnrichment {
    enricher: Arc<Enricher>,
    scratch: EnricherScratch,
    tools: Vec<ToolWindows>,
    least_confidence: Steady,
    /// Tick of the frame last written.
    written: Option<u64>,
    offsets: Vec<Node>,
    detail: Vec<Node>,
    /// Sum of the windows' shares at each vertex.
    shares: Vec<f32>,
    total: Vec<Node>,
}

impl LiveEnrichment {
    /// Enrichment before the first contact.
    pub fn new(model: &Model, enricher: Arc<Enricher>) -> Self {
        let n_skin = model.n_skin();
        Self {
            scratch: enricher.scratch(),
            tools: vec![ToolWindows::default(); model.n_tools()],
            least_confidence: Steady::default(),
            written: None,
            offsets: vec![[0.0; 4]; n_skin],
            detail: vec![[0.0; 4]; n_skin],
            shares: vec![0.0; n_skin],
            total: vec![[0.0; 4]; n_skin],
            enricher,
        }
    }

    /// Tables of the method.
    pub fn enricher(&self) -> &Arc<Enricher> {
        &self.enricher
    }

    /// Copies the windows of another enrichment of the same model, for a change of examples during contact.
    pub fn adopt(&mut self, other: &Self) {
        self.tools.copy_from_slice(&other.tools);
        (self.least_confidence, self.written) = (other.least_confidence, other.written);
    }

    /// Forgets all contacts: the state was reset or restored.
    pub fn forget(&mut self) {
        self.tools.fill(ToolWindows::default());
        (self.least_confidence, self.written) = (Steady::default(), None);
    }

    /// Confidence in the detail of each tool, `[n_tools]`; 0 without contact. It follows the frame last written as fast as detail
    /// comes and goes: from 0 to 1 takes 50 ms.
    pub fn confidence(&self, tool: usize) -> f32 {
        self.tools[tool].confidence.value
    }

    /// Least confidence over the tools with a window, as steady as [`Self::confidence`]; 0 is the plain coarse skin.
    pub fn least_confidence(&self) -> f32 {
        self.least_confidence.value
    }

    /// Moves the confidences on to this tick.
    fn steady_confidence(&mut self, tick: u64, step: f32) {
        let is_watched = self.written.is_some_and(|frame| step * tick.saturating_sub(frame) as f32 <= 1.0);
        let mut least = Some(f32::INFINITY);
        for windows in &mut self.tools {
            let aim = windows.confidence_aim();
            windows.confidence.approach(aim, tick, step, is_watched);
            if windows.current.is_some() {
                least = least.zip(aim).map(|(a, b)| a.min(b));
            }
        }
        let least = least.map(|c| if c.is_finite() { c } else { 0.0 });
        self.least_confidence.approach(least, tick, step, is_watched);
    }

    /// Follows the contacts of a tick. To be called after every tick; cheap.
    pub fn follow(&mut self, model: &Model, state: &State) {
        let step = model.timestep_s() as f32 / HAND_OVER_S;
        let jump = JUMP_CELLS * f64::from(model.cell_size);
        let is_alone = self.n_windows() == 0;
        for (tool, reading) in state.tools().iter().enumerate() {
            let windows = &mut self.tools[tool];
            if let Some(current) = &mut windows.current {
                current.gain = (current.gain + step).min(1.0);
            }
            windows.leaving = windows.leaving.map(|w| Window { gain: w.gain - step, ..w }).filter(|w| w.gain > 0.0);
            if reading.contact_point_is_new {
                let tool_origin = reading.proxy.translation.vector.into();
                let touch = Touch { contact_point: reading.reference_contact_point_m, tool_origin };
                windows.touch(touch, jump, is_alone);
            } else if !reading.in_contact {
                let offset = |vertex| self.enricher.offset(state, vertex);
                windows.hold(&self.enricher, offset, model.timestep_s() as f32);
            }
        }
        self.steady_confidence(state.tick(), step);
    }

    fn n_windows(&self) -> usize {
        self.tools.iter().flat_map(ToolWindows::windows).count()
    }

    /// Writes the enriched skin, `[n_skin]` \[m\], world axes.
    pub fn write_skin(&mut self, model: &Model, state: &State, out: &mut [[f32; 3]]) {
        let n_windows = self.n_windows();
        self.written = Some(state.tick());
        if n_windows == 0 {
            state.write_skin(model, out);
            return;
        }
        let step = model.timestep_s() as f32 / HAND_OVER_S;
        let reach = if n_windows == 1 && self.enricher.is_sampled() {
            self.write_one(model, state, out)
        } else {
            self.write_all(model, state, out)
        };
        self.steady_confidence(state.tick(), step);
        for (reading, solid) in state.tools().iter().zip(&model.solids).filter(|(r, _)| r.present && reach > 0.0) {
            keep_clear(solid, &placement(&reading.proxy), &state.skin, reach, out);
        }
    }

    /// Writes the skin with a single window's detail, in one pass; returns the largest detail \[m\].
    fn write_one(&mut self, model: &Model, state: &State, out: &mut [[f32; 3]]) -> f32 {
        let Some(window) = self.tools.iter_mut().flat_map(ToolWindows::windows_mut).next() else { return 0.0 };
        let bounds = window.share_bounds(state.tick(), model.timestep_s() as f32 / HAND_OVER_S);
        let (mut largest, gain) = (f32x4::ZERO, f32x4::splat(window.gain));
        let write = |group: usize, detail: &[Node; LANES]| {
            let [x, y, z]: [[f32; LANES]; 3] = std::array::from_fn(|k| state.skin.group(k, group).to_array());
            for (lane, (out, detail)) in out[group * LANES..].iter_mut().zip(detail).enumerate() {
                let detail = gain * f32x4::from(*detail);
                let [px, py, pz, _] = (f32x4::new([x[lane], y[lane], z[lane], 0.0]) + detail).to_array();
                *out = [px, py, pz];
                largest = largest.fast_max(detail.abs());
            }
        };
        let contact = self.enricher.contact(model, state, &window.touch);
        let trust = self.enricher.sample_within(bounds, &contact, &mut self.scratch, write);
        window.laid = Some((trust.unwrap_or(Trust::NONE), state.tick()));
        if trust.is_none() {
            state.write_skin(model, out);
        }
        vector(&largest.to_array()).norm()
    }

    /// Writes the skin with the detail of all windows; returns the largest detail \[m\].
    fn write_all(&mut self, model: &Model, state: &State, out: &mut [[f32; 3]]) -> f32 {
        state.write_padded_offsets(model, &mut self.offsets);
        self.lay_all(model, state);
        state.write_skin(model, out);
        let mut largest = 0.0_f32;
        for (out, detail) in out.iter_mut().zip(&self.total) {
            (0..3).for_each(|k| out[k] += detail[k]);
            largest = largest.max(vector(detail).norm_squared());
        }
        largest.sqrt()
    }

    /// `d = min(1, sum_a g_a) sum_a g_a h_a d_a / sum_a g_a h_a` with gains `g` and closeness `h`: windows come and go without a
    /// jump.
    fn lay_all(&mut self, model: &Model, state: &State) {
        let Self { enricher, scratch, tools, offsets, detail, shares, total, .. } = self;
        total.fill([0.0; 4]);
        shares.fill(0.0);
        let mut gains = 0.0;
        for window in tools.iter_mut().flat_map(ToolWindows::windows_mut) {
            let bounds = window.share_bounds(state.tick(), model.timestep_s() as f32 / HAND_OVER_S);
            let contact = Contact::new(model, state, offsets, &window.touch);
            let trust = enricher.evaluate_within(bounds, &contact, scratch, detail);
            window.laid = Some((trust, state.tick()));
            let gain = window.gain;
            gains += gain;
            let sums = total.iter_mut().zip(&mut *shares).zip(&*detail);
            for (vertex, ((total, sum), detail)) in sums.enumerate() {
                let closeness = enricher.closeness(scratch, vertex).max(LEAST_CLOSENESS);
                (0..3).for_each(|k| total[k] += gain * closeness * detail[k]);
                *sum += gain * closeness;
            }
        }
        let all = gains.min(1.0);
        for (total, sum) in total.iter_mut().zip(&*shares) {
            *total = total.map(|c| all * c / sum.max(f32::MIN_POSITIVE));
        }
    }
}

impl Window {
    fn new(touch: Touch, gain: f32) -> Self {
        Self { touch, gain, laid: None, released: None }
    }

    /// Bounds on the share: it changes by at most `step` per tick, so that detail does not pop; unbounded at the first
    /// evaluation.
    fn share_bounds(&self, tick: u64, step: f32) -> [f32; 2] {
        self.laid.map_or([0.0, 1.0], |(trust, before)| {
            let most = step * tick.saturating_sub(before) as f32;
            [(trust.share - most).max(0.0), (trust.share + most).min(1.0)]
        })
    }
}

impl ToolWindows {
    fn windows(&self) -> impl Iterator<Item = &Window> {
        self.current.iter().chain(&self.leaving)
    }

    fn windows_mut(&mut self) -> impl Iterator<Item = &mut Window> {
        self.current.iter_mut().chain(&mut self.leaving)
    }

    /// Where the confidence goes; `None` while no frame has been written with the window.
    fn confidence_aim(&self) -> Option<f32> {
        self.current.map_or(Some(0.0), |window| window.laid.map(|(trust, _)| trust.confidence))
    }

    /// Moves the window or begins a new one. `is_alone`: no tool has a window, so that a new one needs no hand-over.
    fn touch(&mut self, touch: Touch, jump: f64, is_alone: bool) {
        let is_elsewhere = |w: &Window| (w.touch.contact_point - touch.contact_point).norm() > jump;
        match &mut self.current {
            Some(current) if !is_elsewhere(current) => (current.touch, current.released) = (touch, None),
            Some(current) => {
                // Of two predecessors, the one with the larger gain stays.
                if self.leaving.is_none_or(|l| l.gain <= current.gain) {
                    self.leaving = Some(*current);
                }
                *current = Window::new(touch, 0.0);
            }
            None => self.current = Some(Window::new(touch, if is_alone { 1.0 } else { 0.0 })),
        }
    }

    fn hold(&mut self, enricher: &Enricher, offset: impl Fn(usize) -> f32, dt: f32) {
        let Some(current) = &mut self.current else { return };
        let released = current.released.get_or_insert_with(|| {
            let vertex = enricher.nearest_vertex(&current.touch);
            Released { vertex, at_release: offset(vertex), before: f32::INFINITY, recovered_s: 0.0 }
        });
        let now = offset(released.vertex);
        let is_back = now <= RECOVERED * released.at_release || (now - released.before).abs() <= STILL_M_PER_S * dt;
        released.before = now;
        released.recovered_s = if is_back { released.recovered_s + dt } else { 0.0 };
        if released.recovered_s >= RECOVERED_S {
            (self.current, self.leaving) = (None, self.current);
        }
    }
}
